"""What helps to recognise a vertex beside its distances: extremities, and signatures that see inside from outside."""

from __future__ import annotations

import numba
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from isomatch._arrays import FloatArray, IntArray
from isomatch.bases import LaplaceBasis
from isomatch.descriptors import mean_curvature, standardised, wave_kernel_signature
from isomatch.geodesics import DistanceEngine
from isomatch.matching.nearest import Cells
from isomatch.surfaces import Mesh, Surface

SIGNATURE_FUNCTIONS = 100  # eigenfunctions in the wave kernel signature
SIGNATURE_STEP = 5  # every fifth of a hundred energies: neighbours overlap
CURVATURE_FUNCTIONS = (50, 100, 200)  # smoothness of the surfaces whose mean curvature is taken
SIGNATURE_WEIGHT, CURVATURE_WEIGHT = 0.6, 0.4


def extremal_points(
    mesh: Surface, engine: DistanceEngine, average_distance: FloatArray, spacing: float, limit: int
) -> tuple[IntArray, FloatArray]:
    """Tips of the surface: local maxima of the average geodesic distance, the most remote first.

    Parameters
    ----------
    mesh : Mesh, PointCloud or Graph
        The shape.
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
    i, j = mesh.edges.T
    highest = np.full(mesh.n_vertices, -np.inf)
    np.maximum.at(highest, i, average_distance[j])
    np.maximum.at(highest, j, average_distance[i])
    peaks = np.flatnonzero(average_distance >= highest)
    peaks = peaks[np.argsort(-average_distance[peaks], kind="stable")]
    nearest = np.full(mesh.n_vertices, np.inf)
    kept: list[int] = []
    for vertex in peaks:
        if nearest[vertex] >= spacing:
            kept.append(int(vertex))
            engine.lower(nearest, int(vertex))
            if len(kept) == limit:
                break
    vertices = np.array(kept, dtype=np.int64)
    return vertices, engine.distances_from(vertices)


def point_signatures(mesh: Mesh | None, laplace: LaplaceBasis) -> FloatArray:
    """Wave kernel signatures, and signed mean curvatures of a mesh, each column standardised by area: (n, 20 or 23).

    The logarithm of the signature evens out its scale. Signed curvature is the only part that tells a surface from
    its mirror image and a chest from a back.
    """
    wave = np.log(wave_kernel_signature(laplace, k=SIGNATURE_FUNCTIONS)[:, ::SIGNATURE_STEP])
    parts = [(wave, SIGNATURE_WEIGHT)]
    if mesh is not None:
        sizes = (min(k, len(laplace.values)) for k in CURVATURE_FUNCTIONS)
        parts.append((np.column_stack([mean_curvature(mesh, laplace, k) for k in sizes]), CURVATURE_WEIGHT))
    return np.hstack(
        [standardised(part, laplace.weights) * (weight / np.sqrt(part.shape[1])) for part, weight in parts]
    )


def spread_vertices(points: FloatArray, areas: FloatArray, count: int) -> IntArray:
    """Choose points (n, 3) evenly in space: Euclidean farthest points, from the one farthest from the centroid.

    A prefix of the result is as even as the whole. O(n count).
    """
    points = points - np.average(points, axis=0, weights=areas)
    chosen = np.zeros(min(count, len(points)), dtype=np.int64)
    chosen[0] = (points**2).sum(axis=1).argmax()
    _spread(points, chosen)
    return chosen


@numba.njit(cache=True, nogil=True)
def _spread(points: FloatArray, chosen: IntArray) -> None:  # pragma: no cover - compiled
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


def nearest_along_edges(shape: Surface, centres: IntArray) -> tuple[FloatArray, IntArray]:
    """Distance along edges from each vertex to the nearest of some, (n,), and which vertex that is, (n,)."""
    i, j = shape.edges.T
    lengths = np.maximum(shape.edge_lengths, 1e-300)
    graph = coo_array((lengths, (i, j)), shape=(shape.n_vertices,) * 2).tocsr()
    distance, _, nearest = dijkstra(
        graph, directed=False, indices=centres, min_only=True, return_predecessors=True
    )
    return distance, nearest


def surface_cells(shape: Surface, centres: IntArray) -> Cells:
    """Partition the vertices by the centre nearest along edges."""
    number = np.zeros(shape.n_vertices, dtype=np.int64)
    number[centres] = np.arange(len(centres))
    return Cells.of(centres, number[nearest_along_edges(shape, centres)[1]])
