"""Landmarks of some shapes of a collection, carried to the others, in Python and by ``isomatch collect landmarks``."""

import csv
import json

import numpy as np
import pytest

from isomatch import InputError, Landmarks, read_mesh, write_landmarks
from isomatch.cli import main
from isomatch.collections import Collection, collected_landmarks, export
from isomatch.collections.ledger import writing_ledger
from isomatch.landmarks import Curve
from small_collections import run

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


def test_over_the_template_of_a_star(small, marks, tmp_path):
    """Two shapes that are not matched with each other: the maps over the template are joined."""
    collection = Collection.create(tmp_path / "star", small.shapes, template="s1", config=small.config)
    run(collection)
    found = dict(collected_landmarks(collection, {"s0": marks / "s0.mrk.json"}, curve_points=4))
    assert list(found) == ["s0", "s1", "s2", "s3"]
    there = collection.maps("s0", "s1").there
    onward = collection.maps("s1", "s3").there
    mesh = read_mesh(small.shapes / "s3.ply")
    joined = there.then(onward, read_mesh(small.shapes / "s1.ply"), mesh)
    np.testing.assert_allclose(
        found["s3"].positions[:3], joined.pull_back(mesh.vertices)[ROWS[:3]], atol=1e-6 * np.sqrt(mesh.area)
    )
    assert found["s3"].names[3:] == ("rim-1", "rim-2", "rim-3", "rim-4")


def changed(collection, name, **values):
    """Write other values into the rows of all pairs of a shape."""
    with writing_ledger(collection.layout.ledger()) as ledger:
        for pair, row in list(ledger.rows.pairs.items()):
            if name in pair:
                ledger.put_pair(pair, {**row, **values})


def test_doubtful_maps_and_those_of_earlier_files_are_not_used(copied, marks, tmp_path, capsys):
    row = copied.rows().pairs["s0", "s1"]
    changed(copied, "s1", back={**row["back"], "outcome": "MIRROR_IMAGE"})
    changed(copied, "s3", source_hash="of an earlier file")
    argv = ["collect", "landmarks", str(copied.folder), str(marks), str(tmp_path / "out")]
    assert main([*argv, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["shapes"], record["left_out"]) == (["s0", "s2"], ["s1", "s3"])
    assert record["doubtful"] == [["s0", "s1"], ["s1", "s2"]]
    assert main([*argv, "--force"]) == 0
    assert "doubtful: the maps of s0 and s1, s1 and s2" in capsys.readouterr().out
    maps = [path.name for path in export(copied, tmp_path / "maps", meshes=None)]
    assert len(maps) == 6 + 1
    assert not any("s3" in name for name in maps)


def test_reflected_shapes_are_reflected_in_the_tables(copied, marks, tmp_path, capsys):
    with writing_ledger(copied.layout.ledger()) as ledger:
        ledger.put_shape("s0", {**ledger.rows.shapes["s0"], "reflected": True})
    changed(copied, "s0", reflected=["s0"])
    out = tmp_path / "out"
    argv = ["collect", "landmarks", str(copied.folder), str(marks), str(out), "--format", "csv"]
    assert main([*argv, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["reflected"] == ["s0"]
    with (out / "landmarks.csv").open() as file:
        table = {row["specimen"]: row for row in csv.DictReader(file)}
    for name, sign in (("s0", -1), ("s1", 1)):
        own = Landmarks.read(out / f"{name}.csv", copied.paths[name])["nose"]
        assert [float(table[name][f"nose_{axis}"]) for axis in "XYZ"] == (own * [sign, 1, 1]).tolist()
    assert main([*argv, "--force"]) == 0
    assert "reflected in the tables, as they were matched: s0" in capsys.readouterr().out


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


def test_the_command_writes_files_and_tables(finished, marks, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["collect", "landmarks", str(finished), str(marks), str(out)]
    assert main([*argv, "--format", "csv", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["templates"], record["left_out"]) == (["s0", "s2"], [])
    assert set(record["mean_spread"]) == {"s1", "s3"}
    assert {path.name for path in out.iterdir()} == {
        *(f"s{i}.csv" for i in range(4)),
        "landmarks.csv",
        "landmarks.tps",
        "landmarks_sliders.csv",
    }
    with (out / "landmarks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["specimen"] for row in rows] == ["s0", "s1", "s2", "s3"]
    assert rows[0]["nose_X"] == repr(float(rows[0]["nose_X"]))
    assert (out / "landmarks.tps").read_text().count("CURVES=1") == 4
    assert main(argv) == 1
    assert "already exists" in capsys.readouterr().err
    assert main([*argv, "--force"]) == 0
    assert "s1: mean spread" in capsys.readouterr().out
    assert main(["collect", "landmarks", str(finished), str(tmp_path), str(out), "--force"]) == 1
    assert (
        "no landmarks of a shape of the collection; give a folder of files such as s0.mrk.json"
        in capsys.readouterr().err
    )
