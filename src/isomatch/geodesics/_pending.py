"""Pending."""

import numba
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra


def euclidean_farthest_points(points, count, start):
    chosen = np.zeros(min(count, len(points)), dtype=np.int64)
    chosen[0] = start
    _spread(points, chosen)
    return chosen


@numba.njit(cache=True, nogil=True)
def _spread(points, chosen):
    nearest = np.full(len(points), np.inf)
    for i in range(len(chosen)):
        if i:
            chosen[i] = np.argmax(nearest)
        x, y, z = points[chosen[i]]
        for j in range(len(points)):
            squared = (points[j, 0] - x) ** 2 + (points[j, 1] - y) ** 2 + (points[j, 2] - z) ** 2
            if squared < nearest[j]:
                nearest[j] = squared
        nearest[chosen[i]] = -1.0


def nearest_along_edges(shape, centres):
    i, j = shape.edges.T
    lengths = np.maximum(shape.edge_lengths, 1e-300)
    graph = coo_array((lengths, (i, j)), shape=(shape.n_vertices,) * 2).tocsr()
    distance, _, nearest = dijkstra(
        graph, directed=False, indices=centres, min_only=True, return_predecessors=True
    )
    return distance, nearest


class RestrictedEngine:
    def __init__(self, engine, vertices, unit):
        self.engine, self.vertices, self.unit = engine, vertices, unit
        self.name, self.n_points = engine.name, len(vertices)

    def distances_from(self, sources):
        return self.engine.distances_from(self.vertices[sources])[:, self.vertices] / self.unit

    def lower(self, nearest, source):
        column = self.distances_from(np.array([source]))[0]
        np.minimum(nearest, column, out=nearest)
        return column
