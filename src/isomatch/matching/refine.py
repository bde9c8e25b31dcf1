"""From a map on a few hundred vertices to a precise one on all of them."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.matching.alignment import icp, orthogonal_alignment
from isomatch.matching.nearest import nearest_rows
from isomatch.matching.pair import Glimpse, Pair
from isomatch.matching.prepare import PreparedShape
from isomatch.surfaces.mesh import vertex_normals

LAPLACE_FUNCTIONS = 100
LAPLACE_STEPS = 10
DISTANCE_STEPS = 15
COARSE_SIZES = (20, 40, 60, 80, 100, 120, 140)  # functions in the steps without coordinates
FINE_SIZES = (40, 60, 80, 100, 120, 140, 160, 180, 200)  # and with them
POSITION_UNIT = 0.08  # misfit of positions, in √area, that counts like one of the spectral coordinates
NORMAL_WEIGHT = 0.3


def by_distances(pair: Pair, image: IntArray) -> IntArray:
    """Align distance descriptors on the search vertices, then once and again on all: the paper's plain method.

    Returns the target body vertex of every source body vertex.
    """
    source, target = pair.source.shape, pair.target.shape
    rotation = icp(pair.target.cloud, pair.source.cloud, image, DISTANCE_STEPS).rotation
    full = nearest_rows(target.cloud.points @ rotation, source.cloud.points)
    rotation = orthogonal_alignment(target.cloud.at(full), source.cloud)
    return nearest_rows(target.cloud.points @ rotation, source.cloud.points)


def by_laplace_icp(source: PreparedShape, target: PreparedShape, image: IntArray) -> IntArray:
    """Post-process a full map by iterative closest points in the Laplace–Beltrami basis.

    Parameters
    ----------
    source, target : PreparedShape
        The shapes.
    image : (n_s,) array of int
        Target body vertex of every source body vertex.

    Returns
    -------
    (n_s,) array of int
        The map after ten steps with 100 functions on ``n_refine`` source vertices, then one on all.

    Notes
    -----
    Shamai & Kimmel 2017, section on post-processing; Ovsjanikov et al. 2012. F is kept orthogonal.
    """
    k = min(LAPLACE_FUNCTIONS, len(source.laplace.values), len(target.laplace.values))
    glimpse = Glimpse(source, source.spread[: source.config.n_refine])
    phi_target = target.laplace.vectors[:, :k]
    rows = image[glimpse.rows]
    for _ in range(LAPLACE_STEPS):
        turned = phi_target @ _orthogonal(glimpse.fit(phi_target[rows], k)).T
        previous, rows = rows, nearest_rows(turned, glimpse.functions[:, :k])
        if (previous == rows).all():
            break
    turned = phi_target @ _orthogonal(glimpse.fit(phi_target[rows], k)).T
    return nearest_rows(turned, source.laplace.vectors[:, :k])


def _orthogonal(matrix: FloatArray) -> FloatArray:
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ v, dtype=np.float64)


def extended(pair: Pair, image: IntArray, rows: IntArray) -> IntArray:
    """Extend a map of the search vertices, through 50 functions, to other source body vertices: target body vertices."""
    source, target = pair.source.shape, pair.target.shape
    k = min(50, len(source.laplace.values), len(target.laplace.values))
    functional_map = pair.functional_map(image, k)
    return nearest_rows(
        target.laplace.vectors[:, :k] @ functional_map.T, source.laplace.vectors[rows, :k]
    )


def extended_at(pair: Pair, image: IntArray, mesh_vertices: IntArray) -> IntArray:
    """Same for source vertices in the user's indices; −1 for those off the body."""
    rows = pair.source.shape.body_vertex[mesh_vertices]
    return np.where(rows >= 0, extended(pair, image, np.maximum(rows, 0)), -1)


def jointly(pair: Pair, image: IntArray) -> IntArray:
    """Spectral upsampling joint with signatures, coordinates and normals.

    In each step the target's functions *and coordinates* are fitted on the source by least squares over the source's
    refinement vertices, F and c; the next images are nearest neighbours, among all target vertices, in

    - the spectral coordinates Φ_t Fᵀ against Φ_s, divided by √k,
    - point signatures,
    - positions: the smooth target against the copy of it drawn on the source, Φ_s c,
    - normals of both.

    Positions and normals are those of the target and of its own copy, so the pose of either shape does not matter.

    Returns
    -------
    (n_s,) array of int
        Target body vertex of every source body vertex. O(n_t n_s (K + q)) for the last step.
    """
    source, target = pair.source.shape, pair.target.shape
    glimpse = Glimpse(source, source.spread[: source.config.n_refine])
    rows = extended(pair, image, glimpse.rows)
    limit = min(len(source.laplace.values), len(target.laplace.values))
    schedule = [(k, False) for k in COARSE_SIZES] + [(k, True) for k in FINE_SIZES]
    for k, geometric in schedule:
        of_target, of_source = _joint_coordinates(glimpse, target, rows, min(k, limit), geometric)
        rows = nearest_rows(of_target, of_source[glimpse.rows])
    of_target, of_source = _joint_coordinates(glimpse, target, rows, limit, True)
    return nearest_rows(of_target, of_source)


def _joint_coordinates(
    glimpse: Glimpse, target: PreparedShape, image: IntArray, k: int, geometric: bool
) -> tuple[FloatArray, FloatArray]:
    """Coordinates of all target and all source vertices in which the next images are nearest neighbours."""
    source = glimpse.shape
    phi_target, phi_source = target.laplace.vectors[:, :k], source.laplace.vectors[:, :k]
    fitted = glimpse.fit(np.hstack([phi_target[image], target.body.vertices[image]]), k)
    functional_map, copy = fitted[:, :k], fitted[:, k:]
    of_target = [phi_target @ functional_map.T / np.sqrt(k), target.signatures]
    of_source = [phi_source / np.sqrt(k), source.signatures]
    if geometric:
        smooth, drawn = target.laplace.low_passed(target.body.vertices, k), phi_source @ copy
        of_target += [smooth / POSITION_UNIT, NORMAL_WEIGHT * vertex_normals(smooth, target.body.faces)]
        of_source += [drawn / POSITION_UNIT, NORMAL_WEIGHT * vertex_normals(drawn, source.body.faces)]
    return np.hstack(of_target), np.hstack(of_source)
