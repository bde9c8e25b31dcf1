"""Distances of a mesh whose seams are welded, for the vertices as they are in the file."""

from __future__ import annotations

import numpy as np

from isomatch.geodesics.balls import geodesic_balls
from isomatch.geodesics.front import Balls
from isomatch.geodesics.pairs import pair_distances
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.geodesics.restricted import RestrictedEngine
from isomatch.values.arrays import FloatArray, IntArray


class WeldedEngine(RestrictedEngine):
    """Distances of points that may be the same point of a space, as those on both sides of a seam are.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of the welded space.
    point : (n,) array of int
        The point of that space of each vertex.
    notes : tuple of str
        What was welded.

    Examples
    --------
    >>> from isomatch.geodesics import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(3.0), np.arange(3.0)))
    >>> WeldedEngine(distance_engine(line), np.array([0, 1, 1, 2])).distances_from([0])
    array([[0., 1., 1., 2.]])
    """

    def __init__(self, engine: DistanceEngine, point: IntArray, notes: tuple[str, ...] = ()) -> None:
        super().__init__(engine, point)
        self.notes = notes

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        self._require_in_range(np.array([source]))
        bound = np.zeros(self._engine.n_points)
        np.maximum.at(bound, self._vertices, nearest)
        column = self._engine.lower(bound, int(self._vertices[source]))
        np.minimum(nearest, bound[self._vertices], out=nearest)
        return None if column is None else column[self._vertices]

    def pair_distances(self, pairs: IntArray) -> FloatArray:
        """Distances (m,) of m pairs of vertices."""
        self._require_in_range(pairs.ravel())
        return pair_distances(self._engine, self._vertices[pairs])

    def balls(self, centres: IntArray, radius: float) -> Balls:
        """Vertices within a radius of m centres."""
        self._require_in_range(centres)
        found = geodesic_balls(self._engine, self._vertices[centres], radius)
        order = np.argsort(self._vertices, kind="stable")  # vertices, those of a point together
        ends = np.searchsorted(self._vertices[order], np.arange(self._engine.n_points + 1))
        parts = []
        for low, high in zip(found.start, found.start[1:]):
            points, apart = found.points[low:high], found.distances[low:high]
            copies = [order[ends[p] : ends[p + 1]] for p in points]
            vertices = np.concatenate([self._vertices[:0], *copies])
            distances = np.repeat(apart, [len(each) for each in copies])
            inside = np.argsort(vertices)
            parts.append((vertices[inside], distances[inside]))
        return Balls.of(parts)
