"""Shortest paths against closed forms, exact distances, and the law that they are straight."""

import json

import numpy as np
import pytest

import isomatch
from isomatch import Mesh, MeshError, PrecisePoints, geodesic_distances, geodesic_path
from isomatch.cli import main
from isomatch.geodesics import distance_engine, geodesic_paths, pair_distances, write_paths
from later import some_later
from shapes import flat_grid, icosphere
from zoo import torus
from zoo.made import block, boxes, soup
from zoo.specimens import grid


def random_points(mesh, count, seed):
    rng = np.random.default_rng(seed)
    return PrecisePoints(
        mesh.faces[rng.integers(mesh.n_faces, size=count)], rng.dirichlet(np.ones(3), size=count)
    )


def nearest_point(mesh, place):
    """The point of a mesh at a place on it."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    double = (across**2).sum(axis=1)
    weights = np.stack(
        [(np.cross(q - place, r - place) * across).sum(axis=1) / double for q, r in ((b, c), (c, a), (a, b))],
        1,
    )
    weights = np.maximum(weights, 0)
    weights /= weights.sum(axis=1, keepdims=True)
    found = np.einsum("fi,fij->fj", weights, mesh.vertices[mesh.faces])
    face = np.linalg.norm(found - place, axis=1).argmin()
    return PrecisePoints(mesh.faces[[face]], weights[[face]])


def assert_sound(mesh, path):
    """Every segment is in its face, and the angle with an edge is the same on both sides of it."""
    assert len(path.faces) == len(path.positions) - 1
    np.testing.assert_allclose(path.points.interpolated(mesh.vertices), path.positions)
    steps = np.diff(path.positions, axis=0)
    assert path.length == pytest.approx(np.linalg.norm(steps, axis=1).sum(), rel=1e-12)
    for face, ends in zip(path.faces, zip(path.positions, path.positions[1:])):
        corners = mesh.vertices[mesh.faces[face]]
        for end in ends:
            system = np.vstack([corners.T, np.ones(3)])
            weights = np.linalg.lstsq(system, np.append(end, 1), rcond=None)[0]
            assert weights.min() > -1e-9
            np.testing.assert_allclose(weights @ corners, end, atol=1e-9)
    for k, (corners, weights) in enumerate(zip(*path.points)):
        if 0 < k < len(path.faces) and (weights > 1e-6).sum() == 2:
            a, b = mesh.vertices[corners[weights > 1e-6]]
            before, after = (step / np.linalg.norm(step) for step in steps[k - 1 : k + 1])
            assert before @ (b - a) == pytest.approx(after @ (b - a), abs=1e-6 * np.linalg.norm(b - a))


def test_in_the_plane_paths_are_straight():
    mesh = flat_grid(7, 9, shear=0.6)
    first, second = random_points(mesh, 30, 0), random_points(mesh, 30, 1)
    for path in geodesic_paths(mesh, first, second):
        assert_sound(mesh, path)
        assert path.length == pytest.approx(np.linalg.norm(path.positions[0] - path.positions[-1]), rel=1e-12)


@pytest.mark.parametrize("cells", [1, 3])
def test_on_a_cube_and_a_brick(cells):
    """Between opposite corners of a brick a ≤ b ≤ c it is √((a + b)² + c²), and 2 between the middles of a cube."""
    cube = boxes(block(cells, cells, cells), (1 / cells,) * 3)
    path = geodesic_path(cube, nearest_point(cube, np.zeros(3)), nearest_point(cube, np.ones(3)))
    assert path.length == pytest.approx(5**0.5, rel=1e-12)
    middles = (nearest_point(cube, np.array([0.5, 0.5, z])) for z in (0, 1))
    assert geodesic_path(cube, *middles).length == pytest.approx(2.0, rel=1e-12)
    brick = boxes(block(cells, cells, cells), np.array([2.0, 3.0, 6.0]) / cells)
    path = geodesic_path(
        brick, nearest_point(brick, np.zeros(3)), nearest_point(brick, np.array([2.0, 3, 6]))
    )
    assert_sound(brick, path)
    assert path.length == pytest.approx((6**2 + 5**2) ** 0.5, rel=1e-12)


def cone(half_angle, around, rings):
    """A cone of straight generators, its slant 1, and the angle of one face at the tip."""
    turn = 2 * np.pi * np.arange(around) / around
    circle = np.column_stack([np.cos(turn), np.sin(turn)]) * np.sin(half_angle)
    points = [[0, 0, 0]]
    for r in np.arange(1, rings + 1) / rings:
        points += [[r * x, r * y, r * np.cos(half_angle)] for x, y in circle]
    k = np.arange(around)
    faces = [np.stack([0 * k, 1 + k, 1 + (k + 1) % around], 1)]
    for ring in range(rings - 1):
        a, b = 1 + ring * around + k, 1 + ring * around + (k + 1) % around
        faces += [np.stack([a, a + around, b + around], 1), np.stack([a, b + around, b], 1)]
    chord = 2 * np.sin(half_angle) * np.sin(np.pi / around)
    return Mesh(points, np.concatenate(faces)), 2 * np.arcsin(chord / 2)


@pytest.mark.parametrize("half_angle", [0.15, 0.5, 1.2])
def test_on_a_cone_it_is_the_law_of_cosines(half_angle):
    """The cone unrolled is a sector of a disk, and no path leads over the tip, where the angle is less than 2 π."""
    around, rings = 24, 4
    mesh, angle = cone(half_angle, around, rings)
    for r, s, k in ((4, 4, 5), (1, 4, 12), (2, 3, 9), (4, 1, 17), (3, 3, 1)):
        i, j = 1 + (r - 1) * around, 1 + (s - 1) * around + k
        turn = min(k, around - k) * angle
        p, q = r / rings, s / rings
        path = geodesic_path(mesh, i, j)
        assert_sound(mesh, path)
        unrolled = (p**2 + q**2 - 2 * p * q * np.cos(turn)) ** 0.5
        assert path.length == pytest.approx(unrolled, rel=1e-12)


def test_on_a_saddle_cone_it_may_lead_through_the_tip():
    """Eight quarters of a disk around a point: within an angle of π straight, beyond it over the tip."""
    k = np.arange(16)
    turn = 2 * np.pi * k / 16
    rim = np.column_stack([np.cos(turn), np.sin(turn), 0.9 * (-1.0) ** k])
    rim /= np.linalg.norm(rim, axis=1)[:, None]
    mesh = Mesh([[0, 0, 0], *rim], np.stack([0 * k, 1 + k, 1 + (k + 1) % 16], 1))
    angle = np.arccos(rim[0] @ rim[1])
    assert 16 * angle > 2 * np.pi
    for step in range(1, 9):
        path = geodesic_path(mesh, 1, 1 + step)
        if step * angle >= np.pi:
            assert path.length == pytest.approx(2.0, rel=1e-12)
            assert np.array_equal(path.positions, [rim[0], [0, 0, 0], rim[step]])


def test_on_spheres_paths_come_near_great_circles():
    """The error falls with the square of the edges: a quarter from one level to the next."""
    errors = []
    for level in (2, 3, 4):
        mesh = icosphere(level)
        first, second = np.array([0, 3, 17, 30]), np.array([41, 25, 8, 12])
        angle = np.arccos((mesh.vertices[first] * mesh.vertices[second]).sum(axis=1))
        paths = list(geodesic_paths(mesh, first, second))
        errors.append(np.abs([path.length for path in paths] / angle - 1).mean())
        for i, j, path in zip(first, second, paths):
            assert_sound(mesh, path)
            pole = np.cross(mesh.vertices[i], mesh.vertices[j])
            height = path.positions @ pole / np.linalg.norm(pole)
            assert np.abs(height).max() < 0.5 / 2**level
    assert errors[1] < 0.4 * errors[0]
    assert errors[2] < 0.4 * errors[1]


@pytest.mark.parametrize("name", some_later(["creature", "torus"], lambda name: name == "torus"))
def test_lengths_are_exact_distances_of_100_pairs(name, example):
    pytest.importorskip("pygeodesic", reason="needs pygeodesic")
    mesh = example[0].mesh if name == "creature" else torus(24, 12)
    pairs = np.random.default_rng(5).integers(mesh.n_vertices, size=(100, 2))
    exact = pair_distances(distance_engine(mesh, "exact"), pairs)
    for path, (i, j), distance in zip(geodesic_paths(mesh, *pairs.T), pairs, exact):
        assert path.length == pytest.approx(distance, rel=1e-9)
        assert np.array_equal(path.positions[[0, -1]], mesh.vertices[[i, j]])
    assert_sound(mesh, path)


@pytest.mark.long
@pytest.mark.parametrize("name", ["creature", "torus"])
def test_from_face_to_face_and_back(name, example):
    pytest.importorskip("pygeodesic", reason="needs pygeodesic")
    mesh = example[0].mesh if name == "creature" else torus(40, 20)
    first, second = random_points(mesh, 12, 0), random_points(mesh, 12, 1)
    exact = np.diag(geodesic_distances(mesh, first, "exact", targets=second))
    back = list(geodesic_paths(mesh, second, first))
    for path, returned, distance in zip(geodesic_paths(mesh, first, second), back, exact):
        assert_sound(mesh, path)
        assert path.length == pytest.approx(distance, rel=1e-9)
        assert path.length == pytest.approx(returned.length, rel=1e-12)


def test_ends_on_edges_at_corners_and_in_one_face():
    mesh = Mesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    on_diagonal = PrecisePoints(np.array([[0, 2, 2]]), np.array([[0.25, 0.75, 0.0]]))
    twice = PrecisePoints(np.array([[2, 0, 1]]), np.array([[0.75, 0.25, 0.0]]))
    assert geodesic_path(mesh, on_diagonal, twice).length == 0
    path = geodesic_path(mesh, 1, on_diagonal)
    np.testing.assert_allclose(path.positions, [[4, 0, 0], [3, 3, 0]])
    near = PrecisePoints(np.array([[0, 1, 2]]), np.array([[0.5, 0.25, 0.25]]))
    path = geodesic_path(mesh, near, PrecisePoints(np.array([[2, 1, 0]]), np.array([[0.25, 0.5, 0.25]])))
    assert path.faces.tolist() == [0]
    assert path.length == pytest.approx(1.0)
    at_corner = PrecisePoints(np.array([[0, 1, 2]]), np.array([[0.0, 1.0, 0.0]]))
    assert geodesic_path(mesh, at_corner, 3).length == pytest.approx(32**0.5)


def test_across_a_seam_with_the_indices_of_the_user():
    whole = icosphere(2)
    torn = soup(whole)
    i, j = 30, 700
    path = geodesic_path(torn, i, j)
    expected = geodesic_path(whole, int(whole.faces.ravel()[i]), int(whole.faces.ravel()[j]))
    assert path.length == pytest.approx(expected.length, rel=1e-12)
    assert path.points.corners[0].tolist() == [i] * 3
    assert path.points.corners[-1].tolist() == [j] * 3
    assert_sound(torn, path)
    assert geodesic_path(whole, 3, 3).length == 0
    with pytest.raises(MeshError, match="no path"):
        geodesic_path(torn, i, j, weld=False)


def test_where_the_mesh_is_no_manifold(book):
    """From one page of a book to another the path is straight across the spine."""
    path = geodesic_path(book[0], 4, 25 + 24)
    assert path.length == pytest.approx((8**2 + 4**2) ** 0.5)
    assert_sound(book[0], path)


def test_huge_and_tiny_shapes():
    mesh = icosphere(1)
    expected = geodesic_path(mesh, 0, 30)
    for scale in (1e-150, 1e150):
        path = geodesic_path(Mesh(scale * mesh.vertices, mesh.faces), 0, 30)
        assert path.length == pytest.approx(scale * expected.length, rel=1e-9)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (9, r"vertices 9 are outside 0…8"),
        (0.5, "one-dimensional array of vertex indices"),
        ([1, 2], "1 sources and 2 targets; give a target for each source"),
        (
            PrecisePoints(np.array([[0, 1, 8]]), np.full((1, 3), 1 / 3)),
            r"\[0, 1, 8\], between which there is no face",
        ),
        (
            PrecisePoints(np.array([[0, 8, 8]]), np.array([[0.5, 0.5, 0]])),
            r"\[0, 8\], between which there is no edge",
        ),
        (
            PrecisePoints(np.array([[0, 1, 4]]), np.array([[0.5, 0.7, -0.2]])),
            r"weights 0\.5, 0\.7, -0\.2; expected three",
        ),
        (PrecisePoints(np.array([[0, 1, 12]]), np.full((1, 3), 1 / 3)), r"vertices 12 are outside 0…8"),
    ],
)
def test_points_that_are_none_of_the_surface(target, message):
    with pytest.raises(MeshError, match=message):
        geodesic_path(flat_grid(3, 3), 0, target)


@pytest.mark.parametrize("ends", [[], [0, 1]])
def test_one_path_at_a_time(ends):
    with pytest.raises(MeshError, match="geodesic_paths"):
        geodesic_path(flat_grid(3, 3), ends, ends)


@pytest.mark.parametrize("engine", ["fast_marching", "dijkstra"])
@pytest.mark.parametrize("corners", [[0, 1, 8], [0, 8, 8]])
def test_points_between_corners_of_no_face(engine, corners):
    point = PrecisePoints(np.array([corners]), np.full((1, 3), 1 / 3))
    with pytest.raises(MeshError, match="between"):
        geodesic_distances(flat_grid(3, 3), 0, engine, targets=point)


@pytest.mark.parametrize(
    ("engine", "tolerance"),
    [
        ("fast_marching", {"atol": 0.05}),
        ("exact", {"atol": 1e-9}),
        ("heat", {"rtol": 0.1, "atol": 0.8}),
        ("dijkstra", {"rtol": 0.42, "atol": 1.5}),
    ],
)
def test_distances_of_points_in_faces(engine, tolerance):
    package = {"exact": "pygeodesic", "heat": "potpourri3d"}.get(engine)
    if package:
        pytest.importorskip(package)
    mesh = flat_grid(12, 12)
    first, second = random_points(mesh, 10, 3), random_points(mesh, 10, 4)
    places, others = (points.interpolated(mesh.vertices) for points in (first, second))
    found = geodesic_distances(mesh, first, engine, targets=second)
    np.testing.assert_allclose(found, np.linalg.norm(places[:, None] - others, axis=2), **tolerance)
    to_vertices = geodesic_distances(mesh, first, engine)
    np.testing.assert_allclose(
        to_vertices, np.linalg.norm(places[:, None] - mesh.vertices, axis=2), **tolerance
    )
    from_vertices = geodesic_distances(mesh, [3, 77], engine, targets=first)
    np.testing.assert_allclose(from_vertices, to_vertices[:, [3, 77]].T, **tolerance)
    assert np.array_equal(np.diag(geodesic_distances(mesh, first, engine, targets=first)), np.zeros(10))


def test_fast_marching_is_as_accurate_in_faces_as_at_vertices(example):
    pytest.importorskip("pygeodesic", reason="needs pygeodesic")
    mesh = example[0].mesh
    points = random_points(mesh, 8, 2)
    exact, marched = (geodesic_distances(mesh, points, engine) for engine in ("exact", "fast_marching"))
    assert np.abs(marched / exact - 1).mean() < 0.003


def test_points_in_faces_need_faces():
    points = PrecisePoints(np.array([[0, 1, 2]]), np.full((1, 3), 1 / 3))
    with pytest.raises(MeshError, match="Graph"):
        geodesic_distances(isomatch.Graph(3, [[0, 1], [1, 2]], [1.0, 1.0]), points)


def test_a_basis_interpolates():
    mesh = grid(8, 9)
    basis = isomatch.distance_basis(mesh, 20, 40)
    points = random_points(mesh, 5, 0)
    n = mesh.n_vertices
    found = basis.with_points(points)
    exact = geodesic_distances(mesh, points)
    assert np.abs(found.between(n + np.arange(5), np.arange(n)) - exact).max() < 0.2 * exact.max()
    assert found.distance(3, 9) == basis.distance(3, 9)


def test_files(tmp_path):
    mesh = icosphere(2)
    paths = [geodesic_path(mesh, 0, 100), geodesic_path(mesh, 5, 9)]
    write_paths(tmp_path / "paths.obj", paths)
    lines = (tmp_path / "paths.obj").read_text().splitlines()
    points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    runs = [np.array(line.split()[1:], dtype=int) - 1 for line in lines if line.startswith("l ")]
    for run, path in zip(runs, paths, strict=True):
        assert np.array_equal(points[run], path.positions)
    with pytest.raises(isomatch.FormatError, match="suffix"):
        write_paths(tmp_path / "paths.stl", paths)
    pyvista = pytest.importorskip("pyvista")
    write_paths(tmp_path / "paths.vtp", paths)
    read = pyvista.read(tmp_path / "paths.vtp")
    assert read.n_lines == 2
    assert np.array_equal(read.points, np.concatenate([path.positions for path in paths]))
    assert np.array_equal(read.cell_data["length"], [path.length for path in paths])
    corners, weights = read.point_data["corners"], read.point_data["barycentric"]
    np.testing.assert_allclose(PrecisePoints(corners, weights).interpolated(mesh.vertices), read.points)


def test_command(tmp_path, capsys):
    mesh = icosphere(2)
    isomatch.write_mesh(tmp_path / "sphere.ply", mesh)
    file, out = str(tmp_path / "sphere.ply"), str(tmp_path / "path.obj")
    assert main(["distance", file, "--from", "0,f7:0.2,0.3,0.5", "--to", "100", "--path", out, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    point = PrecisePoints(mesh.faces[[7]], np.array([[0.2, 0.3, 0.5]]))
    expected = [geodesic_path(mesh, 0, 100).length, geodesic_path(mesh, point, 100).length]
    np.testing.assert_allclose(np.ravel(record["distances"]), expected, rtol=1e-6)
    assert (record["sources"], record["targets"]) == ([0, "f7:0.2,0.3,0.5"], [100])
    assert (tmp_path / "path.obj").read_text().count("l ") == 2
    (tmp_path / "pairs.txt").write_text("0 100\nf7:0.2,0.3,0.5, 100  # a face\n")
    pairs = str(tmp_path / "pairs.txt")
    assert main(["distance", file, "--pairs", pairs, "--path", str(tmp_path / "path.vtp")]) == 0
    said = [float(line) for line in capsys.readouterr().out.splitlines()]
    np.testing.assert_allclose(said, expected, rtol=1e-6)
    assert main(["distance", file, "--pairs", pairs, "--engine", "fast_marching", "--quiet"]) == 0
    said = [float(line) for line in capsys.readouterr().out.splitlines()]
    np.testing.assert_allclose(said, expected, rtol=0.01)
    assert (
        main(["distance", file, "--from", "f7:0.2,0.3,0.5", "--to", "100", "-o", str(tmp_path / "d.csv")])
        == 0
    )
    capsys.readouterr()
    assert (tmp_path / "d.csv").read_text().startswith('target,"from_f7:0.2,0.3,0.5"\n100,')
    assert main(["distance", file, "--pairs", pairs, "-o", str(tmp_path / "d.npz")]) == 0
    with np.load(tmp_path / "d.npz") as held:
        assert held["pairs"].tolist() == [[0, 100], [162, 100]]
        assert held["corners"].tolist() == mesh.faces[[7]].tolist()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            ["--from", "0", "--path", "p.obj"],
            "--path needs the ends of the paths: --pairs, or --from and --to",
        ),
        (["--from", "0", "--to", "1", "--path", "p.stl"], "suffix '.stl' cannot hold paths"),
        (["--from", "f7:0.2,0.3", "--to", "1"], "is not a list of points"),
        (["--from", "f999:0.2,0.3,0.5"], "f999:0.2,0.3,0.5: there is no such face; faces are 0…319"),
        (["--from", "f9:0.2,0.3,0.1"], "the weights add up to 0.6, not to 1"),
        (["--from", "f9:0.2,0.3,0.5,200"], "sources 200 are outside 0…161"),
    ],
)
def test_bad_usage(more, words, tmp_path, capsys):
    isomatch.write_mesh(tmp_path / "sphere.ply", icosphere(2))
    assert main(["distance", str(tmp_path / "sphere.ply"), *more]) == 1
    assert words in capsys.readouterr().err
