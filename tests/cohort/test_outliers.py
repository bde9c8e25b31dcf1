"""A folder of troubles: a copy, a scan in millimetres, a mirrored one, one with a hole, a broken file, another kind."""

import json
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Correspondence, InputError, Mesh, read_asset, read_mesh, write_mesh
from isomatch.cli import main
from isomatch.cohort import Collection, Rows, ShapeRow, export, outliers
from isomatch.cohort.map_file import keep_files
from isomatch.cohort.plan import scales_of
from isomatch.cohort.shape_statistics import ShapeModel, read_shapes
from isomatch.cohort.unusual_shapes import alike_shapes, likeness_of
from isomatch.correspondence import UNMATCHED
from isomatch.surfaces import reflected
from shapes import box, disguised
from small_collections import finished_names, lopsided_blob, run

GOOD = tuple(f"good{i}" for i in range(6))
SEEDS = 11, 15, 16, 17, 18, 19  # of blobs of which none is far from the others
TROUBLES = {
    "broken": {"broken"},
    "twin": {"twice"},
    "same": {"twice"},
    "hole": {"holes"},
    "left": {"mirrored"},
    "millimetres": {"units"},
    "reflection": {"mirrored"},
}


def blob(seed):
    return lopsided_blob(2, seed, spread=0.04)


def with_hole(mesh):
    """A mesh without the faces near the tip of a bump."""
    near = np.linalg.norm(mesh.vertices - mesh.vertices[mesh.vertices[:, 1].argmax()], axis=1) < 0.5
    return Mesh(mesh.vertices, mesh.faces[~near[mesh.faces].any(axis=1)])


def written(folder, names):
    """The good shapes and those of the troubles that are named, each in its file."""
    folder.mkdir()
    for seed, name in zip(SEEDS, GOOD):
        write_mesh(folder / f"{name}.ply", disguised(blob(seed), seed).mesh)
    makes = {
        "twin": lambda: disguised(read_mesh(folder / "good1.ply"), 20).mesh,
        "hole": lambda: with_hole(blob(20)),
        "left": lambda: disguised(reflected(blob(28)), 22).mesh,
        "millimetres": lambda: disguised(blob(12), 23, scale=1000.0).mesh,
        "reflection": lambda: disguised(reflected(read_mesh(folder / "good4.ply")), 24).mesh,
    }
    for name in names:
        if name in makes:
            write_mesh(folder / f"{name}.ply", makes[name]())
    if "same" in names:
        shutil.copy(folder / "good2.ply", folder / "same.ply")
    if "broken" in names:
        data = (folder / "good3.ply").read_bytes()
        (folder / "broken.ply").write_bytes(data[: len(data) // 2])
    return folder


def kinds(collection):
    found = {}
    for kind, name, _ in outliers(collection, collection.rows()):
        found.setdefault(name, set()).add(kind)
    return found


@pytest.fixture(scope="module")
def troubled(small, tmp_path_factory):
    """The folder of troubles, and a star of its shapes that is finished; not to be changed."""
    base = tmp_path_factory.mktemp("troubles")
    shapes = written(base / "shapes", TROUBLES)
    collection = Collection.create(base / "out", shapes, template="good0", config=small.config)
    events = run(collection)
    finished_names(collection)
    return SimpleNamespace(shapes=shapes, collection=collection, events=events, config=small.config)


@pytest.fixture(scope="module")
def plain(small, tmp_path_factory):
    """A star of the good shapes alone."""
    base = tmp_path_factory.mktemp("good")
    collection = Collection.create(
        base / "out", written(base / "shapes", ()), template="good0", config=small.config
    )
    run(collection)
    finished_names(collection)
    return collection


@pytest.mark.long
def test_every_trouble_is_named_and_nothing_else(troubled, plain):
    assert kinds(troubled.collection) == TROUBLES
    assert kinds(plain) == {}


@pytest.mark.long
def test_what_can_be_told_is_told_before_anything_is_matched(troubled):
    what = [event.what for event in troubled.events]
    assert what == ["shape"] * what.count("shape") + ["outlier"] * what.count("outlier") + [
        "pair"
    ] * what.count("pair")
    told = {event.name: event.row.reason for event in troubled.events if event.what == "outlier"}
    assert set(told) == {"twin", "same", "hole", "millimetres", "reflection"}
    assert re.fullmatch(
        r"is \d+ times as large as the others: in mm, if they are in m\? \(--units millimetres=mm\)",
        told["millimetres"],
    )
    assert told["twin"] == "is the same shape as good1; remove one of them"
    assert told["same"] == "is the same file as good2; remove one of them"
    assert told["reflection"] == "is the mirror image of good4, the same shape reflected"
    assert told["hole"].startswith("has a hole, ")


@pytest.mark.long
def test_status_and_the_first_page_name_them(troubled, capsys):
    assert main(["collect", "status", str(troubled.collection.folder)]) == 3  # one is broken
    said = capsys.readouterr().out
    assert main(["collect", "status", str(troubled.collection.folder), "--json"]) == 3
    listed = json.loads(capsys.readouterr().out)["outliers"]
    assert {(each["name"], each["kind"]) for each in listed} == {
        (name, kind) for name, of in TROUBLES.items() for kind in of
    }
    page = troubled.collection.layout.page.read_text()
    first = page[page.index("To look at first") : page.index("Shapes in the topology")]
    for name in TROUBLES:
        assert name in said
        assert f"<b>{name}</b>" in first


@pytest.mark.long
def test_without_them_everything_is_as_it_would_have_been(troubled, plain, tmp_path):
    """Shapes that are taken out leave the surfaces, the statistics, the pictures and the reports."""
    folder = shutil.copytree(troubled.collection.folder, tmp_path / "out")
    (folder / "reports").mkdir()
    for name in ("good1", "twin"):
        (folder / "reports" / f"good0__{name}.html").write_text("a report")
    (folder / "corresponded" / "mine.txt").write_text("not ours")
    kept = [path for path in sorted(troubled.shapes.iterdir()) if path.stem in GOOD]
    collection = Collection.create(folder, kept, template="good0", config=troubled.config)
    assert run(collection) == []
    assert finished_names(collection) == []
    assert {path.name for path in (folder / "corresponded").iterdir()} == {
        "mine.txt",
        *(f"{name}.ply" for name in GOOD),
    }
    assert {path.stem for path in (folder / "thumbnails").iterdir()} == set(GOOD)
    assert {path.stem for path in (folder / "reports").iterdir()} == {"good0__good1"}
    assert "twin" not in collection.layout.page.read_text()
    assert kinds(collection) == {}
    model = ShapeModel.fit(read_shapes(folder))
    wanted = ShapeModel.fit(read_shapes(plain.folder))
    assert model.names == wanted.names == GOOD
    np.testing.assert_allclose(model.variances, wanted.variances, rtol=1e-9)


@pytest.mark.long
def test_a_shape_whose_file_breaks_leaves_too(plain, tmp_path, small):
    shapes = shutil.copytree(plain.paths["good0"].parent, tmp_path / "shapes")
    folder = shutil.copytree(plain.folder, tmp_path / "out")
    (shapes / "good5.ply").write_bytes(b"ply\n")
    collection = Collection.create(folder, shapes, template="good0", config=small.config)
    run(collection)
    finished_names(collection)
    assert not collection.layout.corresponded("good5").exists()
    assert read_shapes(folder).names == GOOD[:5]
    assert kinds(collection) == {"good5": {"broken"}}


@pytest.mark.long
def test_units_that_are_given_mend_it(troubled, small, tmp_path, capsys):
    """Without matching anything again; also from the command line."""
    folder = shutil.copytree(troubled.collection.folder, tmp_path / "out")
    collection = Collection.create(
        folder, troubled.shapes, template="good0", config=troubled.config, units={"millimetres": "mm"}
    )
    assert scales_of(collection.units, collection.rows()) == {"millimetres": pytest.approx(0.001)}
    assert {event.what for event in run(collection)} == {"outlier"}
    assert finished_names(collection) == ["millimetres"]
    assert "millimetres" not in kinds(collection)
    before, after = (
        read_mesh(each.layout.corresponded("millimetres")) for each in (troubled.collection, collection)
    )
    np.testing.assert_allclose(after.vertices, before.vertices / 1000, rtol=1e-6)
    again = Collection.create(folder, troubled.shapes, template="good0", config=troubled.config)
    assert again.units == {"millimetres": "mm"}
    assert Collection.open(folder).units == {"millimetres": "mm"}
    argv = ["collect", str(troubled.shapes), "-o", str(folder), "--template", "good0", "--jobs", "1"]
    argv += ["--config", str(small.settings), "--reports", "none", "--units"]
    assert main([*argv, "m, millimetres=cm"]) == 3  # one is broken
    assert Collection.open(folder).units == {"*": "m", "millimetres": "cm"}
    assert "look at millimetres: it is 10" in capsys.readouterr().out
    assert main([*argv, "none", "--quiet"]) == 3
    assert "isomatch: millimetres is 10" in capsys.readouterr().err


def rows(**sizes):
    return Rows(
        {name: ShapeRow(state="done", area=size**2, features=(size,)) for name, size in sizes.items()}
    )


@pytest.mark.parametrize(
    ("size", "units", "expected"),
    [
        (10.0, {}, {}),
        (10.0, {"c": "mm"}, {"c": 0.1}),
        (1200.0, {"c": "mm"}, {"c": 0.001}),
        (0.01, {"c": "m"}, {"c": 100.0}),
        (20.0, {"c": "mm"}, {"c": 1 / 25.4}),
        (10.0, {"c": "mm", "*": "m"}, {"c": 0.001}),
        (10.0, {"a": "cm", "b": "cm", "c": "mm"}, {"c": 0.1}),
        (10.0, {"c": "in", "*": "in"}, {}),
    ],
)
def test_the_unit_of_the_others(size, units, expected):
    """Of shapes of one and ten: centimetres, if the latter is in millimetres, unless it is given."""
    assert scales_of(units, rows(a=1.0, b=1.1, c=size)) == pytest.approx(expected)


def test_units_that_fit_no_others_are_named(small, tmp_path):
    collection = Collection.create(tmp_path, small.shapes, config=small.config, units={"s1": "mm"})
    sizes = rows(s0=1.0, s1=5e5, s2=1.0, s3=1.1)
    assert scales_of(collection.units, sizes) == {}
    ((kind, name, reason),) = outliers(collection, sizes)
    assert (kind, name) == ("units", "s1")
    assert "said to be in mm, which fits no unit of the others" in reason


def test_units_of_strangers_and_unknown_units_are_refused(small, tmp_path):
    for units, message in (({"x": "mm"}, "x: units of no shape"), ({"s0": "ell"}, "ell: unknown units")):
        with pytest.raises(InputError, match=message):
            Collection.create(tmp_path, small.shapes, config=small.config, units=units)


@pytest.mark.long
def test_a_shape_unlike_the_others(plain, tmp_path):
    """As of a wrong map: its vertices are those of the others in another order."""
    collection = Collection.open(shutil.copytree(plain.folder, tmp_path / "out"))
    surface = collection.layout.corresponded("good5")
    mesh = read_mesh(surface)
    write_mesh(surface, mesh.moved(np.random.default_rng(0).permutation(mesh.vertices)))
    keep_files(collection.layout, [surface])
    table = collection.layout.shapes_table
    table.write_text(re.sub("(?m)^good4,[^,]*,", "good4,of an earlier map,", table.read_text()))
    assert finished_names(collection) == ["good4"]
    assert kinds(collection) == {"good5": {"unlike"}}
    assert "good5</b> <small>unlike</small> differs from the others by " in collection.layout.page.read_text()


@pytest.mark.parametrize("seed", range(5))
def test_order_motion_and_size_do_not_hide_a_copy(seed):
    one, other = blob(0), blob(seed + 1)
    moved = disguised(one, seed, scale=0.1).mesh
    single = Mesh(moved.vertices.astype(np.float32), moved.faces)
    for surface, kind in ((single, "copy"), (reflected(single), "mirror image")):
        (found,) = alike(a=one, b=other, c=surface)
        assert (found.name, found.other, found.kind, found.is_equal) == ("c", "a", kind, False)
        assert found.factor == pytest.approx(0.1)


def test_a_symmetric_shape_is_its_own_mirror_image():
    (found,) = alike(a=box(2, 3, 4), b=disguised(reflected(box(2, 3, 4)), 1).mesh)
    assert found.kind == "copy"
    assert alike(a=box(2, 3, 4), b=box(2, 3, 5), c=box(4, 3, 3)) == []


def alike(**surfaces):
    return alike_shapes(
        {
            name: ShapeRow(state="done", hash=mesh.content_hash, **likeness_of(mesh))
            for name, mesh in surfaces.items()
        }
    )


@pytest.mark.long
def test_what_a_specimen_lacks_is_missing_in_its_surface(plain, tmp_path):
    collection = Collection.open(shutil.copytree(plain.folder, tmp_path / "out"))
    maps = collection.maps("good0", "good3")
    there = maps.forward
    vertices = np.where(np.arange(len(there.vertices)) < 20, UNMATCHED, there.vertices)
    hashes = there.source_hash, there.target_hash
    partial = Correspondence(vertices, there.n_target, there.faces, there.barycentric, *hashes)
    replace(maps, forward=partial).save(collection.layout.maps(("good0", "good3")))
    collection.layout.corresponded("good3").unlink()
    assert finished_names(collection) == ["good3"]
    shapes = read_shapes(collection.folder)
    assert [int((~row).sum()) for row in shapes.measured] == [0, 0, 0, 20, 0, 0]
    assert not shapes.measured[3, :20].any()
    list(export(collection, tmp_path / "exported", ".vtp", None))
    kept = read_asset(tmp_path / "exported" / "meshes" / "good3.vtp").attribute("measured")
    assert np.array_equal(kept.values.astype(bool), shapes.measured[3])
    argv = ["statistics", str(collection.folder), "-o", str(tmp_path / "statistics"), "--json"]
    assert main(argv) == 0
    seen = read_asset(tmp_path / "statistics" / "variance.ply").attribute("measured").values
    assert seen.tolist() == [5.0] * 20 + [6.0] * 142
