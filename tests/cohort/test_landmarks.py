"""Landmarks of some shapes of a collection, carried to the others, in Python and by ``isomatch collect landmarks``."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from isomatch import InputError, Landmarks, Outcome, read_asset, read_mesh, write_asset, write_landmarks
from isomatch.cli import main
from isomatch.cohort import Collection, collected_landmarks, export
from isomatch.cohort.landmarks import landmarks_left_out
from isomatch.cohort.ledger import writing_ledger
from isomatch.cohort.map_file import digest_of
from isomatch.io import Frame
from isomatch.landmarks import Curve
from isomatch.surfaces import nearest_on_surface
from small_collections import finished_names, lines_of, run

NAMES = ("nose", "tail", "foot", "c1", "c2", "c3")
ROWS = [3, 100, 200, 30, 40, 50]


@pytest.fixture
def marks(small, tmp_path):
    """Landmarks of two of the four shapes, with a curve."""
    folder = tmp_path / "marks"
    folder.mkdir()
    for name in ("s0", "s2"):
        mesh = read_mesh(small.shapes / f"{name}.ply")
        write_landmarks(
            folder / f"{name}.mrk.json", Landmarks(mesh.vertices[ROWS], NAMES, [Curve("rim", (3, 4, 5))])
        )
    return folder


@pytest.mark.long
def test_every_shape_gets_landmarks_of_its_own(finished, small, marks):
    collection = Collection.open(finished)
    files = {name: marks / f"{name}.mrk.json" for name in ("s0", "s2")}
    found = dict(collected_landmarks(collection, files))
    assert list(found) == ["s0", "s1", "s2", "s3"]
    for name, each in found.items():
        mesh = read_mesh(small.shapes / f"{name}.ply")
        assert each.names == NAMES
        assert each.placed.all()
        assert np.isnan(each.spread).all() == (name in files)
        if name in files:
            np.testing.assert_allclose(each.positions[:3], mesh.vertices[ROWS[:3]], atol=1e-6)
    with pytest.raises(InputError, match="x: no shapes of"):
        list(collected_landmarks(collection, {"x": files["s0"]}))


@pytest.mark.long
def test_over_the_template_of_a_star(small, marks, tmp_path):
    """Two shapes that are not matched with each other: the maps over the template are joined, and their errors."""
    collection = Collection.create(tmp_path / "star", small.shapes, template="s1", config=small.config)
    run(collection)
    found = dict(collected_landmarks(collection, {"s0": marks / "s0.mrk.json"}, curve_points=4))
    assert list(found) == ["s0", "s1", "s2", "s3"]
    there = collection.maps("s0", "s1").forward
    onward = collection.maps("s1", "s3").forward
    mesh = read_mesh(small.shapes / "s3.ply")
    joined = there.then(onward, read_mesh(small.shapes / "s1.ply"), mesh)
    np.testing.assert_allclose(
        found["s3"].positions[:3], joined.pull_back(mesh.vertices)[ROWS[:3]], atol=1e-6 * np.sqrt(mesh.area)
    )
    assert found["s3"].names[3:] == ("rim-1", "rim-2", "rim-3", "rim-4")
    errors = collection.maps("s0", "s1").forward_error, collection.maps("s1", "s3").forward_error
    both = np.hypot(errors[0], there.pull_back(errors[1]))
    size = np.sqrt(mesh.area)
    np.testing.assert_allclose(found["s3"].expected_error[:3], size * both[ROWS[:3]], rtol=1e-4)


def changed(collection, name, **values):
    """Write other values into the rows of all pairs of a shape."""
    with writing_ledger(collection.layout.ledger()) as ledger:
        for pair, row in list(ledger.rows.pairs.items()):
            if name in pair:
                ledger.put(pair, replace(row, **values))


@pytest.mark.long
def test_doubtful_maps_and_those_of_earlier_files_are_not_used(copied, marks, tmp_path, capsys):
    row = copied.rows().pairs["s0", "s1"]
    changed(copied, "s1", backward=row.backward.with_outcome(Outcome.MIRROR_IMAGE))
    changed(copied, "s3", source_hash="of an earlier file")
    argv = ["collect", "landmarks", str(copied.folder), str(marks), str(tmp_path / "out")]
    assert main([*argv, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["shapes"], record["left_out"]) == (["s0", "s2"], ["s1", "s3"])
    assert record["doubtful"] == [["s0", "s1"], ["s1", "s2"]]
    assert main([*argv, "--force"]) == 0
    assert "doubtful: the maps of s0 and s1, s1 and s2" in capsys.readouterr().out
    maps = [path.name for path, _ in export(copied, tmp_path / "maps", meshes=None)]
    assert len(maps) == 6 + 1
    assert not any("s3" in name for name in maps)


@pytest.mark.long
def test_reflected_shapes_are_reflected_in_the_tables(copied, marks, tmp_path, capsys):
    with writing_ledger(copied.layout.ledger()) as ledger:
        ledger.put("s0", replace(ledger.rows.shapes["s0"], reflected=True))
    changed(copied, "s0", reflected=("s0",))
    out = tmp_path / "out"
    argv = ["collect", "landmarks", str(copied.folder), str(marks), str(out), "--format", "csv"]
    assert main([*argv, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["reflected"] == ["s0"]
    table = {row["specimen"]: row for row in lines_of(out / "landmarks.csv")}
    for name, sign in (("s0", -1), ("s1", 1)):
        own = Landmarks.read(out / f"{name}.csv", copied.paths[name])["nose"]
        assert [float(table[name][f"nose_{axis}"]) for axis in "XYZ"] == (own * [sign, 1, 1]).tolist()
    assert main([*argv, "--force"]) == 0
    assert "reflected in the tables, as they were matched: s0" in capsys.readouterr().out


@pytest.mark.long
def test_other_curves_are_not_in_the_tables_and_what_a_format_lacks_is_told(
    finished, small, marks, tmp_path, capsys
):
    mesh = read_mesh(small.shapes / "s2.ply")
    write_landmarks(marks / "s2.mrk.json", Landmarks(mesh.vertices[ROWS], NAMES))
    argv = ["collect", "landmarks", str(finished), str(marks), str(tmp_path / "out"), "--format", "fcsv"]
    assert main([*argv, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["other_landmarks"], record["not_written"]) == (["s2"], ["curves"])
    assert main([*argv, "--force"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "not written, because .fcsv has no place for them: curves" in said


@pytest.mark.long
def test_the_command_writes_files_and_tables(finished, marks, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["collect", "landmarks", str(finished), str(marks), str(out)]
    assert main([*argv, "--format", "csv", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["templates"], record["left_out"]) == (["s0", "s2"], [])
    assert set(record["mean_spread"]) == {"s1", "s3"}
    tables = (f"landmarks{end}" for end in (".csv", ".tps", "_errors.csv", "_sliders.csv"))
    assert {path.name for path in out.iterdir()} == {*tables, *(f"s{i}.csv" for i in range(4))}
    rows = lines_of(out / "landmarks.csv")
    assert [row["specimen"] for row in rows] == ["s0", "s1", "s2", "s3"]
    assert rows[0]["nose_X"] == repr(float(rows[0]["nose_X"]))
    assert (out / "landmarks.tps").read_text().count("LM3=") == 4
    assert main(argv) == 1
    assert "already exists" in capsys.readouterr().err
    assert main([*argv, "--force"]) == 0
    assert "s1: mean spread" in capsys.readouterr().out
    assert main(["collect", "landmarks", str(finished), str(tmp_path), str(out), "--force"]) == 1
    assert (
        "no landmarks of a shape of the collection; give a folder of files such as s0.mrk.json"
        in capsys.readouterr().err
    )


@pytest.mark.long
def test_expected_errors_come_with_the_maps(finished, marks):
    """Of one map they are those of its result; over the template, the root of the sum of squares."""
    collection = Collection.open(finished)
    maps = collection.maps("s0", "s1")
    assert np.isfinite(maps.forward_error[maps.forward.matched]).all()
    assert np.array_equal(collection.maps("s1", "s0").backward_error, maps.forward_error)
    (found,) = (
        each for name, each in collected_landmarks(collection, {"s0": marks / "s0.mrk.json"}) if name == "s1"
    )
    size = np.sqrt(read_mesh(collection.paths["s1"]).area)
    np.testing.assert_allclose(found.expected_error[:3], size * maps.forward_error[ROWS[:3]], rtol=1e-4)


def test_maps_of_earlier_versions_have_no_expected_errors(copied, marks):
    for pair in copied.rows().pairs:
        maps = copied.maps(*pair)
        file = copied.layout.maps(pair)
        replace(maps, forward_error=None, backward_error=None).save(file)
        with writing_ledger(copied.layout.ledger()) as ledger:
            ledger.put(pair, replace(ledger.rows.pairs[pair], file=digest_of(file)))
    assert copied.maps("s0", "s1").forward_error is None
    found = dict(collected_landmarks(copied, {"s0": marks / "s0.mrk.json"}))
    assert found["s1"].placed.all()
    assert np.isnan(found["s1"].expected_error).all()


def test_marked_shapes_are_compared_with_what_the_others_give(finished, small, marks):
    """s0 and s2 are one shape, s1 another: each marked one is carried from the others, without its own marks."""
    collection = Collection.open(finished)
    files = {name: marks / f"{name}.mrk.json" for name in ("s0", "s2")}
    found = {each.name: each for each in landmarks_left_out(collection, files)}
    assert set(found) == set(files)
    carried = dict(collected_landmarks(collection, {"s2": files["s2"]}))["s0"]
    own = dict(collected_landmarks(collection, {"s0": files["s0"]}))["s0"]
    np.testing.assert_allclose(found["s0"].carried.positions, carried.positions, atol=1e-9)
    wanted = np.linalg.norm(carried.positions - own.positions, axis=1)
    np.testing.assert_allclose(found["s0"].error, wanted, atol=1e-9)
    assert list(landmarks_left_out(collection, {"s0": files["s0"]})) == []


def test_landmarks_of_other_names_have_no_error(finished, small, marks):
    mesh = read_mesh(small.shapes / "s2.ply")
    write_landmarks(marks / "s2.mrk.json", Landmarks(mesh.vertices[ROWS[:3]], ["tail", "nose", "ear"]))
    mesh = read_mesh(small.shapes / "s0.ply")
    write_landmarks(marks / "s0.mrk.json", Landmarks(mesh.vertices[ROWS[:2]], ["nose", "tail"]))
    collection = Collection.open(finished)
    files = {name: marks / f"{name}.mrk.json" for name in ("s0", "s2")}
    (of_s2,) = (each for each in landmarks_left_out(collection, files) if each.name == "s2")
    assert of_s2.carried.names == ("nose", "tail")
    theirs = Landmarks.read(files["s2"], small.shapes / "s2.ply")
    wanted = [np.linalg.norm(of_s2.carried[name] - theirs[name]) for name in ("nose", "tail")]
    np.testing.assert_allclose(of_s2.error, wanted, atol=1e-9)
    (of_s0,) = (each for each in landmarks_left_out(collection, files) if each.name == "s0")
    assert np.isnan(of_s0.error).tolist() == [False, False, True]


@pytest.mark.long
def test_collect_carries_the_landmarks_of_the_template(small, marks, in_threads, tmp_path, capsys):
    """On a collection that is matched already; the file of another name is that of the template that is named."""
    out = tmp_path / "star"
    collection = Collection.create(out, small.shapes, template="s0", config=small.config, units={"s3": "mm"})
    run(collection)
    argv = ["collect", str(small.shapes), "-o", str(out), "--template", "s0", "--config", str(small.settings)]
    argv += ["--jobs", "1", "--reports", "none", "--landmarks"]
    template = (marks / "s0.mrk.json").rename(tmp_path / "atlas.mrk.json")
    assert main([*argv, str(template), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)["landmarks"]
    assert record["templates"] == ["s0"]
    assert record["shapes"] == ["s0", "s1", "s2", "s3"]
    assert set(record["expected_error"]) == {"s1", "s2", "s3"}
    for name in record["shapes"]:
        found = Landmarks.read(out / "landmarks" / f"{name}.mrk.json", small.shapes / f"{name}.ply")
        mesh = read_mesh(small.shapes / f"{name}.ply")
        near = nearest_on_surface(mesh, found.positions).interpolated(mesh.vertices)
        np.testing.assert_allclose(found.positions, near, atol=1e-6)
    lines = lines_of(out / "landmarks" / "landmarks_errors.csv")
    assert [line["landmark"] for line in lines] == [*NAMES] * 4
    assert all(bool(line["expected_error"]) == (line["specimen"] != "s0") for line in lines)
    assert main([*argv, str(template)]) == 0
    assert "wrote the landmarks of 4 shapes" in capsys.readouterr().out
    fewer = Collection.create(
        out, [small.shapes / f"s{i}.ply" for i in range(3)], template="s0", config=small.config
    )
    assert fewer.units == {}
    finished_names(fewer)
    assert not (out / "landmarks" / "s3.mrk.json").exists()
    assert (out / "landmarks" / "s2.mrk.json").exists()


@pytest.mark.long
def test_shapes_in_other_spaces_get_landmarks_in_their_own_and_tables_in_one(small, tmp_path, capsys):
    """One shape is in RAS, the others in LPS by their files: half a turn apart, as 3D Slicer writes either."""
    folder, turn = tmp_path / "shapes", np.array([-1.0, -1.0, 1.0])
    folder.mkdir()
    for name, axes in (("s0", "RAS"), ("s1", "LPS"), ("s2", "LPS")):
        asset = read_asset(small.shapes / f"{name}.ply")
        asset = asset.moved(asset.mesh.vertices * (1 if axes == "RAS" else turn))
        write_asset(folder / f"{name}.ply", replace(asset, frame=Frame(words=(f"SPACE={axes}",))))
    collection = Collection.create(tmp_path / "star", folder, template="s0", config=small.config)
    run(collection)
    finished_names(collection)
    own = read_mesh(folder / "s0.ply").vertices[ROWS[:3]]
    write_landmarks(tmp_path / "s0.mrk.json", Landmarks(own * turn, NAMES[:3], axes="LPS"))
    words = ["collect", "landmarks", *(str(tmp_path / name) for name in ("star", "s0.mrk.json", "out"))]
    assert main(words) == 0
    assert "brought into RAS in the tables, from the space of their files: s1, s2" in capsys.readouterr().out
    table = {row["specimen"]: row for row in lines_of(tmp_path / "out" / "landmarks.csv")}
    for name, axes in (("s0", "RAS"), ("s1", "LPS"), ("s2", "LPS")):
        path, mesh = tmp_path / "out" / f"{name}.mrk.json", read_mesh(folder / f"{name}.ply")
        assert json.loads(path.read_text())["markups"][0]["coordinateSystem"] == axes
        found = Landmarks.read(path, folder / f"{name}.ply")
        if name != "s0":
            there = collection.maps("s0", name).forward
            np.testing.assert_allclose(found.positions, there.pull_back(mesh.vertices)[ROWS[:3]], atol=1e-6)
        in_table = [float(table[name][f"nose_{axis}"]) for axis in "XYZ"]
        np.testing.assert_allclose(in_table, found["nose"] * (1 if axes == "RAS" else turn))
        assert read_asset(tmp_path / "star" / "corresponded" / f"{name}.ply").frame.axes == axes
    pytest.importorskip("nibabel")
    assert main(["collect", "export", str(tmp_path / "star"), str(tmp_path / "all"), "--format", "pial"]) == 0
    lost = "the frame of the coordinates (SPACE=LPS; positions are turned to RAS)"
    assert f"not in 2 of the meshes: {lost}" in " ".join(capsys.readouterr().out.split())


def test_what_is_wrong_with_landmarks_is_told_before_anything_is_matched(small, marks, tmp_path, capsys):
    argv = ["collect", str(small.shapes), "-o", str(tmp_path / "out"), "--landmarks"]
    nameless = (marks / "s2.mrk.json").rename(tmp_path / "atlas.mrk.json")
    assert main([*argv, str(nameless)]) == 1
    assert "it is not known of which shape" in capsys.readouterr().err
    write_landmarks(marks / "s0.mrk.json", Landmarks([[99.0, 0, 0]], ["nose"]))
    assert main([*argv, str(marks)]) == 1
    assert "away from all" in capsys.readouterr().err
    assert not (tmp_path / "out" / "maps").exists()


@pytest.mark.long
def test_patches_and_points_spread_over_the_first_template_slide_on_all_shapes(
    finished, small, marks, tmp_path, capsys
):
    patches, out = tmp_path / "patches", tmp_path / "out"
    patches.mkdir()
    meshes = {f"s{i}": read_mesh(small.shapes / f"s{i}.ply") for i in range(4)}
    for name in ("s0", "s2"):
        write_landmarks(patches / f"{name}.csv", Landmarks(meshes[name].vertices[210:230]))
    argv = ["collect", "landmarks", str(finished), str(marks), str(out), "--patches", str(patches)]
    argv += ["--surface-points", "60", "--slide"]
    assert main([*argv, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [row["specimen"] for row in record["slid"]] == [*meshes]
    assert all(row["energy_after"] < row["energy_before"] for row in record["slid"])
    assert (record["not_slid"], record["left_out"]) == ([], [])
    for name, mesh in meshes.items():
        found = Landmarks.read(out / f"{name}.mrk.json", mesh)
        near = nearest_on_surface(mesh, found.positions).interpolated(mesh.vertices)
        np.testing.assert_allclose(found.positions, near, atol=1e-6)
        assert set(found.names) == {*NAMES, *(f"surface-{i + 1}" for i in range(80))}
        if name in ("s0", "s2"):
            np.testing.assert_allclose(found["nose"], mesh.vertices[ROWS[0]], atol=1e-6)
            assert np.linalg.norm(found["surface-1"] - mesh.vertices[210]) > 1e-6
    slides = [int(row["slide"]) for row in lines_of(out / "landmarks_surfaces.csv")]
    assert slides == [*range(7, 87)]  # after the curve
    assert (out / "landmarks.csv").read_text().split(",")[19] == "surface-1_X"
    assert len((out / "landmarks_slid.csv").read_text().splitlines()) == 5
    (patches / "s2.csv").unlink()
    assert main([*argv, "--force"]) == 1
    assert "give those of all shapes that have landmarks" in capsys.readouterr().err


@pytest.mark.long
def test_a_shape_that_fails_is_named_and_the_others_go_on(small, marks, tmp_path, capsys, caplog):
    folder = tmp_path / "shapes"
    shutil.copytree(small.shapes, folder)
    collection = Collection.create(tmp_path / "star", folder, template="s0", config=small.config)
    run(collection)
    (folder / "s1.ply").write_text("no surface")
    argv = ["collect", "landmarks", str(tmp_path / "star"), str(marks / "s0.mrk.json"), str(tmp_path / "out")]
    assert main([*argv, "--surface-points", "40", "--slide"]) == 0
    told = capsys.readouterr()
    assert "failed, or no map that is sure leads to: s1" in told.out
    assert "slid by" in told.out
    assert "s1 is left out: " in caplog.text
    assert (tmp_path / "out" / "s3.mrk.json").exists()
    assert not (tmp_path / "out" / "s1.mrk.json").exists()
