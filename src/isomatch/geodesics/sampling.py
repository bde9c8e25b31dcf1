"""Farthest point sampling that keeps what it computes: the samples and their distance columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch._memory import require_memory
from isomatch.errors import MeshError, SettingError
from isomatch.geodesics.engines import MetricSpace
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.surfaces import Mesh, PointCloud


@dataclass(frozen=True, eq=False)
class Sampling:
    """Samples of a surface with the geodesic distances from each.

    Parameters
    ----------
    vertices : (p,) array of int
        The samples, in the order in which they were chosen.
    columns : (p, n) array of float
        ``columns[a]`` holds the distances from sample a to every vertex, in mesh units.
    """

    vertices: IntArray
    columns: FloatArray


def farthest_point_sampling(engine: DistanceEngine, n_samples: int, start: int) -> Sampling:
    """Choose each sample farthest from all before it, beginning with ``start``.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of a space of n points.
    n_samples : int
        Number p of samples; at most n.
    start : int
        The first sample.

    Returns
    -------
    Sampling
        The p samples and their p × n distances.

    Raises
    ------
    MeshError
        If there are fewer than ``n_samples`` points at positive distance from each other, or some cannot be
        reached from ``start``.

    Notes
    -----
    While samples are chosen, a front advances only where its sample is the nearest so far, which costs about
    log p full fronts; the p full columns then follow on all threads.
    """
    if n_samples < 1:
        raise SettingError(f"n_samples = {n_samples} is not a positive number of samples")
    require_memory(
        8.0 * n_samples * engine.n_points, f"{n_samples} distance columns", "ask for fewer samples"
    )
    nearest = np.full(engine.n_points, np.inf)
    chosen = np.zeros(n_samples, dtype=np.int64)
    columns = []  # of engines whose fronts do not stop early
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
        sample = int(nearest.argmax())
    complete = len(columns) == n_samples
    return Sampling(chosen, np.array(columns) if complete else engine.distances_from(chosen))


def peripheral_vertex(surface: MetricSpace, engine: DistanceEngine, seed: int = 0) -> int:
    """Return a vertex at the far end of the surface that depends on its shape, not on the order of its vertices.

    From a vertex drawn by its rank in distance from the centroid, go to the farthest, and once more. Relabelling
    the vertices or moving the surface rigidly does not change the answer. Where there are no coordinates, as in a
    graph or a matrix, the draw is among the vertices as they are numbered, and the answer may depend on that.
    """
    vertex = int(np.random.default_rng(seed).integers(engine.n_points))
    if isinstance(surface, Mesh | PointCloud):
        centre = np.average(surface.vertices, axis=0, weights=surface.vertex_areas)
        vertex = int(np.argsort(np.linalg.norm(surface.vertices - centre, axis=1), kind="stable")[vertex])
    for _ in range(2):
        distance = engine.distances_from(np.array([vertex]))[0]
        vertex = int(np.where(np.isfinite(distance), distance, -1.0).argmax())
    return vertex
