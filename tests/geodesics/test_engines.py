"""What goes into an engine: sources that fit, coordinates that are finite; what cannot be reached is inf."""

import numpy as np
import pytest

from isomatch import Mesh, MeshError, geodesic_distances
from isomatch.geodesics import distance_engine
from shapes import flat_grid, icosphere, two_spheres
from zoo import specimen, zoo


def test_other_component_is_infinitely_far():
    mesh = two_spheres(1, 0.5)
    n = mesh.n_vertices // 2
    reached = np.isfinite(geodesic_distances(mesh, [0, n]))
    assert reached[0, :n].all()
    assert not reached[0, n:].any()
    assert reached[1, n:].all()
    assert not reached[1, :n].any()


def test_unused_vertex_is_infinitely_far_and_reaches_only_itself():
    sheet = flat_grid(3, 3)
    mesh = Mesh(np.vstack([sheet.vertices, [[0, 0, 0]]]), sheet.faces)
    distances = geodesic_distances(mesh, [0, 9])
    assert distances[0, 9] == np.inf
    assert distances[1, 9] == 0
    assert (distances[1, :9] == np.inf).all()


def test_no_sources_give_no_rows():
    assert geodesic_distances(flat_grid(3, 3), np.zeros(0, dtype=int)).shape == (0, 9)


def test_one_source_without_brackets():
    assert geodesic_distances(flat_grid(3, 3), 4).shape == (1, 9)


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ([-1], r"sources -1 are outside 0…8, the vertices of the surface"),
        ([0, 9, 12], r"sources 9, 12 are outside 0…8"),
        ([0.5], "one-dimensional array of vertex indices"),
        ([[0, 1]], "one-dimensional array of vertex indices"),
        (["nose"], "one-dimensional array of vertex indices"),
    ],
)
def test_bad_sources(sources, message):
    with pytest.raises(MeshError, match=message):
        geodesic_distances(flat_grid(3, 3), sources)


def test_unknown_engine():
    with pytest.raises(ValueError, match="unknown geodesic engine 'telepathy'; available: 'fast_marching'"):
        geodesic_distances(flat_grid(3, 3), [0], engine="telepathy")


def test_not_finite_coordinates():
    with pytest.raises(MeshError, match=r"vertices 0 have coordinates that are not finite.*repair\(mesh\)"):
        geodesic_distances(specimen("nan").mesh, [1])


@pytest.mark.parametrize("name", ["out_of_range", "wild"])
def test_faces_out_of_range(name):
    with pytest.raises(MeshError, match=r"faces .* refer to vertices outside 0…11"):
        geodesic_distances(specimen(name).mesh, [0])


@pytest.mark.parametrize("specimen", zoo(), ids=str)
def test_every_specimen_gives_distances_or_a_named_error(specimen):
    try:
        distances = geodesic_distances(specimen.mesh, range(min(specimen.mesh.n_vertices, 4)))
    except MeshError:
        assert "fatal" in specimen.tags, "distances are defined on all but fatal specimens"
    else:
        assert not np.isnan(distances).any()
        assert (distances >= 0).all()


def test_lowering_leaves_the_distance_to_the_nearest_source():
    mesh = icosphere(3)
    engine = distance_engine(mesh)
    nearest = np.full(mesh.n_vertices, np.inf)
    sources = np.array([0, 100, 400])
    for source in sources:
        engine.lower(nearest, int(source))
    full = engine.distances_from(sources).min(axis=0)
    np.testing.assert_allclose(nearest, full, rtol=0.02)
    assert np.median(np.abs(nearest - full)) < 1e-9
