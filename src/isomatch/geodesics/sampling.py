"""Farthest point sampling that keeps what it computes: the samples and their distance columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.errors import MeshError, SettingError
from isomatch.geodesics.engines import DistanceEngine
from isomatch.surfaces import Mesh


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
    nearest = np.full(engine.n_points, np.inf)
    chosen = np.zeros(n_samples, dtype=np.int64)
    sample = start
    for i in range(n_samples):
        if i and not 0.0 < nearest[sample] < np.inf:
            reason = "some points cannot be reached" if nearest[sample] else f"only {i} points are distinct"
            raise MeshError(
                f"cannot place {n_samples} samples: {reason}; ask for fewer samples, or pass one component"
            )
        chosen[i] = sample
        engine.lower(nearest, sample)
        sample = int(nearest.argmax())
    return Sampling(chosen, engine.distances_from(chosen))


def peripheral_vertex(mesh: Mesh, engine: DistanceEngine, seed: int = 0) -> int:
    """Return a vertex at the far end of the surface that depends on its shape, not on the order of its vertices.

    From a vertex drawn by its rank in distance from the centroid, go to the farthest, and once more. Relabelling
    the vertices or moving the surface rigidly does not change the answer.
    """
    centre = np.average(mesh.vertices, axis=0, weights=mesh.vertex_areas)
    by_distance = np.argsort(np.linalg.norm(mesh.vertices - centre, axis=1), kind="stable")
    vertex = int(by_distance[np.random.default_rng(seed).integers(mesh.n_vertices)])
    for _ in range(2):
        distance = engine.distances_from(np.array([vertex]))[0]
        vertex = int(np.where(np.isfinite(distance), distance, -1.0).argmax())
    return vertex
