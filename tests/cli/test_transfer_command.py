"""``isomatch transfer`` and ``match --as-mesh``, by exit code and artefact."""

import json
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from command_line import QUICK
from corresponded import wrapped_as
from isomatch import Asset, Correspondence, FormatError, Mesh, match, read_asset, read_mesh, write_asset
from isomatch.cli import main
from isomatch.cli.outputs import write_wrapped
from isomatch.cohort import PairMaps
from isomatch.cohort.ledger import MapRecord
from isomatch.datasets import example_pair
from isomatch.io import Attribute, Frame, Polygons

pytestmark = pytest.mark.usefixtures("prepared_once", "small_pictures")

_STREAM = BytesIO()
Image.new("RGB", (2, 2), "red").save(_STREAM, "PNG")
PICTURE = _STREAM.getvalue()


@pytest.fixture
def folder(tmp_path):
    """A file of quads, the same with data, and the map between them."""
    points = [[x, y, 0.1 * x * y] for y in range(3) for x in range(3)]
    corners = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7]
    plain = Asset(points, Polygons(corners, [4, 4, 4, 4]))
    write_asset(tmp_path / "source.ply", plain)
    data = (
        Attribute("part", "point", "label", np.arange(9) // 3),
        Attribute("height", "point", "scalar", plain.points[:, 2]),
    )
    turned = np.array(points) @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    write_asset(tmp_path / "target.ply", Asset(turned, plain.polygons, data))
    meshes = [read_mesh(tmp_path / f"{name}.ply") for name in ("source", "target")]
    hashes = [mesh.content_hash for mesh in meshes]
    Correspondence(np.arange(9), 9, source_hash=hashes[0], target_hash=hashes[1]).save(tmp_path / "map.npz")
    return tmp_path


def transfer(folder, *more, names=("map.npz", "source.ply", "target.ply")):
    return main(["transfer", *(str(folder / name) for name in names), "-o", str(folder / "out.ply"), *more])


def test_data_is_carried_and_quads_stay(folder, capsys):
    assert transfer(folder) == 0
    assert capsys.readouterr().out.splitlines()[0] == "carried to the source: part, height"
    found, source = read_asset(folder / "out.ply"), read_asset(folder / "source.ply")
    np.testing.assert_array_equal(found.polygons.sizes, [4, 4, 4, 4])
    np.testing.assert_array_equal(found.points, source.points)
    np.testing.assert_array_equal(found.attribute("part").values, np.arange(9) // 3)


def test_json_and_force(folder, capsys):
    assert transfer(folder) == 0
    capsys.readouterr()
    assert transfer(folder, "--data", "labels") == 1
    assert "already exists" in capsys.readouterr().err
    assert transfer(folder, "--data", "labels", "--json", "--force") == 0
    assert json.loads(capsys.readouterr().out) == {
        "files": [str(folder / "out.ply")],
        "to": "source",
        "carried": ["part"],
        "left_out": [],
        "taken_as_labels": ["part"],
        "n_unmatched": 0,
        "n_across_seams": 0,
    }


def test_the_maps_of_a_pair_of_a_collection_are_read_in_either_direction(folder, tmp_path):
    meshes = [read_mesh(folder / f"{name}.ply") for name in ("source", "target")]
    hashes = [mesh.content_hash for mesh in meshes]
    there, back = Correspondence(range(9), 10, None, None, *hashes), Correspondence([*range(9), 8], 9)
    PairMaps(there, back, MapRecord(source_hash=hashes[0], target_hash=hashes[1])).save(tmp_path / "a__b.npz")
    for n_target, n_source, expected in ((10, 9, there), (9, 10, back), (None, None, there)):
        found = Correspondence.load(tmp_path / "a__b.npz", n_target, n_source)
        np.testing.assert_array_equal(found.vertices, expected.vertices)
        assert found.shape == expected.shape
    with pytest.raises(FormatError, match="onto a target of 10 vertices, not 7"):
        Correspondence.load(tmp_path / "a__b.npz", 7)
    both = Correspondence(range(9), 9, None, None, *hashes)
    PairMaps(both, both, MapRecord(source_hash=hashes[0], target_hash=hashes[1])).save(folder / "map.npz")
    assert transfer(folder) == 0


def test_a_map_of_other_files_is_refused(folder, capsys):
    assert transfer(folder, names=("map.npz", "target.ply", "source.ply")) == 1
    assert "source and target are exchanged" in capsys.readouterr().err
    assert not (folder / "out.ply").exists()


@pytest.mark.long
def test_the_match_writes_the_target_with_the_faces_of_the_source(tmp_path, monkeypatch, capsys):
    for name, creature in zip(("source.off", "target.ply"), example_pair()):
        frame = Frame(words=("unit: mm",)) if name == "target.ply" else None
        write_asset(tmp_path / name, replace(Asset.of_mesh(creature.mesh), frame=frame))
    source = tmp_path / "source.off"
    source.write_text(source.read_text().removeprefix("OFF"))
    (tmp_path / "quick.toml").write_text(QUICK)
    monkeypatch.chdir(tmp_path)
    options = "--config quick.toml --as-mesh shared.ply --no-report --json"
    assert main(f"match source.off target.ply -o out {options}".split()) == 0
    record = json.loads(capsys.readouterr().out)["as_mesh"]
    assert record["turned"] < 0.01
    assert 1.0 <= record["stretch"] < 3.0
    assert record["distance"] < 0.01
    assert record["notes"] == ["source.off: the word OFF is missing in the first line"]
    np.testing.assert_array_equal(read_mesh(tmp_path / "shared.ply").faces, read_mesh(source).faces)
    assert read_asset(tmp_path / "shared.ply").frame.words == ("unit: mm",)


@pytest.fixture
def scan(tmp_path, monkeypatch):
    """A square with its library and its picture, and a folder with another file of that name."""
    monkeypatch.chdir(tmp_path)
    text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nusemtl skin\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n"
    (tmp_path / "a.obj").write_text(text)
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd b_skin.png\n")
    (tmp_path / "b_skin.png").write_bytes(PICTURE)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "b_skin.png").write_bytes(b"another")
    return tmp_path


@pytest.mark.parametrize("words", ["repair a.obj -o", "match a.obj a.obj -o result --as-mesh"])
def test_files_beside_are_not_replaced_unless_forced(words, scan, capsys):
    before = sorted(path.name for path in (scan / "out").iterdir())
    assert main([*words.split(), str(Path("out/b.obj"))]) == 1
    assert "b_skin.png: already exists" in capsys.readouterr().err
    assert sorted(path.name for path in (scan / "out").iterdir()) == before
    assert (scan / "out" / "b_skin.png").read_bytes() == b"another"


def test_repair_names_the_files_beside(scan, capsys):
    assert main(["repair", "a.obj", "-o", str(Path("out/b.obj")), "--force"]) == 0
    names = ("b.obj", "b_skin.png", "a.mtl", "b.index.npz")
    written = ", ".join(str(Path("out") / name) for name in names)
    assert capsys.readouterr().out.splitlines() == [
        f"found nothing that repair mends; wrote an unchanged copy: {written}"
    ]
    assert (scan / "out" / "b_skin.png").read_bytes() == PICTURE


def test_repair_says_what_it_changed_and_wrote(scan, capsys):
    (scan / "a.off").write_text("OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n9 9 9\n3 0 1 2\n3 0 2 3\n")
    assert main(["repair", "a.off", "-o", "b.off"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "removed 1 vertex that no face used",
        "wrote b.off, b.index.npz",
    ]


@pytest.mark.long
def test_a_target_that_cannot_be_read_is_refused_before_the_match(scan, capsys):
    (scan / "bad.obj").write_text((scan / "a.obj").read_text().replace("3/1", "3/7"))
    assert main(["match", "a.obj", "bad.obj", "-o", "result", "--as-mesh", "c.obj"]) == 1
    assert "bad.obj:" in capsys.readouterr().err
    assert not (scan / "result").exists()


def test_notes_on_files_are_told(scan, capsys):
    (scan / "a.off").write_text("4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n")
    note = "note: a.off: the word OFF is missing in the first line"
    assert main(["repair", "a.off", "-o", "b.off"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        note,
        "found nothing that repair mends; wrote an unchanged copy: b.off, b.index.npz",
    ]
    (scan / "map.txt").write_text("0\n1\n2\n3\n")
    (scan / "marks.csv").write_text("name,x,y,z\nnose,0.5,0.25,0\n")
    assert main(["transfer", "map.txt", "a.off", "a.obj", "--landmarks", "marks.csv", "-o", "out.csv"]) == 0
    assert note in capsys.readouterr().out.splitlines()


def test_directions_of_the_former_shape_are_left_out(tmp_path):
    made = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    directions = (
        Attribute("normal", "point", "normal", np.tile([0.0, 0, 1], (3, 1))),
        Attribute("tangent", "point", "vector", np.tile([1.0, 0, 0, 1], (3, 1))),
        Attribute("flow", "point", "vector", np.eye(3)),
    )
    write_asset(tmp_path / "a.glb", Asset.of_mesh(made, directions))
    asset = read_asset(tmp_path / "a.glb")
    write_wrapped(tmp_path / "b.glb", asset, None, wrapped_as(made), np.zeros(3))
    assert [a.name for a in read_asset(tmp_path / "b.glb").attributes] == [
        "flow",
        "expected_error",
        "extended",
    ]


@pytest.mark.long
def test_landmarks_are_carried_there_and_back(folder, capsys):
    (folder / "marks.csv").write_text("name,x,y,z\nnose,0.5,0.25,0.02\ntail,2,2,0.4\n")
    names = [str(folder / name) for name in ("map.npz", "source.ply", "target.ply")]
    there, back = str(folder / "there.mrk.json"), str(folder / "back.fcsv")
    argv = ["transfer", *names, "--landmarks"]
    assert main([*argv, str(folder / "marks.csv"), "-o", there]) == 0
    said = capsys.readouterr().out
    assert "carried to the target: 2 landmarks, 0 curves" in said
    assert "expected error" not in said, "a map alone does not know them"
    points = json.loads((folder / "there.mrk.json").read_text())["markups"][0]["controlPoints"]
    assert [point["label"] for point in points] == ["nose", "tail"]
    np.testing.assert_allclose(points[1]["position"], [-2, 2, 0.4], atol=1e-12)
    assert main([*argv, there, "-o", back, "--to", "source", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in record["landmarks"]] == ["nose", "tail"]
    np.testing.assert_allclose(record["landmarks"][0]["position"][:2], [0.5, 0.25], atol=1e-3)
    assert main([*argv, there, "-o", str(folder / "wrong.csv")]) == 1
    assert "taken as landmarks of the source, see --to" in capsys.readouterr().err
    assert main([*argv, there, "-o", str(folder / "wrong.ply")]) == 1
    assert "'.ply' is not that of a landmark file" in capsys.readouterr().err
    assert main([*argv, there, "-o", back, "--force", "--bake", "64"]) == 1
    assert "--landmarks are carried alone" in capsys.readouterr().err
    assert main(["transfer", *names, "-o", back, "--curve-points", "9"]) == 1
    assert "--curve-points needs --landmarks" in capsys.readouterr().err
    assert main(["transfer", *names, "-o", str(folder / "none.ply"), "--data", " ,"]) == 1
    assert "--data ' ,' names nothing" in capsys.readouterr().err
    assert not (folder / "none.ply").exists()


@pytest.mark.long
def test_the_file_of_a_match_tells_expected_errors(tmp_path, capsys):
    shapes = [made.mesh for made in example_pair()]
    for name, mesh in zip("ab", shapes):
        write_asset(tmp_path / f"{name}.ply", Asset.of_mesh(mesh))
    result = match(*shapes)
    result.save(tmp_path / "map.npz")
    (tmp_path / "marks.txt").write_text("3\n500\n")
    names = [str(tmp_path / name) for name in ("map.npz", "a.ply", "b.ply", "out.csv")]
    argv = ["transfer", *names[:3], "--landmarks", str(tmp_path / "marks.txt"), "-o", names[3]]
    assert main(argv) == 0
    assert "expected error: median" in capsys.readouterr().out
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert lines[0] == "name,x,y,z,expected_error"
    expected = result.expected_error[[3, 500]] * np.sqrt(shapes[1].area)
    np.testing.assert_allclose([float(line.split(",")[4]) for line in lines[1:]], expected, rtol=1e-6)
