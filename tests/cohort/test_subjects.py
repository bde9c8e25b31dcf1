"""Subjects of several surfaces: what is refused or named before anything is matched, runs, contacts that are kept."""

import errno
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import isomatch
from isomatch import Outcome
from isomatch._core.errors import InputError
from isomatch.cli import main
from isomatch.cohort import Collection
from isomatch.cohort.shape_statistics import CorrespondedShapes, read_shapes, stacked
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.subjects import (
    measure_contacts,
    sides_of,
    structures_of,
    subject_collections,
    subject_doubts,
)
from shapes import flat_grid, icosphere
from small_collections import QUICK, lines_of, lopsided_blob

SUBJECTS = ("s1", "s2", "s3", "s4", "s5")


@pytest.fixture
def folder(tmp_path):
    for i, subject in enumerate(SUBJECTS):
        turn = Rotation.random(random_state=i).as_matrix()
        (tmp_path / "in" / subject).mkdir(parents=True)
        bone, cap = (lopsided_blob(2, seed, 0.05) for seed in (i, 100 + i))  # a thinner structure touches one
        cap = cap.moved(cap.vertices[:, [1, 2, 0]] * [0.7, 0.4, 0.4] + [0.2, -1.1, 0.3])
        for name, mesh in (("bone", bone), ("cap", cap)):
            moved = mesh.moved(mesh.vertices @ turn.T + i)
            isomatch.write_mesh(tmp_path / "in" / subject / f"{name}.ply", moved)
    (tmp_path / "quick.toml").write_text(QUICK)
    return tmp_path / "in"


def changed(folder, subject, change):
    """Change the vertices of all structures of a subject."""
    for file in (folder / subject).iterdir():
        mesh = isomatch.read_mesh(file)
        isomatch.write_mesh(file, mesh.moved(change(mesh.vertices)))


def doubts(folder, **known):
    return [(each.kind, each.names) for each in subject_doubts(structures_of(folder), **known)]


def test_subjects_that_fit_are_not_named(folder):
    assert doubts(folder) == []
    assert structures_of(folder / "s1") == {}  # surfaces of one structure
    shutil.rmtree(folder / "s2")
    (folder / "s3" / "cap.ply").unlink()  # what a subject lacks is nothing that does not fit
    assert doubts(folder) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("cap", "Kappe", "Kappe of s3 may be the same as cap; name structures alike"),
        ("", "extra", "extra of s3 is in no other subject"),
        ("", "corresponded", "corresponded of s3 cannot have this name"),
        ("", "cap.stl", "s3 has cap twice; keep one"),
    ],
)
def test_names_that_do_not_tell_what_is_what(folder, old, new, told):
    isomatch.write_mesh(folder / "s3" / (new if "." in new else f"{new}.ply"), icosphere(1))
    if old:
        (folder / "s3" / f"{old}.ply").unlink()
    with pytest.raises(InputError, match=told):
        structures_of(folder)


def test_a_table(folder):
    table = folder.parent / "list.csv"
    lines = [f"{each},{name},in/{each}/{name}.ply" for each in SUBJECTS for name in ("cap", "bone")]
    table.write_text("\n".join(["subject,structure,file", *lines]))
    assert structures_of(table) == structures_of(folder)


def test_layouts_that_do_not_fit(folder):
    shutil.copytree(folder / "s2", folder / "s6")
    changed(folder, "s6", lambda points: points[:, [1, 2, 0]] + 7)
    assert doubts(folder) == [("twice", ("s2", "s6"))]
    shutil.rmtree(folder / "s6")
    changed(folder, "s1", lambda points: points * 1000)
    assert doubts(folder) == [("units", ("s1",))]
    assert doubts(folder, units={"s1"}) == []


def test_sides_exchanged(folder):
    for subject in SUBJECTS:  # four structures that are in no plane
        cap = isomatch.read_mesh(folder / subject / "cap.ply").vertices.mean(axis=0)
        bone = isomatch.read_mesh(folder / subject / "bone.ply")
        frame = bone.vertices[[5, 9]] - bone.vertices.mean(axis=0)
        for name, row in (("left", 0), ("right", 1)):
            ball = icosphere(1)
            moved = ball.moved(0.3 * ball.vertices + cap + 3 * frame[row])
            isomatch.write_mesh(folder / subject / f"{name}.ply", moved)
    assert doubts(folder) == []
    changed(folder, "s4", lambda points: points * [-1, 1, 1])
    assert doubts(folder) == [("mirrored", ("s4",))]
    assert doubts(folder, reflect=["s4"]) == []


def test_strangers(folder):
    with pytest.raises(InputError, match="x9: no subjects; give names such as s1"):
        subject_collections(folder.parent / "out", structures_of(folder), template="x9")


def test_a_broken_file_is_left_to_its_collection(folder):
    (folder / "s1" / "cap.ply").write_text("no mesh")
    made = subject_collections(folder.parent / "out", structures_of(folder), template="s1")
    assert made.keys() == {"bone", "cap"}


@pytest.mark.long
@pytest.mark.usefixtures("in_threads", "coarse_pictures")
def test_from_files_to_shapes(folder, capsys):
    (folder / "s3" / "cap.ply").unlink()
    out = folder.parent / "out"
    argv = ["collect", str(folder), "-o", str(out), "--template", "s1", "--reports", "none", "--json"]
    argv += ["--config", str(folder.parent / "quick.toml")]
    assert main([*argv, "--landmarks", "marks.csv"]) == 1
    assert main(argv) == 0
    told = json.loads(capsys.readouterr().out)
    assert {name: own["pairs"]["done"] for name, own in told["structures"].items()} == {"bone": 4, "cap": 3}
    assert main(["collect", "status", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["structures"].keys() == told["structures"].keys()
    shapes = read_shapes(out)
    assert (shapes.names, [*shapes.structures]) == (SUBJECTS, ["bone", "cap"])
    assert shapes.seen[2].sum() == shapes.structures["bone"]
    bone = isomatch.read_mesh(out / "bone" / "corresponded" / "s4.ply")  # stacked as it is
    np.testing.assert_array_equal(shapes.vertices[3, : bone.n_vertices], bone.vertices)
    assert [row["subject"] for row in lines_of(out / "contacts.csv")] == ["s1", "s2", "s4", "s5"]
    # nothing is matched twice, and a subject that is taken out goes everywhere
    kept = (out / "bone" / "maps" / "s1__s2.npz").stat().st_mtime_ns
    shutil.rmtree(folder / "s5")
    assert main(argv) == 0
    assert (out / "bone" / "maps" / "s1__s2.npz").stat().st_mtime_ns == kept
    assert sorted(path.stem for path in (out / "corresponded").glob("*.ply")) == ["s1", "s2", "s3", "s4"]


class Structure(SimpleNamespace):
    """A matched star: a template, the subjects that are reflected, and those whose maps are not sure."""

    def rows(self):
        known = (Outcome.CONVERGED, Outcome.SYMMETRY_AMBIGUOUS)
        outcomes = {name: known[name in self.unsure] for name in self.names}
        pairs = {
            (self.template, name): SimpleNamespace(sides=[SimpleNamespace(outcome=each)])
            for name, each in outcomes.items()
        }
        reflected = [name for name in self.names if name in self.turned]
        return SimpleNamespace(reflected=lambda names: reflected, is_current=pairs.__contains__, pairs=pairs)

    def chosen_template(self, rows):
        return self.template


def star(template, turned, unsure="", names="abcd"):
    plan = Structure(template=template, turned=turned, unsure=unsure, names=list(names))
    return Snapshot(plan, plan.rows())


def test_most_structures_decide_whether_a_subject_is_reflected_and_the_others_are_named():
    assert sides_of({"A": star("a", "d"), "B": star("a", "d")}) == ({"d"}, [])
    assert sides_of({"A": star("a", ""), "B": star("a", "")}) == (set(), [])
    three = {"A": star("a", "d"), "B": star("a", "cd"), "C": star("a", "d")}
    assert sides_of(three) == ({"d"}, [("B", "c")])
    # what reflects none tells no sides, and a map that is not sure none of its subject
    assert sides_of({"A": star("a", "d"), "B": star("a", ""), "C": star("a", "")}) == ({"d"}, [])
    assert sides_of({"A": star("a", "d", unsure="c"), "B": star("a", "cd")}) == ({"c", "d"}, [])
    # of a template of the other side, the others are reflected
    assert sides_of({"A": star("a", "cd"), "B": star("c", "ab")}) == ({"c", "d"}, [])


def test_the_layout_of_the_structures_has_a_vote():
    unsure = {"A": star("a", "d", unsure="c"), "B": star("a", "d", unsure="c")}
    assert sides_of(unsure, {"c", "d"}) == ({"c", "d"}, [])
    assert sides_of(unsure, {"a", "b"}) == ({"c", "d"}, [])  # the template is among the mirror images of most
    assert sides_of({"A": star("a", ""), "B": star("a", "")}, {"c"}) == ({"c"}, [])


def one_side(out):
    """Which subjects are reflected, and the template, as all structures have them."""
    collections = [Collection.open(out / name) for name in ("bone", "cap")]
    found = [(each.rows().reflected(each.names), each.chosen_template(each.rows())) for each in collections]
    assert found[0] == found[1]
    return found[0]


@pytest.mark.long
@pytest.mark.usefixtures("in_threads", "coarse_pictures")
def test_a_subject_is_reflected_as_a_whole_and_stays_so(folder, capsys):
    for subject in ("s2", "s4"):
        changed(folder, subject, lambda points: points * [-1, 1, 1])
    argv = ["collect", str(folder), "-o", str(folder.parent / "out"), "--reports", "none"]
    argv += ["--reflect", "auto", "--config", str(folder.parent / "quick.toml")]
    assert main(argv) == 0
    turned, template = one_side(folder.parent / "out")
    assert turned == (["s1", "s3", "s5"] if template in ("s2", "s4") else ["s2", "s4"])
    maps = {path: path.stat().st_mtime_ns for path in (folder.parent / "out").glob("*/maps/*")}
    assert main(argv) == 0
    assert one_side(folder.parent / "out") == (turned, template)
    assert {path: path.stat().st_mtime_ns for path in maps} == maps


def with_a_sheet(tmp_path, subjects=("s1", "s2", "s3")):
    """Subjects of a bone and a round sheet on it, in which nothing tells how it is turned; vertices correspond."""
    round_ = lopsided_blob(3).vertices @ [-0.4, -0.4, -0.82] > 0.3
    for i, subject in enumerate(subjects):
        bone = lopsided_blob(3, i, 0.05)
        kept, corners = np.unique(bone.faces[round_[bone.faces].all(axis=1)], return_inverse=True)
        sheet = isomatch.Mesh(1.02 * bone.vertices[kept], corners.reshape(-1, 3))
        turn = Rotation.random(random_state=i).as_matrix()
        (tmp_path / "in" / subject).mkdir(parents=True)
        for name, mesh in (("bone", bone), ("sheet", sheet)):
            isomatch.write_mesh(tmp_path / "in" / subject / f"{name}.ply", mesh.moved(mesh.vertices @ turn.T))
    return tmp_path / "in"


@pytest.mark.long
@pytest.mark.usefixtures("in_threads")
def test_what_lies_on_another_starts_from_its_map(tmp_path):
    found = structures_of(with_a_sheet(tmp_path))
    (tmp_path / "quick.toml").write_text(QUICK)
    config = isomatch.Config.from_file(tmp_path / "quick.toml")

    def matched(out):
        collections = subject_collections(tmp_path / out, found, config=config)
        return collections, {name: [*each.run(jobs=1)] for name, each in collections.items()}

    collections, _ = matched("out")
    bone, sheet = collections["bone"], collections["sheet"]
    assert sheet.leader == Collection.open(sheet.folder).leader == bone
    assert (bone.leader, sheet.chosen_template(sheet.rows())) == (None, bone.chosen_template(bone.rows()))
    for pair, row in sheet.rows().pairs.items():
        assert row.led_by == bone.rows().pairs[pair].key
        mesh, there = isomatch.read_mesh(found["sheet"][pair[1]]), sheet.maps(*pair).forward
        apart = np.linalg.norm(there.pull_back(mesh.vertices) - mesh.vertices, axis=1)
        assert np.median(apart) < 0.05 * np.sqrt(mesh.area)
    # nothing is matched twice; with another bone, the sheet is matched again, too
    assert not any(event.what == "pair" for events in matched("out")[1].values() for event in events)
    other = next(name for name in found["bone"] if name != bone.chosen_template(bone.rows()))
    mesh = isomatch.read_mesh(found["bone"][other])
    isomatch.write_mesh(found["bone"][other], mesh.moved(mesh.vertices * 1.001))
    _, events = matched("out")
    (again,) = (event.row for event in events["sheet"] if event.what == "pair")
    assert again.again == ("the map that it starts from changed",)
    # without a map that can be relied on, it is matched by itself
    alone = Collection.create(
        tmp_path / "alone", sheet.shapes, template=sheet.names[0], config=config, leader=bone
    )
    bone.layout.ledger().unlink()
    list(alone.run(jobs=1))
    assert not any(row.led_by for row in alone.rows().pairs.values())


@pytest.mark.long
@pytest.mark.usefixtures("in_threads", "coarse_pictures")
def test_after_a_disk_was_full_at_any_file_subjects_are_continued(tmp_path, monkeypatch, capsys):
    """After each file in turn was written, the disk is full; in the end all is as if it had not been."""
    argv = ["collect", str(with_a_sheet(tmp_path)), "--reports", "none"]
    argv += ["--config", str(tmp_path / "quick.toml")]
    (tmp_path / "quick.toml").write_text(QUICK)
    assert main([*argv, "-o", str(tmp_path / "once")]) == 0
    moved, seen, out = Path.replace, set(), tmp_path / "out"

    def moved_and_full(path, to):
        moved(path, to)
        if (file := tuple(part for part in to.parts if "unfinished" not in part)) not in seen:
            seen.add(file)
            raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", moved_and_full)
        while main([*argv, "-o", str(out)]):
            assert "No space left" in capsys.readouterr().err
    assert len(seen) > 20
    files = {
        name: [*Path(tmp_path / name).glob("**/*.ply"), tmp_path / name / "contacts.csv"]
        for name in ("once", "out")
    }
    once, then = ({str(f.relative_to(tmp_path / n)): f.read_bytes() for f in own} for n, own in files.items())
    assert once == then
    assert not list(out.glob("**/.*"))


def sheets(shift):
    """A flat bone and a smaller sheet over it, in two subjects; in the second the sheet's points slip along it."""
    grid = flat_grid(20, 20)
    flat, faces = grid.vertices, grid.faces
    small = flat * [0.5, 0.5, 1] + [5, 5, 0.3]
    slipped = small + shift * np.sin(flat[:, :1] * np.pi / 19) * [1, 0, 0]
    bone = CorrespondedShapes(("a", "b"), np.array([flat, flat]), faces)
    return stacked({"bone": bone, "sheet": CorrespondedShapes(("a", "b"), np.array([small, slipped]), faces)})


def test_points_that_touch_are_kept_together():
    shapes, (first, second) = measure_contacts(sheets(0.6))
    assert (first.slip_before, second.note, second.without) == (0, "", 0)
    assert second.slip_after < 0.02 < 0.3 < second.slip_before
    assert second.gap_after == pytest.approx(0.3, abs=1e-6)  # still on the sheet
    np.testing.assert_allclose(shapes.vertices[1, 400:], shapes.vertices[0, 400:], atol=0.1)
    _, gaps = measure_contacts(sheets(0.6), move=False)
    assert gaps[1].slip_after == gaps[1].slip_before


def test_points_beyond_the_edge_have_no_counterpart():
    shapes = sheets(0.0)
    vertices = shapes.vertices.copy()
    vertices[1, 400:, 0] = 5 + (vertices[1, 400:, 0] - 5) * 0.8  # a sheet that ends before
    kept, (_, second) = measure_contacts(shapes.moved(vertices))
    assert second.without == pytest.approx(0.2, abs=0.06)
    np.testing.assert_allclose(kept.vertices[1, 400:], shapes.vertices[0, 400:], atol=0.2)
    vertices[1, 400:, 0] = 5 + (vertices[1, 400:, 0] - 5) * 0.3
    kept, (_, second) = measure_contacts(shapes.moved(vertices))
    assert "left as matched" in second.note
    np.testing.assert_array_equal(kept.vertices, vertices)
