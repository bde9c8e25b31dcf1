"""Columns asked for twice are the same, and are computed once."""

import numpy as np

from isomatch import Mesh, distance_engine
from isomatch.geodesics import pair_distances
from isomatch_lab.evaluation import CachingEngine
from shapes import planar_delaunay


class Counting:
    """Counts the columns computed."""

    def __init__(self, mesh: Mesh) -> None:
        self.engine, self.columns = distance_engine(mesh), 0
        self.name, self.n_points = self.engine.name, self.engine.n_points

    def distances_from(self, sources):
        self.columns += len(sources)
        return self.engine.distances_from(sources)

    def lower(self, nearest, source):
        return self.engine.lower(nearest, source)


def test_the_same_columns_computed_once():
    inner = Counting(planar_delaunay(60))
    engine = CachingEngine(inner, limit=2**20)
    first, again = engine.distances_from([3, 5, 3]), engine.distances_from([5, 3, 7])
    assert inner.columns == 3
    assert np.array_equal(first, inner.engine.distances_from([3, 5, 3]))
    assert np.array_equal(again, inner.engine.distances_from([5, 3, 7]))
    again[:] = 0
    assert np.array_equal(engine.distances_from([5]), first[1:2]), "the caller may change what was returned"
    assert engine.distances_from(np.zeros(0, dtype=int)).shape == (0, 60)


def test_pairs_are_those_of_the_engine_and_keep_nothing():
    inner = Counting(planar_delaunay(60))
    pairs = np.array([[3, 5], [5, 3], [7, 7]])
    assert np.array_equal(
        pair_distances(CachingEngine(inner, 2**20), pairs), pair_distances(inner.engine, pairs)
    )
    assert inner.columns == 3, "of an engine that has only columns"


def test_no_more_is_kept_than_allowed():
    inner = Counting(planar_delaunay(60))
    engine = CachingEngine(inner, limit=2 * 60 * 8)
    for _ in range(2):
        engine.distances_from([1, 2, 3, 4])
    assert inner.columns == 4 + 2
