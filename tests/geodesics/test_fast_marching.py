"""Fast marching against distances known in closed form, and the laws it must obey."""

import numpy as np
import pytest

from data import tosca
from isomatch import Mesh, geodesic_distances
from isomatch.geodesics import distance_engine, pair_distances
from isomatch_lab.procedural import creature
from shapes import cylinder, cylinder_distances, flat_grid, icosphere, planar_delaunay
from zoo.made import moved, together


def euclidean(mesh, sources):
    return np.linalg.norm(mesh.vertices[sources][:, None] - mesh.vertices, axis=2)


def relative_error(computed, exact):
    """|computed / exact − 1| at all points but the sources."""
    away = exact > 0
    return np.abs(computed[away] / exact[away] - 1)


@pytest.mark.parametrize("seed", range(3))
def test_random_planar_mesh(seed):
    mesh = planar_delaunay(10_000, seed)
    sources = np.random.default_rng(seed).integers(mesh.n_vertices, size=3)
    computed, exact = geodesic_distances(mesh, sources), euclidean(mesh, sources)
    assert relative_error(computed, exact).mean() < 0.002
    assert (computed - exact).min() > -1e-6, "no path in the plane is shorter than the straight line"


def test_acute_and_right_grids_are_exact():
    for shear in (0.0, -0.4):
        mesh = flat_grid(30, 40, shear)
        sources = [0, 15 * 40 + 20, 39]
        assert relative_error(geodesic_distances(mesh, sources), euclidean(mesh, sources)).max() < 1e-6


@pytest.mark.parametrize("shear", [0.7, 1.7, 2.3, -1.7, -3.3])
def test_obtuse_grid(shear):
    mesh = flat_grid(40, 60, shear)
    sources = [20 * 60, 11 * 60 + 40]
    assert relative_error(geodesic_distances(mesh, sources), euclidean(mesh, sources)).mean() < 0.01


@pytest.mark.parametrize("stretch", [2, 4, 6])
def test_stretched_random_mesh(stretch):
    """Triangles that were stretched, so that most are obtuse, some extremely."""
    plain = planar_delaunay(3000, seed=2)
    mesh = Mesh(plain.vertices * [stretch, 1, 1], plain.faces)
    sources = [5, 700, 1500]
    assert relative_error(geodesic_distances(mesh, sources), euclidean(mesh, sources)).mean() < 0.003


@pytest.mark.parametrize("source", [0, 40, 1000])
def test_cylinder_is_exact_around_both_sides(source):
    computed = geodesic_distances(cylinder(60, 80), [source])
    assert relative_error(computed, cylinder_distances(60, 80, source)[None]).max() < 1e-6


def test_halving_the_edges_of_a_sphere_quarters_the_error():
    """Second order, thanks to the curvature of the front; halving would be first order."""
    errors = []
    for level in range(2, 6):
        sphere = icosphere(level)
        sources = [0, 20, 100]
        exact = np.arccos(np.clip(sphere.vertices[sources] @ sphere.vertices.T, -1, 1))
        errors.append(np.abs(geodesic_distances(sphere, sources) - exact).mean())
    ratios = np.divide(errors[:-1], errors[1:])
    assert (ratios > 3.8).all(), f"errors {errors}"
    assert errors[-1] < 0.0002


def test_distance_along_one_edge_is_its_length(example):
    mesh = example[0].mesh
    i, j = mesh.edges[::50].T
    length = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    computed = geodesic_distances(mesh, i)[np.arange(len(i)), j]
    np.testing.assert_array_less(computed, length * (1 + 1e-6))
    assert (computed / length).mean() > 0.999


def test_not_shorter_than_the_straight_line_nor_longer_than_edges(example):
    mesh, sources = example[0].mesh, [0, 700, 2100]
    computed = geodesic_distances(mesh, sources)
    assert (computed <= geodesic_distances(mesh, sources, "dijkstra") * (1 + 1e-6)).all()
    assert (computed >= euclidean(mesh, sources) * 0.99).all(), "up to the accuracy of the front's curvature"


@pytest.mark.long
@pytest.mark.parametrize("shape", ["creature", "creature in another pose", "cat"])
def test_against_exact_distances(shape):
    pytest.importorskip("pygeodesic", reason="needs pygeodesic")
    mesh = tosca("cat0") if shape == "cat" else creature(5000, pose=0 if shape == "creature" else 2).mesh
    sources = np.random.default_rng(0).integers(mesh.n_vertices, size=6)
    exact = geodesic_distances(mesh, sources, "exact")
    assert relative_error(geodesic_distances(mesh, sources), exact).mean() < 0.003


def test_distances_do_not_depend_on_rounding(example):
    """Paths of equal length are common where a mesh is symmetric or flat; rounding must not choose between them."""
    mesh = example[0].mesh
    plain, scaled = (
        geodesic_distances(Mesh(s * mesh.vertices, mesh.faces), range(0, 2900, 50)) for s in (1, 3)
    )
    np.testing.assert_allclose(scaled, 3 * plain, rtol=1e-5)


def test_sources_are_independent_fronts(example):
    mesh = example[0].mesh
    together = geodesic_distances(mesh, [4, 4, 1200])
    assert np.array_equal(together[0], together[1])
    assert np.array_equal(together[2:], geodesic_distances(mesh, [1200]))


@pytest.mark.parametrize("seed", range(3))
def test_coincident_corners_and_repeated_vertices_shorten_no_path(seed):
    """Through arbitrary faces, where fronts meet in space only, the error stays within a fifth."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (60, 3))
    points[rng.integers(0, 60, 10)] = points[0]
    mesh = Mesh(points, rng.integers(0, 60, (200, 3)))
    straight = np.linalg.norm(points[:, None] - points, axis=2)
    distances = geodesic_distances(mesh, np.arange(60))
    assert (distances >= 0.8 * straight - 1e-6).all()
    assert (distances <= geodesic_distances(mesh, np.arange(60), "dijkstra") + 1e-6).all()


@pytest.mark.parametrize("unit", [1.0, 1e-13])
def test_pairs_have_the_distances_of_whole_columns(unit):
    """Near and far pairs, some in both directions and some twice, one with itself, one that no path joins."""
    sphere = icosphere(3)
    n = sphere.n_vertices
    mesh = moved(together(sphere, moved(sphere, 5)), scale=unit)
    rng = np.random.default_rng(0)
    near = sphere.edges[rng.integers(len(sphere.edges), size=30)]
    far = rng.integers(n, size=(30, 2))
    pairs = np.concatenate([near, near[:5, ::-1], far, far[:5], [[7, 7], [3, n + 3]], far + n])
    engine = distance_engine(mesh)
    columns = engine.distances_from(pairs[:, 0])
    found = pair_distances(engine, pairs)
    assert np.array_equal(found, columns[np.arange(len(pairs)), pairs[:, 1]])
    assert np.isinf(found).sum() == 1
    assert pair_distances(engine, np.zeros((0, 2), int)).shape == (0,)
