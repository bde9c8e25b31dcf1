"""Gaps that are meant to be closed: vertices that nearly coincide, and T-junctions, where a vertex lies on an edge."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.io import Asset, Polygons, Renumbering
from isomatch.surfaces import label_components

ON_SIDE_RATIO = 1e-3  # largest distance of a vertex from its side, over the side's length; chosen
SIDE_END_SHARE = 1e-2  # least distance of an inserted vertex from the side's ends, over its length; chosen
# Close vertices nearly coincide only if the shortest side of the boundary, over the largest distance between two
# close vertices, is at least this; chosen.
MIN_GAP_RATIO = 3.0
# Two boundary vertices are close if their distance, over the median length of the boundary's sides, is at most
# this; chosen.
MAX_CLOSE_RATIO = 0.3
# Close vertices nearly coincide only if they are at least this share of the boundary vertices, and this many;
# fewer might be close by chance; chosen.
MIN_CLOSE_SHARE, MIN_CLOSE_VERTICES = 0.05, 4
# The first quantile of the lengths of the boundary's sides is taken as the shortest side. If the largest
# distance between close vertices is too large for `MIN_GAP_RATIO`, the second quantile of these distances
# replaces it. Both leave out single exceptions; chosen.
SHORT_SIDE_QUANTILE, CLOSE_DISTANCE_QUANTILE = 0.02, 0.95
# A piece of a side is halved if more points than this are near it, unless it is at most this share of the
# side; chosen for speed.
MAX_POINTS_NEAR_PIECE, MIN_PIECE_SHARE = 16, 1 / 64
# number of pairs of a side and a point near it that are compared at once, which bounds the memory; chosen
POINTS_AT_ONCE = 2**22
# number of boundary vertices nearest to a vertex, itself included, among which one is sought that shares no side
# with the vertex; chosen
N_NEIGHBOURS = 8


class Sides(NamedTuple):
    """Sides of polygons: the corner at which each begins, (s,), and its ends, (s, 2)."""

    corners: IntArray
    ends: IntArray


NO_SIDES = Sides(np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.int64))  # an empty set of sides


class TJunctions(NamedTuple):
    """Points (q,) on sides of polygons: the corner where each side begins, and the place on it, 0 to 1."""

    points: IntArray
    corners: IntArray
    shares: FloatArray


def close_vertices(positions: FloatArray, sides: IntArray) -> tuple[IntArray, float]:
    """Find boundary vertices that nearly coincide, and the largest distance at which they do, or nan."""
    # For each vertex, the distance from the nearest vertex without a common side is compared with the lengths
    # of sides. If many distances are far below all lengths, the tolerance is the geometric mean of the largest
    # of these distances and the shortest side.
    nothing_found = np.zeros(0, dtype=np.int64), np.nan
    vertices = np.unique(sides)
    if len(vertices) < MIN_CLOSE_VERTICES:
        return nothing_found
    points, rows = positions[vertices], np.searchsorted(vertices, sides)
    distances, neighbours = cKDTree(points).query(points, min(N_NEIGHBOURS, len(points)))
    joined = np.concatenate([rows[:, 0] * len(points) + rows[:, 1], rows[:, 1] * len(points) + rows[:, 0]])
    keys = np.arange(len(points))[:, None] * len(points) + neighbours
    distances[np.isin(keys, joined) | (neighbours == np.arange(len(points))[:, None])] = np.inf
    nearest = distances.min(axis=1)
    lengths = np.linalg.norm(points[rows[:, 0]] - points[rows[:, 1]], axis=1)
    small = nearest[nearest <= MAX_CLOSE_RATIO * np.median(lengths)]
    if len(small) < max(MIN_CLOSE_VERTICES, MIN_CLOSE_SHARE * len(vertices)):
        return nothing_found
    smallest = float(np.quantile(lengths, SHORT_SIDE_QUANTILE))
    candidates = (small.max(), np.quantile(small, CLOSE_DISTANCE_QUANTILE))
    largest = next((x for x in candidates if smallest >= MIN_GAP_RATIO * x), None)
    if largest is None:
        return nothing_found
    tolerance = float(np.sqrt(largest * smallest))
    return vertices[nearest <= tolerance], tolerance


def first_within(points: FloatArray, tolerance: float) -> IntArray:
    """Find, for each point (n, 3), the first point that steps of at most the tolerance lead to, (n,)."""
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    pairs = finite[cKDTree(points[finite]).query_pairs(tolerance, output_type="ndarray")]
    count, group = label_components(len(points), (pairs[:, 0], pairs[:, 1]))
    first = np.full(count, len(points))
    np.minimum.at(first, group, np.arange(len(points)))
    return np.asarray(first[group])


def t_junctions(points: FloatArray, polygons: Polygons, survivor: IntArray, free: Sides) -> TJunctions:
    """Find the points on free sides of polygons; ``survivor`` (n,) is what each point is welded onto."""
    corners, sides = free
    finite = np.isfinite(points[sides]).all(axis=(1, 2))
    corners, sides = corners[finite], sides[finite]
    vertices = np.unique(sides)
    if not len(vertices):
        return TJunctions(*(np.zeros(0, dtype=np.int64),) * 2, np.zeros(0))
    scaled = np.zeros_like(points)  # coordinates whose squares do not overflow
    scaled[vertices] = points[vertices] / (np.abs(points[vertices]).max() or 1.0)
    side, near, share = _find_on_sides(scaled[vertices], *scaled[sides.T])
    vertex = vertices[near]
    # A point is not inserted again if it is a corner of the polygon already.
    polygon_of, n = polygons.of_corner, len(points)
    in_range = (polygons.corners >= 0) & (polygons.corners < n)
    welded_corners = np.where(in_range, survivor[polygons.corners.clip(0, n - 1)], n)
    new = ~np.isin(polygon_of[corners[side]] * (n + 1) + vertex, polygon_of * (n + 1) + welded_corners)
    order = np.lexsort([share[new], corners[side[new]]])
    return TJunctions(vertex[new][order], corners[side[new]][order], share[new][order])


def _find_on_sides(
    points: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Find the points (n, 3) on the middle of sides: the side, the point, and the place on the side."""
    # Points are sought in balls around pieces of sides; pieces near many points are halved.
    tree, span = cKDTree(points), end - start
    lengths = np.linalg.norm(span, axis=1)
    side, low = np.arange(len(start)), np.full(len(start), SIDE_END_SHARE)
    high = 1 - low
    found, shares = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    while len(side):
        middle = (low + high) / 2
        centres = start[side] + middle[:, None] * span[side]
        radii = ((high - low) / 2 + ON_SIDE_RATIO) * lengths[side]
        counts = tree.query_ball_point(centres, radii, return_length=True)
        few = (counts <= MAX_POINTS_NEAR_PIECE) | (high - low <= MIN_PIECE_SHARE)
        held = np.flatnonzero(few & (counts > 0))
        # The sides are taken in blocks, as lists of points take much memory.
        for rows in np.array_split(held, 1 + counts[held].sum() // POINTS_AT_ONCE):
            lists = tree.query_ball_point(centres[rows], radii[rows])
            near = np.concatenate([*lists, []]).astype(np.int64)
            owner = np.repeat(side[rows], counts[rows])
            from_start = points[near] - start[owner]
            squared = np.maximum(lengths[owner] ** 2, np.finfo(float).tiny)
            share = np.einsum("ij,ij->i", from_start, span[owner]) / squared
            offset = np.linalg.norm(from_start - share[:, None] * span[owner], axis=1)
            is_between = (share > SIDE_END_SHARE) & (share < 1 - SIDE_END_SHARE)
            inside = (offset <= ON_SIDE_RATIO * lengths[owner]) & is_between
            found.append(owner[inside] * len(points) + near[inside])
            shares.append(share[inside])
        side, low, high, middle = (np.tile(bounds[~few], 2) for bounds in (side, low, high, middle))
        half = np.arange(len(side)) < len(side) // 2
        low, high = np.where(half, low, middle), np.where(half, middle, high)
    pairs, first = np.unique(np.concatenate(found), return_index=True)
    return pairs // max(len(points), 1), pairs % max(len(points), 1), np.concatenate(shares)[first]


def free_sides(polygons: Polygons, survivor: IntArray, is_sound: BoolArray | None = None) -> Sides:
    """Find the sides that belong to only one of the sound polygons (p,), after welding."""
    corners, n = polygons.corners, len(survivor)
    inside = (corners >= 0) & (corners < n)
    ends = np.cumsum(polygons.sizes)
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = ends - polygons.sizes
    welded = survivor[np.where(inside, corners, 0)] if n else corners
    sides = np.column_stack([welded, welded[following]])
    low, high = sides.min(axis=1), sides.max(axis=1)
    counts = inside & inside[following] & (low != high)
    if is_sound is not None:
        counts &= is_sound[polygons.of_corner]
    rows = np.flatnonzero(counts)
    _, edge, count = np.unique(low[rows] * n + high[rows], return_inverse=True, return_counts=True)
    rows = rows[count[edge] == 1]
    return Sides(rows, sides[rows])


def insert_t_junctions(asset: Asset, survivor: IntArray, is_sound: BoolArray) -> tuple[Asset, BoolArray]:
    """Insert points into the sides they lie on until none is left; return also which (n,) were inserted."""
    inserted = np.zeros(len(asset.points), dtype=bool)
    # The rounds end, because each round gives a polygon a new point.
    while True:
        free = free_sides(asset.polygons, survivor, is_sound)
        found = t_junctions(asset.placed_points, asset.polygons, survivor, free)
        if not len(found.points):
            return asset, inserted
        asset = _insert_points(asset, found)
        inserted[found.points] = True


def _insert_points(asset: Asset, found: TJunctions) -> Asset:
    """Insert points into the sides they lie on, and interpolate the values of corners there."""
    polygons = asset.polygons
    owner = polygons.of_corner[found.corners]
    place = found.corners + 1
    corners = np.insert(polygons.corners, place, found.points)
    index = np.insert(np.arange(len(polygons.corners)), place, found.corners)
    sizes = polygons.sizes + np.bincount(owner, minlength=len(polygons))
    all_points = np.arange(len(asset.points))
    divided = Polygons(corners, sizes, asset.points)
    rows = Renumbering(all_points, all_points, divided, np.arange(len(sizes)), index)
    new = place + np.arange(len(place))
    ends = np.cumsum(polygons.sizes)
    following = np.where(place == ends[owner], ends[owner] - polygons.sizes[owner], place)
    mended = asset.renumbered(rows)
    attributes = []
    for before, after in zip(asset.attributes, mended.attributes):
        if before.domain == "corner" and before.values.dtype.kind == "f":
            share = found.shares.reshape(-1, *(1,) * (before.values.ndim - 1))
            values = after.values.copy()
            values[new] = (1 - share) * before.values[found.corners] + share * before.values[following]
            after = after.with_values(values)
        attributes.append(after)
    return replace(mended, attributes=tuple(attributes))
