"""``isomatch distance``: exit codes, output and files."""

import json

import numpy as np
import pytest

import isomatch
from command_line import one_line
from isomatch.cli import main
from isomatch.geodesics import distance_engine, engine_names
from shapes import icosphere, two_spheres


@pytest.fixture
def sphere(tmp_path):
    mesh = icosphere(2)
    isomatch.write_mesh(tmp_path / "sphere.off", mesh)
    return tmp_path / "sphere.off", mesh


@pytest.fixture
def pairs(tmp_path):
    path = tmp_path / "pairs.txt"
    path.write_text("# source target\n0, 5\n3 7  # near\n0 100\n")
    return path, np.array([[0, 5], [3, 7], [0, 100]])


def test_one_distance_per_line(sphere, pairs, capsys):
    assert main(["distance", str(sphere[0]), "--pairs", str(pairs[0])]) == 0
    said = [float(line) for line in capsys.readouterr().out.splitlines()]
    i, j = pairs[1].T
    expected = isomatch.geodesic_distances(sphere[1], i)[np.arange(3), j]
    np.testing.assert_allclose(said, expected, rtol=1e-6)


def test_columns_as_a_table(sphere, capsys):
    assert main(["distance", str(sphere[0]), "--from", "4,0", "--engine", "dijkstra"]) == 0
    header, *rows = capsys.readouterr().out.splitlines()
    assert header == "vertex,from_4,from_0"
    values = np.array([row.split(",") for row in rows], dtype=float)
    assert np.array_equal(values[:, 0], np.arange(162))
    np.testing.assert_allclose(values[:, 1:].T, isomatch.geodesic_distances(sphere[1], [4, 0], "dijkstra"))


@pytest.mark.parametrize("which", ["pairs", "from"])
def test_files_hold_the_distances(which, sphere, pairs, tmp_path, capsys):
    asked = ["--pairs", str(pairs[0])] if which == "pairs" else ["--from", "4,0"]
    for suffix in (".csv", ".npz"):
        out = tmp_path / f"out{suffix}"
        assert main(["distance", str(sphere[0]), *asked, "-o", str(out)]) == 0
        assert f"wrote {out}" in capsys.readouterr().out
    table = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    with np.load(tmp_path / "out.npz") as held:
        distances, indices = held["distances"], held["pairs" if which == "pairs" else "sources"]
    if which == "pairs":
        assert np.array_equal(table[:, :2], indices)
        np.testing.assert_allclose(table[:, 2], distances)
    else:
        assert indices.tolist() == [4, 0]
        np.testing.assert_allclose(table[:, 1:].T, distances)


def test_an_existing_file_is_kept_unless_forced(sphere, tmp_path, capsys):
    out = tmp_path / "out.csv"
    out.write_text("precious")
    command = ["distance", str(sphere[0]), "--from", "4", "-o", str(out)]
    assert main(command) == 1
    assert "already exists" in one_line(capsys)
    assert out.read_text() == "precious"
    assert main([*command, "--force"]) == 0
    assert out.read_text().startswith("vertex,from_4\n")


def test_json_names_the_engine_and_has_no_infinity(tmp_path, capsys):
    isomatch.write_mesh(tmp_path / "two.off", two_spheres(0, 1.0))
    (tmp_path / "pairs.csv").write_text("0,1\n0,13\n")
    assert (
        main(["distance", str(tmp_path / "two.off"), "--pairs", str(tmp_path / "pairs.csv"), "--json"]) == 0
    )
    record = json.loads(capsys.readouterr().out)
    assert record["engine"] == "fast_marching"
    assert record["pairs"] == [[0, 1], [0, 13]]
    assert record["distances"][1] is None
    assert main(["distance", str(tmp_path / "two.off"), "--pairs", str(tmp_path / "pairs.csv")]) == 0
    assert capsys.readouterr().out.splitlines()[1] == "inf"


def test_points_without_faces_are_a_point_cloud(tmp_path, capsys):
    points = icosphere(2).vertices
    isomatch.write_mesh(tmp_path / "points.ply", isomatch.Mesh(points, []))
    assert main(["distance", str(tmp_path / "points.ply"), "--from", "0", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["engine"] == "dijkstra"
    assert np.array_equal(record["distances"], isomatch.geodesic_distances(isomatch.PointCloud(points), [0]))


def test_distances_from_a_basis(sphere, pairs, tmp_path, capsys):
    basis = isomatch.distance_basis(sphere[1], 20, 60)
    basis.save(tmp_path / "basis.npz")
    command = ["distance", str(sphere[0]), "--basis", str(tmp_path / "basis.npz")]
    assert main([*command, "--pairs", str(pairs[0])]) == 0
    printed = capsys.readouterr()
    assert "approximate: estimated relative error" in printed.err
    said = [float(line) for line in printed.out.splitlines()]
    np.testing.assert_allclose(said, basis.distance(*pairs[1].T), rtol=1e-9)
    assert main([*command, "--from", "3,1", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert "basis of rank" in record["engine"]
    wanted = np.maximum(basis.row([3, 1]), 0.0)
    wanted[[0, 1], [3, 1]] = 0.0
    np.testing.assert_allclose(record["distances"], wanted)
    assert record["approximate"]
    assert record["estimated_relative_error"] == pytest.approx(basis.error_estimate())
    isomatch.write_mesh(tmp_path / "other.off", icosphere(1))
    assert main(["distance", str(tmp_path / "other.off"), "--from", "0", *command[2:]]) == 1
    assert "a basis of 162 points, but the surface has 42 vertices" in one_line(capsys)


@pytest.mark.parametrize(
    ("more", "code", "words"),
    [
        ([], 2, ""),
        (["--from", "1", "--pairs", "pairs.txt"], 2, ""),
        (["--from", "1", "--engine", "exact", "--basis", "b.npz"], 2, ""),
        (
            ["--from", "1", "--engine", "telepathy"],
            2,
            "There is no engine 'telepathy'; known are fast_marching",
        ),
        (["--from", "1", "--basis", "nowhere.npz"], 1, "nowhere.npz: no such file; check the name"),
        (["--from", "1;2"], 1, "--from '1;2' is not a list of points"),
        (["--from", "162"], 1, "sources 162 are outside 0…161"),
        (["--from", "1", "-o", "out.xlsx"], 1, "suffix '.xlsx' cannot be written; use .csv or .npz"),
        (["--pairs", "nowhere.txt"], 1, "nowhere.txt: no such file"),
    ],
)
def test_bad_usage_is_reported_in_one_line(more, code, words, sphere, capsys):
    assert main(["distance", str(sphere[0]), *more]) == code
    assert words in one_line(capsys)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0 1\n2\n", "pairs.txt:2: '2' is not a pair; write two 0-based vertex indices"),
        ("0 -1\n", "vertices of pairs -1 are outside 0…161"),
    ],
)
def test_bad_pairs(text, words, sphere, tmp_path, capsys):
    (tmp_path / "pairs.txt").write_text(text)
    assert main(["distance", str(sphere[0]), "--pairs", str(tmp_path / "pairs.txt")]) == 1
    assert words in one_line(capsys)


def test_help_lists_the_engines(capsys):
    assert main(["distance", "--help"]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in engine_names())


def test_no_pairs_give_no_lines(sphere, tmp_path, capsys):
    (tmp_path / "pairs.txt").write_text("# none\n")
    assert main(["distance", str(sphere[0]), "--pairs", str(tmp_path / "pairs.txt")]) == 0
    assert capsys.readouterr().out.strip() == ""


def test_many_pairs_in_any_order():
    mesh = icosphere(3)
    chosen = np.random.default_rng(0).integers(mesh.n_vertices, size=(500, 2))
    engine = distance_engine(mesh)
    expected = engine.distances_from(chosen[:, 0])[np.arange(500), chosen[:, 1]]
    assert np.array_equal(isomatch.geodesics.pair_distances(engine, chosen), expected)
