"""Distances of pairs of points, at most at the cost of one column per distinct source."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MeshError, some
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.values.arrays import FloatArray

BLOCK = 64  # columns held at a time


def pair_distances(engine: DistanceEngine, pairs: ArrayLike) -> FloatArray:
    """Compute the distances of pairs of points.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of a space of n points.
    pairs : (m, 2) array_like of int
        Pairs (source, target).

    Returns
    -------
    (m,) array of float
        Distances; ``inf`` where no path leads.

    Raises
    ------
    MeshError
        If ``pairs`` has another shape or type, or names a point that does not exist.

    Notes
    -----
    One column per distinct source, 64 at a time: of the two ends, put the one with fewer distinct points first. An
    engine that has a method ``pair_distances``, as fast marching does, is asked directly: its fronts end early.

    Examples
    --------
    >>> from isomatch.geodesics import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    >>> pair_distances(distance_engine(line), [[0, 3], [2, 1]])
    array([3., 1.])
    """
    wanted = np.asarray(pairs)
    if wanted.ndim != 2 or wanted.shape[1] != 2 or wanted.dtype.kind not in "iu":
        raise MeshError(
            f"pairs have shape {wanted.shape} and type {wanted.dtype}, expected (m, 2) integers: two vertices each"
        )
    bad = wanted[((wanted < 0) | (wanted >= engine.n_points)).any(axis=1)].ravel()
    if len(bad):
        raise MeshError(
            f"pairs of vertices {some(bad)} leave 0…{engine.n_points - 1}, the vertices of the surface"
        )
    if hasattr(engine, "pair_distances"):
        measured: FloatArray = engine.pair_distances(wanted)
        return measured
    sources, of_pair = np.unique(wanted[:, 0], return_inverse=True)
    order = np.argsort(of_pair, kind="stable")
    distances = np.zeros(len(wanted))
    for first in range(0, len(sources), BLOCK):
        columns = engine.distances_from(sources[first : first + BLOCK])
        low, high = np.searchsorted(of_pair[order], [first, first + BLOCK])
        rows = order[low:high]
        distances[rows] = columns[of_pair[rows] - first, wanted[rows, 1]]
    return distances
