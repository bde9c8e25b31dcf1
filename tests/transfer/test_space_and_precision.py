"""Commands between files in other spaces, and far from the origin: ``transfer``, ``repair``, ``match --as-mesh``."""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from corresponded import wrapped_as
from isomatch import Asset, Landmarks, read_asset, read_landmarks, read_mesh, write_asset, write_landmarks
from isomatch.cli import main
from isomatch.cli.outputs import say_wrapped, write_wrapped
from isomatch.io import Attribute, Frame
from later import some_later
from shapes import icosphere

TURN = np.array([-1.0, -1.0, 1.0])
SPHERE = icosphere(2)
BODY = SPHERE.moved(SPHERE.vertices * [3, 2, 1] + 0.4 * np.maximum(SPHERE.vertices, 0) ** 2)
TIPS = BODY.vertices[[*BODY.vertices.argmax(axis=0), BODY.vertices[:, 1].argmin()]]  # right, front, top, back
NAMES = ("right", "front", "top", "back")


def written(path, axes, offset=(0, 0, 0), words=()):
    """Write the body, which is modelled in RAS, in a space that the file says, or in RAS if it says none."""
    turn = TURN if axes == "LPS" else 1
    frame = Frame(words=((f"SPACE={axes}",) if axes else ()) + tuple(words))
    write_asset(path, replace(Asset.of_mesh(BODY).moved(BODY.vertices * turn + offset), frame=frame))
    return path


def identity(folder):
    (folder / "map.txt").write_text("\n".join(map(str, range(BODY.n_vertices))))
    return folder / "map.txt"


WAYS = [*product(("a.mrk.json", "a.fcsv"), ("RAS", "LPS"), ("source", "target"))]
SUFFIXES = [(".ply", ".obj"), (".vtk", ".ply"), (".vtp", ".off")]


@pytest.mark.parametrize(
    ("way", "suffixes"),
    some_later(product(WAYS, SUFFIXES), lambda case: case[1] == SUFFIXES[0] or case[0] == WAYS[-1]),
)
def test_landmarks_go_from_one_space_to_the_other(tmp_path, way, suffixes):
    """Each is where it was on the body, in the coordinates of the surface that receives, whose space the file says."""
    marks, of_marks, to = way
    source, target = (
        written(tmp_path / f"s{suffixes[0]}", "RAS"),
        written(tmp_path / f"t{suffixes[1]}", "LPS"),
    )
    turn = TURN if of_marks == "LPS" else 1
    write_landmarks(tmp_path / marks, Landmarks(TIPS * turn, NAMES, axes=of_marks))
    out = tmp_path / "out.mrk.json"
    words = ["transfer", identity(tmp_path), source, target, "--landmarks", tmp_path / marks, "-o", out]
    assert main([*map(str, words), "--to", to]) == 0
    (markup,) = json.loads(out.read_text())["markups"]
    axes = "LPS" if to == "target" else "RAS"
    assert markup["coordinateSystem"] == axes
    found = np.array([point["position"] for point in markup["controlPoints"]])
    assert [point["label"] for point in markup["controlPoints"]] == [*NAMES]
    np.testing.assert_allclose(found, TIPS * (TURN if axes == "LPS" else 1), atol=1e-6)


def test_a_receiver_that_says_no_space_is_said_to_be_in_that_of_the_giver(tmp_path, capsys):
    source, target = written(tmp_path / "s.ply", "RAS"), written(tmp_path / "t.ply", None)
    write_landmarks(tmp_path / "a.fcsv", Landmarks(TIPS, NAMES, axes="RAS"))
    words = ["transfer", identity(tmp_path), source, target, "--landmarks", tmp_path / "a.fcsv", "-o"]
    assert main([*map(str, words), str(tmp_path / "out.fcsv")]) == 0
    assert "is said to be in RAS like the other surface" in capsys.readouterr().out
    assert "CoordinateSystem = RAS" in (tmp_path / "out.fcsv").read_text()
    assert main([*map(str, words), str(tmp_path / "out.csv")]) == 0
    assert f"not in {tmp_path / 'out.csv'}: the space (RAS)" in capsys.readouterr().out


@pytest.mark.long
def test_landmarks_of_a_match_are_brought_into_the_space_of_each_shape(tmp_path):
    source, target = written(tmp_path / "s.stl", "RAS"), written(tmp_path / "t.vtp", "LPS")
    for name, axes in (("a", "LPS"), ("b", "RAS")):
        turn = TURN if axes == "LPS" else 1
        write_landmarks(tmp_path / f"{name}.fcsv", Landmarks(TIPS * turn, NAMES, axes=axes))
    pairs = read_landmarks(tmp_path / "a.fcsv", source, target, tmp_path / "b.fcsv")
    np.testing.assert_allclose(read_mesh(source).vertices[pairs[:, 0]], TIPS, atol=1e-6)
    np.testing.assert_allclose(read_mesh(target).vertices[pairs[:, 1]], TIPS * TURN, atol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", ["a.vtk", "a.vtp", "a.stl", "a.obj", "a.ply", "a.off", "a.glb"])
def test_repair_and_as_mesh_say_the_space(tmp_path, name, capsys):
    given = written(tmp_path / name, "RAS", words=["unit: mm"])
    out = tmp_path / f"out_{name}"
    assert main(["repair", str(given), "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "not in" not in said
    assert "wrote an unchanged copy" in said
    assert read_asset(out).frame.axes == "RAS"
    assert "unit: mm" in "; ".join(read_asset(out).frame.words)
    other = read_asset(written(tmp_path / "t.ply", "LPS"))
    wrapped = wrapped_as(other.mesh) if name != "a.stl" else wrapped_as(read_asset(given).mesh)
    write_wrapped(out, read_asset(given), other.frame, wrapped, np.zeros(BODY.n_vertices))
    assert read_asset(out).frame.words == ("SPACE=LPS",)


def test_what_as_mesh_leaves_out_is_said(tmp_path, capsys):
    normals = Attribute("normal", "point", "normal", SPHERE.vertices)
    asset = Asset.of_mesh(
        BODY, [normals, Attribute("color", "face", "colour", np.zeros((BODY.n_faces, 3), np.uint8))]
    )
    record = write_wrapped(tmp_path / "a.glb", asset, None, wrapped_as(BODY), np.zeros(BODY.n_vertices))
    say_wrapped({**record, "files_beside": [], "notes": []})
    said = " ".join(capsys.readouterr().out.split())
    assert "a.glb: normal; they belong to the former shape" in said
    assert "a.glb: color, which a .glb file cannot store" in said


UTM = (512345.6, 5412345.7, 321.5)


@pytest.mark.parametrize("command", ["repair", "transfer"])
def test_a_file_that_moves_vertices_is_written_only_if_that_is_allowed(tmp_path, command, capsys):
    pytest.importorskip("nibabel")
    given, out = written(tmp_path / "a.ply", None, UTM), tmp_path / "out.surf.gii"
    near = written(tmp_path / "b.obj", None)
    words = ["repair", given] if command == "repair" else ["transfer", identity(tmp_path), given, near]
    words = [*map(str, words), "-o", str(out)]
    assert main(words) == 1
    assert "positions would move by up to 0.25" in capsys.readouterr().err
    assert not out.exists()
    assert main([*words, "--rounded"]) == 0
    said = capsys.readouterr().out
    assert f"not in {out}: the last digits of the positions (moved by up to 0.25)" in said
    assert "unchanged" not in said
    exact = [*words[:-1], str(tmp_path / "out.glb")]
    assert main(exact) == 0
    assert "not in" not in capsys.readouterr().out
    placed = read_asset(tmp_path / "out.glb").placed_points
    np.testing.assert_allclose(placed, BODY.vertices + UTM, rtol=0, atol=1e-6)


def test_a_posed_body_far_away_is_where_it_was(tmp_path):
    """A mesh with joints is put by these, a mesh below a turned node by all nodes above it."""
    weights = Attribute("weights", "point", "weights", np.ones((BODY.n_vertices, 1)), names={0: "root"})
    far = Asset.of_mesh(BODY.moved(BODY.vertices + UTM), [weights])
    assert write_asset(tmp_path / "a.glb", far) == ()
    found = read_asset(tmp_path / "a.glb")
    np.testing.assert_allclose(found.placed_points, BODY.vertices + UTM, rtol=0, atol=1e-6)
    assert write_asset(tmp_path / "b.glb", found.moved(np.add(found.mesh.vertices, [0, 0, 7.0]))) == ()
    again = read_asset(tmp_path / "b.glb")
    np.testing.assert_allclose(again.placed_points, BODY.vertices + UTM + [0, 0, 7.0], rtol=0, atol=1e-6)
