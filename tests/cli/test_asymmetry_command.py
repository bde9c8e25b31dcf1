"""``isomatch asymmetry``: exit codes, output and files."""

import json
import re

import numpy as np
import pytest

import isomatch
from corresponded import moved
from data import real_file
from isomatch.cli import main
from isomatch.cohort.asymmetry import _below_error, _sentences, _sides
from isomatch.cohort.shape_statistics import CorrespondedShapes
from isomatch_lab.procedural import creature
from shapes import icosphere

pytestmark = pytest.mark.usefixtures("coarse_pictures")
SPHERE = icosphere(2)
X, Y, Z = SPHERE.vertices.T
OTHER = np.abs(SPHERE.vertices[:, None] * [-1, 1, 1] - SPHERE.vertices).sum(axis=2).argmin(axis=1)
LUMP = 0.3 * np.exp(-((SPHERE.vertices - [0.6, 0.64, 0.48]) ** 2).sum(axis=1) / 0.3)


def write(folder, radius, names=None):
    """Write spheres of other radii (m, n), each turned and shifted."""
    folder.mkdir()
    names = names or [f"h{i}" for i in range(len(radius))]
    shapes = moved(CorrespondedShapes(names, radius[:, :, None] * SPHERE.vertices, SPHERE.faces))
    for i, name in enumerate(names):
        isomatch.write_mesh(folder / f"{name}.ply", shapes.mesh(i))
    return folder


@pytest.fixture
def sides(tmp_path):
    (tmp_path / "sides.txt").write_text("".join(f"{i}\n" for i in OTHER))
    return ["--left-right", str(tmp_path / "sides.txt")]


def shape(name, asymmetry, **error):
    return {"name": name, "asymmetry": asymmetry, **error}


def test_what_is_below_the_error_of_the_maps_is_not_shown():
    a, b, c = shape("a", 0.1, map_error=0.2), shape("b", 0.13, map_error=0.18), shape("c", 0.4, map_error=0.2)
    told, shown = _below_error([a, b])
    assert told.startswith("no asymmetry is shown: it is below the error of the maps")
    assert (told[-42:], shown) == ("(asymmetry 0.1 to 0.13, error 0.18 to 0.2)", [])
    told, shown = _below_error([a, c])
    assert told.startswith("no asymmetry is shown in a: ")
    assert shown == [c]
    assert _below_error([shape("a", 0.1), c]) == (
        "",
        [shape("a", 0.1), c],
    )  # sides that were given have no error
    record = {"anova": [], "n_individuals": 1, "shapes": [a], "size_anova": [], "notes": ["n"]}
    assert _sentences(record) == [_below_error([a])[0], "note: n"]


def test_sides_are_left_and_right_where_all_pairs_of_landmarks_agree():
    vertices = np.array([[-1.0, 0, 0], [1, 0, 0], [-2, 1, 0], [2, 1, 0], [0, 3, 0]])
    x, left_first = np.array([1.0, 0, 0]), np.array([[0, 1], [2, 3], [4, 4]])
    assert _sides(x, vertices, left_first) == ("the right side", "the left side")
    assert _sides(-x, vertices, left_first) == ("the left side", "the right side")
    for pairs in (None, np.array([[0, 1], [3, 2]]), np.array([[4, 4]])):
        assert _sides(x, vertices, pairs) == ("the +x side", "the −x side")


@pytest.mark.long
def test_one_shape(tmp_path, sides, capsys):
    """A bump of height 0.1 at one side is 0.05 there, and −0.05 opposite, in the file's own coordinates."""
    bump = 0.1 * np.exp(-((SPHERE.vertices - [0.8, 0.6, 0]) ** 2).sum(axis=1) / 0.05)
    mesh = isomatch.Mesh((2 + bump)[:, None] * SPHERE.vertices + [7, 0, 0], SPHERE.faces)
    isomatch.write_mesh(tmp_path / "a.ply", mesh)
    out, tip = tmp_path / "out", int(bump.argmax())
    argv = ["asymmetry", str(tmp_path / "a.ply"), "-o", str(out)]
    assert main([*argv, *sides]) == 0
    assert "most at vertex" in " ".join(capsys.readouterr().out.split())
    record = json.loads((out / "asymmetry.json").read_text())
    (line,) = record["shapes"]
    assert (line["most_vertex"], line["most_side"]) in ((tip, "the +x side"), (OTHER[tip], "the −x side"))
    assert [line["plane_x"], line["plane_y"], line["plane_offset"]] == pytest.approx([1, 0, 7], abs=0.01)
    asset = isomatch.read_asset(out / "shapes" / "a.ply")
    np.testing.assert_allclose(asset.points, mesh.vertices, atol=1e-5)
    signed = asset.attribute("along_normal").values
    assert [signed[tip], signed[OTHER[tip]]] == pytest.approx([bump[tip] / 2, -bump[tip] / 2], rel=0.1)
    expected = np.sqrt(((bump - bump[OTHER]) ** 2 / 4) @ mesh.vertex_areas / mesh.area)
    assert line["asymmetry"] == pytest.approx(expected, rel=0.1)
    assert line["over_size"] == pytest.approx(line["asymmetry"] / 2, rel=0.05)
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "<h1>Asymmetry of a</h1>" in page
    assert "To look at first" not in page
    here = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {*record["files"], "asymmetry.json"} == here
    assert set(re.findall(r'<img src="([^"]*)"', page)) == {"shapes/a.png"}
    assert main([*argv, *sides]) == 1
    assert "already exists" in capsys.readouterr().err
    assert (
        main([*argv[:2], "-o", str(tmp_path / "b"), "--left-right", str(out / "left_right"), "--json"]) == 0
    )
    assert json.loads(capsys.readouterr().out)["shapes"] == record["shapes"]


@pytest.mark.long
def test_several_shapes_and_repeats(tmp_path, sides, capsys):
    rng = np.random.default_rng(0)
    folder = write(
        tmp_path / "shapes", 2 + 0.05 * X * Y + 0.02 * rng.normal(size=(12, 2)) @ [X * Z, X * Y * Z]
    )
    argv = ["asymmetry", str(folder), "-o", str(tmp_path / "out"), *sides]
    assert main(argv) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "12 individuals: " in said
    assert "nothing was measured twice" in said
    record, out = json.loads((tmp_path / "out" / "asymmetry.json").read_text()), tmp_path / "out"
    assert (record["p_value"], record["n_permutations"]) == (2 / 4096, 4096)
    assert record["share"] > 0.5
    assert (out / "anova.csv").read_text(encoding="utf-8").count("\n") == 4
    page = (out / "index.html").read_text(encoding="utf-8")
    assert {"directional.png", "fluctuating.png"} < set(re.findall(r'<img src="([^"]*)"', page))
    table = tmp_path / "individuals.csv"
    table.write_text("name,group\n" + "".join(f"h{i},{i // 2}\n" for i in range(10)))  # two are by themselves
    assert main([*argv, "--force", "--individuals", str(table), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["n_individuals"] == 7
    assert [row["degrees"] for row in record["anova"]] == [6, 1, 6, 10]


@pytest.mark.long
@pytest.mark.usefixtures("in_threads")
def test_the_errors_of_maps_of_scans_are_not_directional(tmp_path, capsys):
    """Symmetric animals, each in triangles of its own; in one topology their asymmetry, all of it error, looks alike."""
    (tmp_path / "in").mkdir()
    for i in range(6):
        animal = creature(2000, style=i, symmetric=True, triangulation=i).rest_mesh
        isomatch.write_mesh(tmp_path / "in" / f"c{i}.ply", animal)
    assert (
        main(["collect", str(tmp_path / "in"), "-o", str(tmp_path / "all"), "--reports", "none", "--quiet"])
        == 0
    )
    found = []
    for folder in (tmp_path / "all", tmp_path / "all" / "corresponded"):
        assert main(["asymmetry", str(folder), "-o", str(tmp_path / "out"), "--force", "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    scanned, alike = found
    assert [each["in_one_topology"] for each in found] == [False, True]
    assert scanned["p_value"] > 0.05
    assert scanned["share"] < 0.33 < alike["share"]
    assert max(line["over_size"] for line in scanned["shapes"]) < 0.005


@pytest.mark.long
def test_left_and_right_organs(tmp_path, capsys):
    rng, names = np.random.default_rng(1), [f"{side}_{i}" for i in range(5) for side in ("left", "right")]
    radius = 2 + LUMP + 0.01 * rng.normal(size=(10, 2)) @ [X * Z, Y * Z]
    radius[1::2] += 0.1 * X * Y
    folder = write(tmp_path / "shapes", radius, names)
    for path in folder.glob("left*"):  # as they are in a body
        mesh = isomatch.read_mesh(path)
        isomatch.write_mesh(path, mesh.moved(mesh.vertices * [-1, 1, 1]))
    table = tmp_path / "pairs.csv"
    table.write_text("left,right\n" + "".join(f"left_{i},right_{i}\n" for i in range(4)))
    argv = ["asymmetry", str(folder), "-o", str(tmp_path / "out"), "--pairs", str(table), "--json"]
    assert main(argv) == 0
    said = capsys.readouterr()
    record = json.loads(said.out)
    assert "mirror image" not in said.err
    assert record["symmetry"] == "matching"
    ends = [(f"right_{i}", f"left_{i}_mirrored") for i in range(4)]
    assert [(line["name"], line["left"]) for line in record["shapes"]] == ends
    assert record["share"] > 0.7
    assert record["notes"] == ["left_4 has no partner", "right_4 has no partner"]


@pytest.mark.long
def test_a_map_that_is_not_sure_is_told_and_fails(tmp_path, capsys):
    isomatch.write_mesh(tmp_path / "ball.ply", SPHERE)
    out = tmp_path / "out"
    assert main(["asymmetry", str(tmp_path / "ball.ply"), "-o", str(out)]) == 4
    said = capsys.readouterr().err
    assert "The maps from left to right are doubtful in ball (symmetry ambiguous)" in said
    assert "--landmarks" in said
    page = (out / "index.html").read_text(encoding="utf-8")
    assert page.index("To look at first") < page.index("What was measured")


@pytest.mark.long
def test_a_real_skull_is_nearly_symmetric(tmp_path, capsys):
    with np.load(real_file("real/mouse20k_A_J.npz"), allow_pickle=False) as skull:
        isomatch.write_mesh(tmp_path / "skull.ply", isomatch.Mesh(skull["vertices"], skull["faces"]))
    assert main(["asymmetry", str(tmp_path / "skull.ply"), "-o", str(tmp_path / "out"), "--json"]) == 0
    (line,) = json.loads(capsys.readouterr().out)["shapes"]
    assert 0.001 < line["along_normal"] / line["asymmetry"] * line["over_size"] < 0.015
    assert line["plane_x"] > 0.99


def test_bad_input(tmp_path, sides, capsys):
    folder = write(tmp_path / "shapes", 2 + np.array([0.1 * X * Y, 0.2 * Z * Y]))
    out = ["-o", str(tmp_path / "out")]
    (tmp_path / "pairs.csv").write_text("left,right\nh0,x\n")
    (tmp_path / "short.txt").write_text("0\n1\n")
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    isomatch.write_mesh(mixed / "a.ply", SPHERE)
    isomatch.write_mesh(mixed / "b.ply", icosphere(1))
    for argv, words in (
        ([str(tmp_path / "nothing"), *out], "nothing"),
        ([str(folder), *out, *sides, "--landmarks", "x.txt"], "give one of them"),
        ([str(folder), *out, "--left-right", str(tmp_path / "short.txt")], "short.txt"),
        ([str(folder), *out, "--pairs", str(tmp_path / "pairs.csv")], "none named x"),
        ([str(mixed), *out, *sides], "isomatch collect"),
    ):
        assert main(["asymmetry", *argv]) == 1, argv
        said = capsys.readouterr().err
        assert words in said
        assert said.count("isomatch: ") == 1
    assert not (tmp_path / "out").exists()
    assert main(["asymmetry", str(folder), *out, "--scale", "double"]) == 2
