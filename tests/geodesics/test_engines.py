"""Choosing an engine by name, and the laws that every registered engine obeys."""

import sys
from dataclasses import dataclass

import numpy as np
import pytest

from isomatch import (
    Graph,
    MemoryBudgetError,
    Mesh,
    MeshError,
    MissingDependencyError,
    PointCloud,
    SettingError,
    check,
    geodesic_distances,
    repair,
)
from isomatch.geodesics import ENGINES, distance_engine, engine_names
from shapes import disguised, flat_grid, icosphere, two_spheres
from zoo import specimen, zoo


@dataclass(frozen=True)
class Tolerance:
    """Largest errors of an engine: the defaults, unless it has an entry in ``TOLERANCES``."""

    on_sphere: float = 0.003  # mean relative error to great circles, 642 and 2562 vertices
    on_fine_sphere: float = 0.003
    metric: float = 0.01  # asymmetry and violation of the triangle inequality, over the largest distance
    to_fast_marching: float = 0.01  # mean relative difference on an animal of 2900 vertices


TOLERANCES = {
    "exact": Tolerance(on_fine_sphere=1e-3, metric=1e-9, to_fast_marching=0.002),
    "heat": Tolerance(on_sphere=0.02, on_fine_sphere=0.02, metric=0.03, to_fast_marching=0.03),
    "dijkstra": Tolerance(on_sphere=0.12, on_fine_sphere=0.12, metric=1e-9, to_fast_marching=0.1),
}
PACKAGES = {"exact": "pygeodesic", "heat": "potpourri3d"}


@pytest.fixture
def tolerance(name):
    return TOLERANCES.get(name, Tolerance())


@pytest.mark.parametrize(("level", "size"), [(3, "on_sphere"), (4, "on_fine_sphere")])
def test_great_circles(name, tolerance, level, size):
    """The polyhedron is inscribed, so that even exact distances on it are a little shorter than on the sphere."""
    sphere = icosphere(level)
    sources = [0, 20, 100]
    great = np.arccos(np.clip(sphere.vertices[sources] @ sphere.vertices.T, -1, 1))
    error = np.abs(geodesic_distances(sphere, sources, name) - great).mean() / great.mean()
    assert error < getattr(tolerance, size)


def test_symmetry_and_triangle_inequality(name, tolerance, example):
    sources = np.arange(0, 2900, 30 if name == "fast_marching" else 120)
    among = geodesic_distances(example[0].mesh, sources, name)[:, sources]
    slack = tolerance.metric
    assert np.abs(among - among.T).max() <= slack * among.max()
    through_third = (among[:, :, None] + among[None]).min(axis=1)
    assert (among - through_third).max() <= slack * among.max()
    assert np.array_equal(np.diag(among), np.zeros(len(sources)))


def test_engines_agree_on_a_creature(name, tolerance, example):
    mesh = example[0].mesh
    sources = [0, 700, 2100]
    marched, found = (geodesic_distances(mesh, sources, engine) for engine in ("fast_marching", name))
    away = marched > 0
    relative = found[away] / marched[away] - 1
    assert np.abs(relative).mean() <= tolerance.to_fast_marching
    if name == "dijkstra":
        assert relative.min() > -0.01, "paths along edges are no shorter"


def test_relabelling_and_moving_change_nothing(name, example):
    mesh = example[0].mesh
    copy = disguised(mesh, seed=5, scale=7.0)
    sources = np.array([3, 900, 2500])
    plain = geodesic_distances(mesh, sources, name)
    moved = geodesic_distances(copy.mesh, copy.new_vertex[sources], name)[:, copy.new_vertex]
    np.testing.assert_allclose(moved, 7 * plain, rtol=1e-5, atol=1e-6 * plain.max())


def test_extreme_sizes(name):
    for scale in (1e-150, 1e150):
        sphere = icosphere(1)
        large = Mesh(scale * sphere.vertices, sphere.faces)
        expected = scale * geodesic_distances(sphere, [5], name)
        np.testing.assert_allclose(geodesic_distances(large, [5], name), expected, rtol=1e-5)


def test_threads_change_nothing(name, example, monkeypatch):
    sources = np.arange(0, 2900, 480)
    columns = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
        columns.append(geodesic_distances(example[0].mesh, sources, name))
    assert np.array_equal(columns[0], columns[1])
    assert np.array_equal(columns[0], columns[2])


def test_an_engine_has_its_name_and_the_size_of_the_surface(name):
    engine = distance_engine(icosphere(1), name)
    assert (engine.name, engine.n_points) == (name, 42)


def test_names_are_those_of_the_registry():
    for kind, engines in ENGINES.items():
        assert engine_names(kind) == tuple(engine.name for engine in engines)
        assert len(set(engine_names(kind))) == len(engines), "no name twice"
    assert set(engine_names()) == {name for kind in ENGINES for name in engine_names(kind)}
    assert engine_names(np.ndarray) == ()


def test_default_engines():
    points = icosphere(1).vertices
    assert distance_engine(icosphere(1)).name == "fast_marching"
    assert distance_engine(PointCloud(points)).name == "dijkstra"
    assert distance_engine(Graph(2, [[0, 1]], [1.0])).name == "dijkstra"


def test_an_engine_is_returned_as_it_is():
    engine = distance_engine(icosphere(1))
    assert distance_engine(engine) is engine
    assert distance_engine(engine, "fast_marching") is engine
    with pytest.raises(SettingError, match="engine"):
        distance_engine(engine, "exact")


@pytest.mark.parametrize(
    ("surface", "name", "message"),
    [
        (
            flat_grid(3, 3),
            "telepathy",
            "a Mesh has no engine 'telepathy'; available: 'fast_marching', 'exact'",
        ),
        (
            Graph(2, [[0, 1]], [1.0]),
            "fast_marching",
            "a Graph has no engine 'fast_marching'; available: 'dijkstra'",
        ),
        (PointCloud(icosphere(0).vertices), "exact", "a PointCloud has no engine 'exact'"),
        (
            np.zeros((2, 2)),
            "heat",
            "engine 'heat' cannot be chosen: the distances are given, by engine 'matrix'",
        ),
    ],
)
def test_combinations_that_do_not_exist(surface, name, message):
    with pytest.raises(SettingError, match=message):
        distance_engine(surface, name)


def test_what_has_no_distances():
    with pytest.raises(MeshError, match="builtins"):
        distance_engine([1.0])


@pytest.mark.parametrize(("name", "package"), PACKAGES.items())
def test_missing_package(name, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setitem(sys.modules, f"{package}.geodesic", None)
    with pytest.raises(
        MissingDependencyError, match=rf"'{name}' needs .* {package}; .*pip install '\.\[{name}\]'"
    ):
        distance_engine(icosphere(0), name)


def test_columns_beyond_the_memory_budget_are_refused(name, monkeypatch):
    engine = distance_engine(icosphere(2), name)
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.00001")
    with pytest.raises(MemoryBudgetError, match="distance"):
        engine.distances_from(range(100))


@pytest.mark.long
@pytest.mark.parametrize("scale", [1.0, 1e-150])
def test_exact_distances_where_the_mesh_is_no_manifold(scale, book):
    """Any two pages of a book lie in one plane, once unfolded."""
    pytest.importorskip("pygeodesic", reason="needs pygeodesic")
    mesh, page = Mesh(scale * book[0].vertices, book[0].faces), book[1]
    assert len(check(repair(mesh).mesh).non_manifold_edges) == 4
    found = geodesic_distances(mesh, [7, 32], "exact") / scale
    mirrored = page.vertices * [-1, 1, 1]
    for row, page_of_source in zip(found, (0, 1)):
        places = [page.vertices if k == page_of_source else mirrored for k in range(3)]
        straight = np.linalg.norm(page.vertices[7] - np.concatenate(places), axis=1)
        np.testing.assert_allclose(row, straight, rtol=1e-12, atol=1e-12)


def test_heat_refuses_what_has_no_area():
    pytest.importorskip("potpourri3d", reason="needs potpourri3d")
    with pytest.raises(MeshError, match="component"):
        geodesic_distances(specimen("point").mesh, [0], "heat", weld=False)


def test_other_component_is_infinitely_far(name):
    mesh = two_spheres(1, 0.5)
    n = mesh.n_vertices // 2
    reached = np.isfinite(geodesic_distances(mesh, [0, n], name))
    assert reached[0, :n].all()
    assert not reached[0, n:].any()
    assert reached[1, n:].all()
    assert not reached[1, :n].any()


def test_unused_vertex_is_infinitely_far_and_reaches_only_itself(name):
    sheet = flat_grid(3, 3)
    mesh = Mesh(np.vstack([sheet.vertices, [[0, 0, 1]]]), sheet.faces)
    distances = geodesic_distances(mesh, [0, 9], name)
    assert distances[0, 9] == np.inf
    assert distances[1, 9] == 0
    assert (distances[1, :9] == np.inf).all()


def test_no_sources_give_no_rows(name):
    assert geodesic_distances(flat_grid(3, 3), np.zeros(0, dtype=int), name).shape == (0, 9)


def test_one_source_without_brackets():
    assert geodesic_distances(flat_grid(3, 3), 4).shape == (1, 9)


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ([-1], r"vertices -1 are outside 0…8, the vertices of the surface"),
        ([0, 9, 12], r"vertices 9, 12 are outside 0…8"),
        ([0.5], "one-dimensional array of vertex indices"),
        ([[0, 1]], "one-dimensional array of vertex indices"),
        (["nose"], "one-dimensional array of vertex indices"),
    ],
)
def test_bad_sources(sources, message, name):
    with pytest.raises(MeshError, match=message):
        geodesic_distances(flat_grid(3, 3), sources, name)


def test_not_finite_coordinates(name):
    with pytest.raises(MeshError, match="coordinates"):
        geodesic_distances(specimen("nan").mesh, [1], name)


@pytest.mark.parametrize("defect", ["out_of_range", "wild"])
def test_faces_out_of_range(defect, name):
    with pytest.raises(MeshError, match=r"outside|range"):
        geodesic_distances(specimen(defect).mesh, [0], name)


@pytest.mark.parametrize("specimen", zoo(), ids=str)
def test_every_specimen_gives_distances_or_a_named_error(specimen, name):
    try:
        distances = geodesic_distances(specimen.mesh, range(min(specimen.mesh.n_vertices, 4)), name)
    except MeshError:
        assert "fatal" in specimen.tags, "distances are defined on the other specimens"
    else:
        assert not np.isnan(distances).any()
        assert (distances >= 0).all()


@pytest.mark.parametrize("specimen", zoo("two_components"), ids=str)
def test_distances_between_components_are_infinite(specimen, name):
    distances = geodesic_distances(specimen.mesh, range(specimen.mesh.n_vertices), name, weld=False)
    separate = specimen.mesh.components[:, None] != specimen.mesh.components
    assert np.array_equal(np.isinf(distances), separate)


def test_lowering_gives_the_distance_to_the_nearest_source(name):
    mesh = icosphere(3)
    engine = distance_engine(mesh, name)
    nearest = np.full(mesh.n_vertices, np.inf)
    sources = np.array([0, 100, 400])
    for source in sources:
        engine.lower(nearest, int(source))
    full = engine.distances_from(sources).min(axis=0)
    np.testing.assert_allclose(nearest, full, rtol=0.02)
    assert np.median(np.abs(nearest - full)) < 1e-9
