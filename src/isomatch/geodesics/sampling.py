"""Farthest point sampling, by geodesic or by Euclidean distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError, SettingError
from isomatch._core.memory import require_memory
from isomatch._core.settings import generator
from isomatch._core.ties import TIE_RATIO, first_largest, first_of_rank
from isomatch.geodesics.engines import MetricSpace
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.surfaces import Mesh, PointCloud


@dataclass(frozen=True, eq=False)
class Sampling:
    """Samples of a surface, in the order in which they were chosen, with the geodesic distances from each."""

    vertices: IntArray  # the samples, (p,)
    columns: FloatArray  # distances (p, n) from sample a to every vertex in row a, in mesh units


def farthest_point_sampling(engine: DistanceEngine, n_samples: int, start: int) -> Sampling:
    """Choose each of p samples farthest from all before it, beginning with ``start``.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of a space of n points.
    n_samples : int
        p, at most n.
    start : int
        The first sample.

    Returns
    -------
    Sampling
        The p samples and their p × n distances.

    Raises
    ------
    SettingError
        If ``n_samples`` is not positive.
    MeshError
        If there are fewer than ``n_samples`` points at positive distance from each other, or some
        cannot be reached from ``start``.
    MemoryBudgetError
        If the columns would take more memory than allowed.

    Notes
    -----
    Eldar et al., *The farthest point strategy for progressive image sampling*, 1997, with geodesic
    distances. Time of p columns, O(p n log n) for fast marching, and 8 p n bytes.

    Examples
    --------
    >>> from isomatch import distance_engine
    >>> places = np.array([0.0, 1.0, 2.0, 7.0])
    >>> line = distance_engine(np.abs(places[:, None] - places))
    >>> sampling = farthest_point_sampling(line, 3, start=0)
    >>> sampling.vertices, sampling.columns[1]
    (array([0, 3, 2]), array([7., 6., 5., 0.]))

    Coincident points cannot both be samples.

    >>> farthest_point_sampling(distance_engine(np.zeros((2, 2))), 2, start=0)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.MeshError: cannot place 2 samples: only 1 points are distinct; ask for fewer samples, ...
    """
    if n_samples < 1:
        raise SettingError(f"n_samples = {n_samples} is not a positive number of samples")
    n_bytes = 8.0 * n_samples * engine.n_points
    require_memory(n_bytes, f"{n_samples} distance columns", "ask for fewer samples")
    # While samples are chosen, a front advances only where its sample is the nearest so far. The
    # cells of p samples have about n / p points each, so that sample i costs a front of n / i
    # points: Σ n / i ≈ n log p, about log p full fronts. The p full columns are then computed on
    # all threads. An engine that computes full columns anyway computes each only once.
    nearest = np.full(engine.n_points, np.inf)
    chosen = np.zeros(n_samples, dtype=np.int64)
    columns = []  # columns (n,) of the samples, if the engine computes full columns anyway
    sample = start
    for i in range(n_samples):
        if i and not 0.0 < nearest[sample] < np.inf:
            reason = "some points cannot be reached" if nearest[sample] else f"only {i} points are distinct"
            raise MeshError(
                f"cannot place {n_samples} samples: {reason}; ask for fewer samples, or pass one component"
            )
        chosen[i] = sample
        column = engine.lower(nearest, sample)
        if column is not None:
            columns.append(column)
        sample = first_largest(nearest)
    complete = len(columns) == n_samples
    return Sampling(chosen, np.array(columns) if complete else engine.distances_from(chosen))


def euclidean_farthest_points(points: FloatArray, n_samples: int, start: int) -> IntArray:
    """Choose from n points (n, d), first ``start``, then each farthest from all before it in Euclidean distance.

    Every prefix of the result is a farthest point sampling itself. Among equally far points the
    first is taken. O(n n_samples d) time.

    Raises
    ------
    SettingError
        If ``n_samples`` is not in 1…n, or ``start`` not in 0…n − 1.

    Examples
    --------
    >>> euclidean_farthest_points(np.array([[0.0], [1.0], [5.0], [2.0]]), 3, start=0)
    array([0, 2, 3])
    """
    n = len(points)
    if not 1 <= n_samples <= n:
        raise SettingError(f"n_samples = {n_samples} must lie in 1…{n}, the number of points")
    if not 0 <= start < n:
        raise SettingError(f"start = {start} must lie in 0…{n - 1}, the points")
    chosen = np.zeros(n_samples, dtype=np.int64)
    chosen[0] = start
    _fill_with_farthest(
        np.array(points, dtype=np.float64, order="C"), chosen, np.full(n, np.inf), 2 * TIE_RATIO
    )
    return chosen


@compiled()
def _fill_with_farthest(points: FloatArray, chosen: IntArray, nearest: FloatArray, tie: float) -> None:
    """Fill ``chosen`` after its first entry; ``nearest`` (n,), squared distances, is all inf on entry."""
    farthest = chosen[0]
    for i in range(len(chosen)):
        last = chosen[i] = farthest
        nearest[last] = -1.0  # below the distance 0 of coincident points, so that no point is chosen twice
        largest = 0.0
        for j in range(len(points)):
            squared = 0.0
            for axis in range(points.shape[1]):
                squared += (points[j, axis] - points[last, axis]) ** 2
            if squared < nearest[j]:
                nearest[j] = squared
            largest = max(largest, nearest[j])
        for j in range(len(points)):
            if nearest[j] >= largest - tie * largest:
                farthest = j
                break


def peripheral_vertex(surface: MetricSpace, engine: DistanceEngine, seed: int = 0) -> int:
    """Return a vertex at one end of the surface, chosen by the shape; the order of the vertices only decides ties.

    From a vertex drawn by ``seed`` it goes to the farthest one, and from there to the farthest
    again; two columns.
    """
    # The first vertex is drawn by its rank in distance from the centroid, so that the answer does
    # not change when vertices are relabelled or the surface is moved rigidly. In a graph or a
    # matrix, without coordinates, it is drawn by its index.
    vertex = int(generator(seed).integers(engine.n_points))
    if isinstance(surface, Mesh | PointCloud):
        shares = surface.vertex_areas / surface.area if 0 < surface.area < np.inf else None
        centre = np.average(surface.vertices, axis=0, weights=shares)
        remoteness = np.linalg.norm(surface.vertices - centre, axis=1)
        vertex = first_of_rank(remoteness, vertex)
    for _ in range(2):
        distance = engine.distances_from(np.array([vertex]))[0]
        vertex = first_largest(np.where(np.isfinite(distance), distance, -1.0))
    return vertex
