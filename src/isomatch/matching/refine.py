"""From a map on a few hundred vertices to a precise one on all of them."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.matching.alignment import icp, orthogonal_alignment
from isomatch.matching.nearest import nearest_in_cells
from isomatch.matching.pair import Glimpse, Pair
from isomatch.matching.prepare import PreparedShape
from isomatch.surfaces.mesh import vertex_normals

LAPLACE_FUNCTIONS = 100
LAPLACE_STEPS = 10
DISTANCE_STEPS = 15
COARSE_SIZES = (20, 40, 70, 100, 140)  # functions in the steps without coordinates
FINE_SIZES = (50, 75, 100, 125, 150, 200)  # and with them
POSITION_UNIT = 0.08  # misfit of positions, in √area, that counts like one of the spectral coordinates
NORMAL_WEIGHT = 0.3


Coordinates = tuple[FloatArray, FloatArray]
"""Of all target and all source body vertices, in one space: images are nearest neighbours."""


def by_distances(pair: Pair, image: IntArray) -> Coordinates:
    """Align distance descriptors on the search vertices, then once on all: the paper's plain method.

    ``image`` (m_s,) holds the target row of each search vertex of the source.
    """
    source, target = pair.source.shape, pair.target.shape
    at_target, at_source = target.cloud.at(pair.target.rows), source.cloud.at(pair.source.rows)
    rotation = icp(at_target, at_source, image, DISTANCE_STEPS).rotation
    full = nearest_in_cells(target.cloud.points @ rotation, source.cloud.points, target.cells)
    rotation = orthogonal_alignment(target.cloud.at(full), source.cloud)
    return target.cloud.points @ rotation, source.cloud.points


def by_laplace_icp(pair: Pair, start: Coordinates) -> Coordinates:
    """Post-process by iterative closest points in the Laplace–Beltrami basis, from a map given by coordinates.

    Ten steps with 100 functions on ``n_refine`` source vertices, F kept orthogonal.

    Notes
    -----
    Shamai & Kimmel 2017, section on post-processing; Ovsjanikov et al. 2012.
    """
    glimpse, target = _refinement_rows(pair), pair.target.shape
    k = min(LAPLACE_FUNCTIONS, glimpse.functions.shape[1], len(target.laplace.values))
    phi_target = target.laplace.vectors[:, :k]
    rows = nearest_in_cells(start[0], start[1][glimpse.rows], target.cells)
    for _ in range(LAPLACE_STEPS):
        turned = phi_target @ _orthogonal(glimpse.fit(phi_target[rows], k)).T
        previous, rows = rows, nearest_in_cells(turned, glimpse.functions[:, :k], target.cells)
        if (previous == rows).all():
            break
    turned = phi_target @ _orthogonal(glimpse.fit(phi_target[rows], k)).T
    return turned, glimpse.shape.laplace.vectors[:, :k]


def _refinement_rows(pair: Pair) -> Glimpse:
    shape = pair.source.shape
    return Glimpse(shape, shape.spread[: shape.config.n_refine])


def _orthogonal(matrix: FloatArray) -> FloatArray:
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ v, dtype=np.float64)


def extended(pair: Pair, image: IntArray, rows: IntArray) -> IntArray:
    """Extend a map of the search vertices, through 50 functions, to other source body vertices: target body vertices."""
    source, target = pair.source.shape, pair.target.shape
    k = min(50, len(source.laplace.values), len(target.laplace.values))
    functional_map = pair.functional_map(image, k)
    turned = target.laplace.vectors[:, :k] @ functional_map.T
    return nearest_in_cells(turned, source.laplace.vectors[rows, :k], target.cells)


def extended_at(pair: Pair, image: IntArray, mesh_vertices: IntArray) -> IntArray:
    """Do the same for source vertices in the user's indices; −1 for those off the body."""
    rows = pair.source.shape.body_vertex[mesh_vertices]
    return np.where(rows >= 0, extended(pair, image, np.maximum(rows, 0)), -1)


def jointly(pair: Pair, image: IntArray) -> Coordinates:
    """Spectral upsampling joint with signatures, coordinates and normals.

    In each step the target's functions *and coordinates* are fitted on the source by least squares over the source's
    refinement vertices, F and c; the next images are nearest neighbours, among all target vertices, in

    - the spectral coordinates Φ_t Fᵀ against Φ_s, divided by √k,
    - point signatures,
    - positions: the smooth target against the copy of it drawn on the source, Φ_s c,
    - normals of both.

    Positions and normals are those of the target and of its own copy, so the pose of either shape does not matter.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    image : (m_s,) array of int
        Target row of each search vertex of the source.

    Notes
    -----
    O(n_t n_refine (K + q)) a step.
    """
    target, glimpse = pair.target.shape, _refinement_rows(pair)
    rows = extended(pair, image, glimpse.rows)
    limit = min(glimpse.functions.shape[1], len(target.laplace.values))
    schedule = [(k, False) for k in COARSE_SIZES] + [(k, True) for k in FINE_SIZES]
    for k, geometric in schedule:
        if k <= limit:
            coordinates = _joint_coordinates(glimpse, target, rows, k, geometric, glimpse.rows)
            rows = nearest_in_cells(*coordinates, target.cells)
    everywhere = np.arange(glimpse.shape.body.n_vertices)
    return _joint_coordinates(glimpse, target, rows, limit, True, everywhere)


def _joint_coordinates(
    glimpse: Glimpse, target: PreparedShape, image: IntArray, k: int, geometric: bool, wanted: IntArray
) -> Coordinates:
    """Coordinates of all target vertices and of the wanted source vertices."""
    source = glimpse.shape
    phi_target = target.laplace.vectors[:, :k]
    fitted = glimpse.fit(np.hstack([phi_target[image], target.body.vertices[image]]), k)
    functional_map, copy = fitted[:, :k], fitted[:, k:]
    of_target = [phi_target @ functional_map.T / np.sqrt(k), target.signatures]
    of_source = [source.laplace.vectors[wanted, :k] / np.sqrt(k), source.signatures[wanted]]
    if geometric:
        smooth = target.laplace.low_passed(target.body.vertices, k)
        drawn = source.laplace.vectors[:, :k] @ copy
        of_target += [smooth / POSITION_UNIT, NORMAL_WEIGHT * vertex_normals(smooth, target.body.faces)]
        normals = vertex_normals(drawn, source.body.faces)[wanted]
        of_source += [drawn[wanted] / POSITION_UNIT, NORMAL_WEIGHT * normals]
    return np.hstack(of_target), np.hstack(of_source)
