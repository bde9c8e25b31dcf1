"""Distances on a surface with a missing part."""

import numpy as np

from isomatch.geodesics import MissingRegion, distance_engine, geodesic_distances
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature
from shapes import flat_grid, icosphere


def square_with_a_hole(n=31):
    """A flat square without the vertices of a square in its middle."""
    whole = flat_grid(n, n)
    inside = (np.abs(whole.vertices[:, :2] - (n - 1) / 2) < n / 5).all(axis=1)
    return whole.submesh(~inside)[0]


def bounds(mesh, sources, n_samples=80):
    engine = distance_engine(mesh)
    everywhere = np.arange(mesh.n_vertices)
    along = engine.distances_from(sources)
    return MissingRegion.of(mesh, engine, n_samples).lower_bound(sources, everywhere, along), along


def test_the_straight_line_through_a_hole_lies_between_the_bounds():
    holed = square_with_a_hole()
    sources = np.array([0, holed.n_vertices // 3, holed.n_vertices - 5])
    lower, upper = bounds(holed, sources, n_samples=1000)
    straight = np.linalg.norm(holed.vertices[sources, None] - holed.vertices, axis=2)
    assert (lower <= straight + 0.02 * straight.max()).all()
    assert (upper >= straight - 0.02 * straight.max()).all()
    assert (upper - straight).max() > 2, "some paths lead around the hole"


def test_distances_are_known_where_the_boundary_is_far():
    body = creature(1500).mesh
    part = cut(body, 0.2, seed=1)
    sources = np.array([10, 200])
    lower, upper = bounds(part.mesh, sources)
    whole = geodesic_distances(body, part.original[sources])[:, part.original]
    assert (lower <= whole + 0.05).all()
    known = lower >= 0.97 * upper
    assert 0.1 < known.mean() < 1
    assert np.abs(whole - upper)[known].max() < 0.06


def test_no_source_has_no_bounds():
    holed = square_with_a_hole()
    lower, _ = bounds(holed, np.zeros(0, dtype=int))
    assert lower.shape == (0, holed.n_vertices)


def test_nothing_is_missing_from_a_closed_surface():
    sphere = icosphere(2)
    lower, upper = bounds(sphere, np.array([3]))
    assert np.array_equal(lower, upper)
    assert np.isinf(MissingRegion.of(sphere, distance_engine(sphere), 10).to_boundary).all()
