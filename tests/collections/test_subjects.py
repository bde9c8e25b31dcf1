"""Subjects of several surfaces: what is refused or named before anything is matched, kills, contacts, landmarks."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import isomatch
from isomatch.cli import main
from isomatch.collections import Collection, Subjects, are_subjects, contact_gaps, finish, subject_doubts
from isomatch.collections.subjects import structures_of
from isomatch.errors import FormatError, InputError
from isomatch.statistics import CorrespondedShapes, read_shapes, stacked
from shapes import icosphere
from small_collections import QUICK, lopsided_blob, run

SUBJECTS = ("s1", "s2", "s3", "s4", "s5")


def bodies(i):
    """A large structure and a thinner one beside it, which touches it; each subject with its own proportions."""
    large, small = lopsided_blob(2, i, 0.05), lopsided_blob(2, 100 + i, 0.05)
    left = small.moved(small.vertices[:, [1, 2, 0]] * [0.7, 0.4, 0.4] + [0.2, -1.1, 0.3])
    return {"bone": large, "cap": left}


def write(folder, subject, meshes):
    (folder / subject).mkdir(parents=True, exist_ok=True)
    for structure, mesh in meshes.items():
        isomatch.write_mesh(folder / subject / f"{structure}.ply", mesh)


@pytest.fixture
def folder(tmp_path):
    for i, subject in enumerate(SUBJECTS):
        turn = Rotation.random(random_state=i).as_matrix()
        write(tmp_path / "in", subject, {n: m.moved(m.vertices @ turn.T + i) for n, m in bodies(i).items()})
    (tmp_path / "quick.toml").write_text(QUICK)
    return tmp_path / "in"


def changed(folder, subject, change, *structures):
    """Change the vertices of some structures of a subject, by default of all."""
    for file in (folder / subject).iterdir():
        if not structures or file.stem in structures:
            mesh = isomatch.read_mesh(file)
            isomatch.write_mesh(file, mesh.moved(change(mesh.vertices)))


def doubts(folder, **known):
    return {doubt.kind: doubt for doubt in subject_doubts(structures_of(folder), **known)}


def test_subjects_that_fit_are_not_named(folder):
    assert are_subjects(folder)
    assert not are_subjects(folder / "s1")
    assert doubts(folder) == {}
    shutil.rmtree(folder / "s2")
    (folder / "s3" / "cap.ply").unlink()  # what a subject lacks is nothing that does not fit
    assert doubts(folder) == {}


def test_structures_that_are_named_differently(folder):
    (folder / "s3" / "cap.ply").rename(folder / "s3" / "Kappe.ply")
    with pytest.raises(InputError, match=r"nothing is matched; s3 has Kappe, but not cap; is it the same\?"):
        Subjects.create(folder.parent / "out", folder)
    assert not (folder.parent / "out").exists()
    (folder / "s3" / "Kappe.ply").rename(folder / "s3" / "cap.ply")
    isomatch.write_mesh(folder / "s4" / "extra.ply", icosphere(1))
    with pytest.raises(InputError, match="s4 has extra, and no other subject has it"):
        structures_of(folder)
    (folder / "s4" / "extra.ply").rename(folder / "s4" / "landmarks.ply")
    with pytest.raises(InputError, match="landmarks cannot be names of structures"):
        structures_of(folder)


def test_a_table_and_one_subject_twice_in_it(folder):
    table = folder.parent / "list.csv"
    lines = [
        f"{subject},{name},in/{subject}/{name}.ply\n" for subject in SUBJECTS for name in ("bone", "cap")
    ]
    table.write_text("subject,structure,file\n" + "".join(lines))
    assert are_subjects(table)
    assert structures_of(table) == structures_of(folder)
    table.write_text("subject,structure,file\n" + "".join([*lines, lines[0]]))
    with pytest.raises(InputError, match="s1 has bone 2 times; keep one"):
        structures_of(table)


def test_one_subject_twice(folder):
    shutil.copytree(folder / "s2", folder / "s6")
    changed(folder, "s6", lambda points: points[:, [1, 2, 0]] + 7)
    found = doubts(folder)["twice"]
    assert found.names == ("s2", "s6")
    assert "are the same subject" in found.reason


def test_sides_exchanged(folder):
    for subject in SUBJECTS:  # four that are in no plane
        cap = isomatch.read_mesh(folder / subject / "cap.ply").vertices.mean(axis=0)
        bone = isomatch.read_mesh(folder / subject / "bone.ply")
        frame = bone.vertices[[5, 9]] - bone.vertices.mean(axis=0)
        for name, row in (("left", 0), ("right", 1)):
            ball = icosphere(1)
            write(folder, subject, {name: ball.moved(0.3 * ball.vertices + cap + 3 * frame[row])})
    assert doubts(folder) == {}
    changed(folder, "s4", lambda points: points * [-1, 1, 1])
    for name in (
        "bone",
        "cap",
        "left",
        "right",
    ):  # as files of the other side have it: the outside stays outside
        mesh = isomatch.read_mesh(folder / "s4" / f"{name}.ply")
        isomatch.write_mesh(folder / "s4" / f"{name}.ply", isomatch.Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    found = doubts(folder)
    assert found["mirrored"].names == ("s4",)
    assert "laid out as in a mirror" in found["mirrored"].reason
    assert doubts(folder, reflected_ones=["s4"]) == {}
    made = Subjects.create(folder.parent / "out", folder, reflect="auto")
    assert [each.reflect for each in made.collections.values()] == [("s4",)] * 4
    assert made.doubts == ()


def test_units_mixed(folder):
    changed(folder, "s1", lambda points: points * 1000)
    changed(folder, "s5", lambda points: points / 25.4, "cap")
    named = {
        doubt.names[0]: doubt.reason
        for doubt in subject_doubts(structures_of(folder))
        if doubt.kind == "units"
    }
    assert named.keys() == {"s1", "s5"}
    assert "(--units s1=mm)" in named["s1"]
    assert "mixes units or structures: its cap" in named["s5"]
    left = subject_doubts(structures_of(folder), units=["s1"])
    assert {doubt.names for doubt in left} == {("s5",)}


def test_a_structure_of_another_kind(folder):
    rod = icosphere(2)
    isomatch.write_mesh(folder / "s2" / "cap.ply", rod.moved(rod.vertices * [1.2, 0.1, 0.1]))
    (found,) = subject_doubts(structures_of(folder))
    assert (found.kind, found.names) == ("unlike", ("s2",))
    assert "has another thing as its cap" in found.reason


def test_strangers(folder):
    out = folder.parent / "out"
    for options in ({"template": "x9"}, {"reflect": ["x9"]}, {"units": {"x9": "mm"}}):
        with pytest.raises(InputError, match="x9: no subjects; give their names, such as s1"):
            Subjects.create(out, folder, **options)
    with pytest.raises(FormatError, match="holds no subjects"):
        Subjects.open(folder)


def finished(folder, out):
    """Subjects matched in this process."""
    config = isomatch.Config.from_file(folder.parent / "quick.toml")
    subjects = Subjects.create(out, folder, template="s1", config=config)
    for collection in subjects.collections.values():
        run(collection)
        with ThreadPoolExecutor(1) as executor:
            list(finish(collection, executor, 1))
    return subjects


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.usefixtures("in_threads", "coarse_pictures")
def test_from_files_to_a_model(folder, capsys):
    (folder / "s3" / "cap.ply").unlink()
    out = folder.parent / "out"
    argv = ["collect", str(folder), "-o", str(out), "--template", "s1", "--reports", "none"]
    argv += ["--config", str(folder.parent / "quick.toml")]
    marks = folder.parent / "s1.csv"
    tips = {name: isomatch.read_mesh(folder / "s1" / f"{name}.ply").vertices[5] for name in ("bone", "cap")}
    marks.write_text("name,x,y,z\n" + "".join(f"{n},{x},{y},{z}\n" for n, (x, y, z) in tips.items()))
    assert main([*argv, "--landmarks", str(marks)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "touch: mean distance" in said
    shapes = read_shapes(out)
    assert shapes.names == SUBJECTS
    assert list(shapes.structures) == ["bone", "cap"]
    assert (~shapes.measured).any(axis=1).tolist() == [False, False, True, False, False]
    # what is stacked are the surfaces of the structures, as they are
    bone = isomatch.read_mesh(out / "bone" / "corresponded" / "s4.ply")
    np.testing.assert_array_equal(shapes.vertices[3, : bone.n_vertices], bone.vertices)
    gaps = rows(out / "contacts.csv")
    assert [row["subject"] for row in gaps] == ["s1", "s2", "s4", "s5"]
    assert all(float(row["mean_after"]) >= 0 for row in gaps)
    assert float(gaps[0]["mean_apart"]) < 1e-5  # of the template
    carried = isomatch.Landmarks.read(out / "landmarks" / "s2.mrk.json")
    assert carried.names == ("bone", "cap")
    assert isomatch.Landmarks.read(out / "landmarks" / "s3.mrk.json").names == ("bone",)
    assert main(["collect", "status", str(out), "--json"]) == 0
    status = json.loads(capsys.readouterr().out)
    assert {name: each["pairs"] for name, each in status["structures"].items()}.keys() == {"bone", "cap"}
    assert main(["collect", "export", str(out), str(folder.parent / "x")]) == 1
    assert "give that of a structure, such as" in " ".join(capsys.readouterr().err.split())

    # nothing is matched twice, and a subject that is taken out goes everywhere
    kept = (out / "bone" / "maps" / "s1__s2.npz").stat().st_mtime_ns
    shutil.rmtree(folder / "s5")
    assert main(argv) == 0
    assert (out / "bone" / "maps" / "s1__s2.npz").stat().st_mtime_ns == kept
    assert sorted(path.stem for path in (out / "corresponded").glob("*.ply")) == ["s1", "s2", "s3", "s4"]


def test_what_is_known_of_contacts():
    flat = np.array([[x, y, 0.0] for x in range(6) for y in range(6)])
    quads = [[6 * i + j, 6 * i + j + 6, 6 * i + j + 7, 6 * i + j + 1] for i in range(5) for j in range(5)]
    faces = np.array([corners for a, b, c, d in quads for corners in ([a, b, c], [a, c, d])])
    heights = np.array([0.1, 0.25, -0.05])
    below = CorrespondedShapes("abc", np.array([flat] * 3), faces)
    above = CorrespondedShapes("abc", flat + heights[:, None, None] * [0, 0, 1.0], faces)
    shifted = above.moved(above.vertices + np.array([0, 0.5, 0])[:, None, None] * [1.0, 0, 0])
    files = {
        "below": {n: below.mesh(i) for i, n in enumerate("abc")},
        "above": {n: above.mesh(i) for i, n in enumerate("abc")},
    }
    found = list(contact_gaps(stacked({"below": below, "above": shifted}), files, "a"))
    assert [(gap.subject, gap.structure, gap.other, gap.points) for gap in found] == [
        (n, "below", "above", 36) for n in "abc"
    ]
    for gap, height in zip(found, heights):
        assert gap.mean_before == pytest.approx(abs(height))
        assert gap.gap_before == pytest.approx(
            max(0.0, -height), abs=1e-12
        )  # below lies under the outside of above
        assert gap.overlap_before == pytest.approx(max(0.0, height), abs=1e-12)
    assert found[0].mean_apart == pytest.approx(0, abs=1e-12)
    assert found[1].mean_apart == pytest.approx(np.hypot(0.5, 0.25) - 0.1)
    far = above.moved(above.vertices + np.array([0, 0, 3.0]))
    assert list(contact_gaps(stacked({"below": below, "above": far}), files)) == []


@pytest.mark.long
def test_a_run_that_is_killed_loses_nothing(folder):
    whole = finished(folder, folder.parent / "whole")
    whole.finish()
    out = folder.parent / "out"
    argv = [
        sys.executable,
        "-m",
        "isomatch",
        "collect",
        str(folder),
        "-o",
        str(out),
        "--template",
        "s1",
        "--jobs",
        "1",
    ]
    argv += ["--reports", "none", "--config", str(folder.parent / "quick.toml"), "--time-limit"]
    own = subprocess.Popen([*argv, "1000"], start_new_session=True)
    while own.poll() is None and not list(out.glob("*/maps/*.npz")):
        pass
    os.killpg(own.pid, signal.SIGKILL)
    own.wait()
    kept = {path: path.stat().st_mtime_ns for path in out.glob("*/maps/s1__*.npz")}
    assert 0 < len(kept) < 8
    assert not (out / "corresponded").exists()
    subprocess.run([*argv, "1000"], check=True)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    for file in (whole.folder / "corresponded").glob("*.ply"):
        assert (out / "corresponded" / file.name).read_bytes() == file.read_bytes()
    Collection.open(out / "cap")
