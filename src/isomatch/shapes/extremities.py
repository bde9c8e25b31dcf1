"""Extremities of a shape: the tips of its limbs, found from average distances alone."""

from __future__ import annotations

import numpy as np

from isomatch.geodesics import DistanceEngine
from isomatch.surfaces import Surface
from isomatch.values.arrays import FloatArray, IntArray


def extremal_points(
    surface: Surface, engine: DistanceEngine, average_distance: FloatArray, spacing: float, limit: int
) -> tuple[IntArray, FloatArray]:
    """Find the local maxima of the average geodesic distance, the most remote first.

    Parameters
    ----------
    surface : Mesh, PointCloud or Graph
        The shape, n vertices.
    engine : DistanceEngine
        Its distances.
    average_distance : (n,) array of float
        Average geodesic distance of each vertex to all others.
    spacing : float
        Points nearer than this to a point already kept are passed over, in mesh units.
    limit : int
        How many to keep at most.

    Returns
    -------
    vertices : (q,) array of int
    distances : (q, n) array of float
        Distance columns of these vertices.
    """
    i, j = surface.edges.T
    highest = np.full(surface.n_vertices, -np.inf)
    np.maximum.at(highest, i, average_distance[j])
    np.maximum.at(highest, j, average_distance[i])
    peaks = np.flatnonzero(average_distance >= highest)
    peaks = peaks[np.argsort(-average_distance[peaks], kind="stable")]
    nearest = np.full(surface.n_vertices, np.inf)
    kept: list[int] = []
    for vertex in peaks[: len(peaks) * (limit > 0)]:
        if nearest[vertex] >= spacing:
            kept.append(int(vertex))
            engine.lower(nearest, int(vertex))
            if len(kept) == limit:
                break
    vertices = np.array(kept, dtype=np.int64)
    return vertices, engine.distances_from(vertices)
