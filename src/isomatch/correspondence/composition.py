"""Composition and inversion of maps at precise points; images never average across a tear or jump to another sheet."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence.checked_map import UNMATCHED
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.resolution import PlacedMesh, VertexGroups, normalised
from isomatch.surfaces import Mesh, PrecisePoints, Surface
from isomatch.values.arrays import BoolArray, IntArray

TORN = 4.0  # times the usual stretch of an edge by a map: more is a tear


def composed(
    vertices: IntArray,
    points: PrecisePoints,
    image: IntArray,
    there: PrecisePoints,
    middle: Mesh | None,
    target: Mesh | None,
) -> tuple[IntArray, PrecisePoints]:
    """Map the images under one map by another; see `Correspondence.then`.

    Parameters
    ----------
    vertices : (n,) array of int
        Middle vertex of each source vertex.
    points : PrecisePoints
        The same, as n precise images.
    image : (m,) array of int
        Target vertex of each middle vertex.
    there : PrecisePoints
        The same, as m precise images.
    middle, target : Mesh, optional
        Both or neither.

    Returns
    -------
    (n,) array of int, PrecisePoints
        Target vertex of each source vertex, and n precise images.
    """
    by_weight = np.argsort(-points.barycentric, axis=1, kind="stable")
    corners = np.take_along_axis(points.corners, by_weight, axis=1)
    weights = np.take_along_axis(points.barycentric, by_weight, axis=1)
    nearest = corners[:, 0]
    target_vertex = np.where(vertices >= 0, image[nearest], UNMATCHED)
    faces, barycentric = there.corners[nearest], there.barycentric[nearest]
    weights = np.where((image >= 0)[corners], weights, 0.0)
    inside = np.flatnonzero((target_vertex >= 0) & (weights[:, 1:] > 0).any(axis=1))
    weights = weights[inside] / weights[inside].sum(axis=1, keepdims=True)
    between = PrecisePoints(corners[inside], weights)
    precise, changed = (
        composed_in_faces(between, there)
        if middle is None or target is None
        else composed_on_surface(between, there, middle, target)
    )
    rows = inside[changed]
    faces[rows], barycentric[rows] = (part[changed] for part in precise)
    target_vertex[rows] = faces[rows, barycentric[rows].argmax(axis=1)]
    return target_vertex, PrecisePoints(faces, barycentric)


def composed_in_faces(points: PrecisePoints, there: PrecisePoints) -> tuple[PrecisePoints, BoolArray]:
    """Compose exactly where the images of all corners of a point lie in one triangle: m points, and which they are.

    Parameters
    ----------
    points : PrecisePoints
        m points.
    there : PrecisePoints
        The image of each vertex.
    """
    m = len(points.corners)
    corners = there.corners[points.corners]  # (m, 3, 3)
    weights = (there.barycentric[points.corners] * points.barycentric[:, :, None]).reshape(m, 9)
    composed_points = PrecisePoints.at_vertices(np.full(m, -1))
    inside = np.zeros(m, dtype=bool)
    for k in range(3):
        same = corners.reshape(m, 9, 1) == corners[:, None, k]  # (m, 9, 3)
        new = ~inside & (same.any(axis=2) | (weights == 0)).all(axis=1)
        first_same = same & (same.cumsum(axis=2) == 1)
        composed_points.corners[new] = corners[new, k]
        composed_points.barycentric[new] = np.einsum("ma,mac->mc", weights[new], first_same[new])
        inside |= new
    return composed_points, inside


def composed_on_surface(
    points: PrecisePoints, there: PrecisePoints, middle: Mesh, target: Mesh
) -> tuple[PrecisePoints, BoolArray]:
    """Interpolate the images of the corners of m points in space, and take the nearest point of the target.

    Corners that the map tears from the first one are left out. The second result tells which of the m points have more
    than one corner left.
    """
    positions, _, _ = normalised(target.vertices)
    images = there.interpolated(positions)
    apart, stretched = (
        np.linalg.norm(x[points.corners] - x[points.corners[:, :1]], axis=2)
        for x in (normalised(middle.vertices)[0], images)
    )
    used = (points.barycentric > 0) & (apart > 0)
    usual = np.median(stretched[used] / apart[used]) if used.any() else 0.0
    near = used & (stretched <= TORN * usual * apart)
    near[:, 0] = True
    weights = np.where(near, points.barycentric, 0.0)
    between = PrecisePoints(points.corners, weights / weights.sum(axis=1, keepdims=True))
    groups = VertexGroups.of(np.arange(target.n_vertices), target.n_vertices)
    start = there.corners[points.corners].reshape(-1, 9)
    start = np.where(start < 0, start[:, :1], start)
    composed_points = PlacedMesh(target, positions, groups).inverse(between.interpolated(images), start)
    return composed_points, near[:, 1:].any(axis=1)


def inverse(
    image: IntArray, there: PrecisePoints, source: Surface, target: Surface, within: float
) -> tuple[PrecisePoints, BoolArray]:
    """Find the point of the source whose image is nearest to each vertex of the target, and which vertices have one.

    The search starts from the source vertices mapped to the target vertex nearest along edges.
    """
    matched = image >= 0
    n = target.n_vertices
    if not matched.any():
        return PrecisePoints.at_vertices(np.full(n, -1)), np.zeros(n, dtype=bool)
    gap, near = distance_along_edges_to_nearest(target, np.unique(image[matched]), weld=True)
    reached = gap <= within * np.sqrt(target.area)
    groups = VertexGroups.of(image, n)
    preimages = PrecisePoints.at_vertices(np.where(reached, groups.members[groups.start[near * reached]], -1))
    if isinstance(source, Mesh) and isinstance(target, Mesh):
        positions, _, _ = normalised(target.vertices)
        places = np.full((len(image), 3), np.nan)
        places[matched] = there.interpolated(positions)[matched]
        exact = PlacedMesh(source, places, groups).inverse(positions[reached], near[reached, None])
        preimages.corners[reached], preimages.barycentric[reached] = exact
    return preimages, reached
