"""Functional maps and vertex maps, turned into one another.

A functional map F (k, k) carries functions of the target to the source: Φ_source F ≈ Φ_target[image].
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.linalg import polar

from isomatch._arrays import FloatArray, IntArray
from isomatch.matching.nearest import Coordinates, nearest_in_cells
from isomatch.matching.pair import Pair


def coordinates(pair: Pair, functional_map: FloatArray) -> Coordinates:
    """Φ_t Fᵀ and Φ_s, in which the image of a source vertex is the nearest target vertex."""
    k_source, k_target = functional_map.shape
    source, target = (side.shape.laplace.vectors for side in (pair.source, pair.target))
    return target[:, :k_target] @ functional_map.T, source[:, :k_source]


def from_points(pair: Pair, points: IntArray, k: int) -> FloatArray:
    """Least-squares functional map of the first k functions at corresponding points (q, 2), source and target."""
    return from_values(pair, points[:, 0], pair.target.shape.laplace.vectors[points[:, 1], :k])


def from_values(pair: Pair, rows: IntArray, values: FloatArray) -> FloatArray:
    """Least-squares functional map from the target's first k functions as seen at some source vertices, (q, k)."""
    functions = pair.source.shape.laplace.vectors[rows, : values.shape[1]]
    return np.asarray(np.linalg.lstsq(functions, values)[0], dtype=np.float64)


def upsampled(pair: Pair, functional_map: FloatArray, sizes: Iterable[int]) -> FloatArray:
    """Find images in the spectral domain, and from them a larger functional map, while the size grows.

    Images are found for the refinement vertices of the source only, among all vertices of the target. Melzi et al.,
    *ZoomOut: Spectral Upsampling for Efficient Surface Correspondence*, SIGGRAPH Asia 2019.
    """
    target = pair.target.shape.laplace.vectors
    for k in sizes:
        functional_map = pair.refinement.fit(target[images(pair, functional_map), :k], k)
    return functional_map


def icp(pair: Pair, functional_map: FloatArray, k: int, steps: int) -> FloatArray:
    """Alternate images in the spectral domain and the orthogonal map of k functions that fits them best.

    On the refinement vertices of the source until nothing changes, or for a number of steps; then once on all.
    """
    source, target = pair.source.shape.laplace, pair.target.shape
    functions = target.laplace.vectors[:, :k]
    image = np.zeros(0, dtype=np.int64)
    for _ in range(steps):
        previous, image = image, images(pair, functional_map)
        if np.array_equal(image, previous):
            break
        functional_map = polar(pair.refinement.fit(functions[image], k))[0]
    everywhere = nearest_in_cells(*coordinates(pair, functional_map), target.cells)
    return np.asarray(polar(source.coefficients(functions[everywhere], k))[0], dtype=np.float64)


def images(pair: Pair, functional_map: FloatArray) -> IntArray:
    """Target vertex of each refinement vertex of the source."""
    of_target, of_source = coordinates(pair, functional_map)
    return nearest_in_cells(of_target, of_source[pair.refinement.rows], pair.target.shape.cells)
