"""Gaps that are meant to be closed: vertices that nearly coincide, and T-junctions, where a vertex lies on an edge."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.io import Asset, Polygons, Renumbering
from isomatch.surfaces import linked

ON_EDGE = 1e-3  # of the edge: a vertex this near to it lies on it
END = 1e-2  # share of an edge next to its ends where no vertex is inserted
GAP = 3.0  # ratio of distances that tells vertices that nearly coincide from others
NEAR = 0.3  # of the median side: above, distances are those of a surface
LEAST_SHARE, FEWEST = 0.05, 4  # of the vertices of the boundary, and vertices, that nearly coincide
# quantiles of the lengths of sides, and of the small distances, where single ones fill the gap
SHORT, MOST = 0.02, 0.95
# points near a piece of a side that are looked at one by one, the shortest piece, and points at once
MOST_NEAR, PIECE, AT_ONCE = 16, 1 / 64, 2**22
N_NEAREST = 8  # vertices among which one is sought that no side joins


class Sides(NamedTuple):
    """Sides of polygons: the corner at which each begins, (s,), and its ends, (s, 2)."""

    corners: IntArray
    ends: IntArray


NO_SIDES = Sides(np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.int64))


class Loose(NamedTuple):
    """Vertices that nearly coincide with others, and the distance that tells them from others; nan without any."""

    vertices: IntArray
    tolerance: float


class TJunctions(NamedTuple):
    """Points (q,) that lie on sides of polygons: the corner at which each side begins, and where on the side, 0 to 1."""

    points: IntArray
    corners: IntArray
    shares: FloatArray


def close_vertices(positions: FloatArray, sides: IntArray) -> Loose:
    """Find vertices of the boundary that nearly coincide, by a gap in the distribution of distances between them."""
    # distances to the nearest vertex that no side of the boundary leads to, and lengths of the sides: where many of the
    # first are far below the others, the tolerance is in the middle of the gap
    none = Loose(np.zeros(0, dtype=np.int64), np.nan)
    vertices = np.unique(sides)
    if len(vertices) < FEWEST:
        return none
    points, rows = positions[vertices], np.searchsorted(vertices, sides)
    apart, near = cKDTree(points).query(points, min(N_NEAREST, len(points)))
    joined = np.concatenate([rows[:, 0] * len(points) + rows[:, 1], rows[:, 1] * len(points) + rows[:, 0]])
    keys = np.arange(len(points))[:, None] * len(points) + near
    apart[np.isin(keys, joined) | (near == np.arange(len(points))[:, None])] = np.inf
    nearest = apart.min(axis=1)
    lengths = np.linalg.norm(points[rows[:, 0]] - points[rows[:, 1]], axis=1)
    small = nearest[nearest <= NEAR * np.median(lengths)]
    if len(small) < max(FEWEST, LEAST_SHARE * len(vertices)):
        return none
    least = float(np.quantile(lengths, SHORT))
    most = next((most for most in (small.max(), np.quantile(small, MOST)) if least >= GAP * most), None)
    if most is None:
        return none
    tolerance = float(np.sqrt(most * least))
    return Loose(vertices[nearest <= tolerance], tolerance)


def first_within(points: FloatArray, tolerance: float) -> IntArray:
    """Find, for each point (n, 3), the first of those that steps of at most the tolerance lead to, (n,)."""
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    pairs = finite[cKDTree(points[finite]).query_pairs(tolerance, output_type="ndarray")]
    count, group = linked(len(points), (pairs[:, 0], pairs[:, 1]))
    first = np.full(count, len(points))
    np.minimum.at(first, group, np.arange(len(points)))
    return np.asarray(first[group])


def t_junctions(points: FloatArray, polygons: Polygons, survivor: IntArray, free: Sides) -> TJunctions:
    """Find the points on the middle of the free sides of polygons; ``survivor`` (n,) says which points are one."""
    corners, sides = free
    finite = np.isfinite(points[sides]).all(axis=(1, 2))
    corners, sides = corners[finite], sides[finite]
    vertices = np.unique(sides)
    if not len(vertices):
        return TJunctions(*(np.zeros(0, dtype=np.int64),) * 2, np.zeros(0))
    scaled = np.zeros_like(points)
    scaled[vertices] = points[vertices] / (
        np.abs(points[vertices]).max() or 1.0
    )  # whose squares do not overflow
    points = scaled
    start, end = points[sides[:, 0]], points[sides[:, 1]]
    lengths = np.linalg.norm(end - start, axis=1)
    side, near, share = _on_sides(points[vertices], start, end, lengths)
    vertex = vertices[near]
    # no polygon has a corner twice, as one with a flat corner would
    of, n = polygons.of_corner, len(points)
    in_range = (polygons.corners >= 0) & (polygons.corners < n)
    own = np.where(in_range, survivor[polygons.corners.clip(0, n - 1)], n)
    new = ~np.isin(of[corners[side]] * (n + 1) + vertex, of * (n + 1) + own)
    order = np.lexsort([share[new], corners[side[new]]])
    return TJunctions(vertex[new][order], corners[side[new]][order], share[new][order])


def _on_sides(
    points: FloatArray, start: FloatArray, end: FloatArray, lengths: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Find the points (n, 3) on the middle of sides, each pair once: the side, the point, and where on the side."""
    # in balls around pieces of the sides; those that hold many points, as of other sheets, are halved
    tree, span = cKDTree(points), end - start
    side, low, high = np.arange(len(start)), np.full(len(start), END), np.full(len(start), 1 - END)
    found, shares = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    while len(side):
        middle = (low + high) / 2
        centres, radii = (
            start[side] + middle[:, None] * span[side],
            ((high - low) / 2 + ON_EDGE) * lengths[side],
        )
        counts = tree.query_ball_point(centres, radii, return_length=True)
        few = (counts <= MOST_NEAR) | (high - low <= PIECE)
        held = np.flatnonzero(few & (counts > 0))
        for rows in np.array_split(held, 1 + counts[held].sum() // AT_ONCE):  # lists take much memory
            lists = tree.query_ball_point(centres[rows], radii[rows])
            near = np.concatenate([*lists, []]).astype(np.int64)
            of = np.repeat(side[rows], counts[rows])
            to, squared = points[near] - start[of], np.maximum(lengths[of] ** 2, np.finfo(float).tiny)
            share = np.einsum("ij,ij->i", to, span[of]) / squared
            off = np.linalg.norm(to - share[:, None] * span[of], axis=1)
            inside = (off <= ON_EDGE * lengths[of]) & (share > END) & (share < 1 - END)
            found.append(of[inside] * len(points) + near[inside])
            shares.append(share[inside])
        side, low, high, middle = (np.tile(each[~few], 2) for each in (side, low, high, middle))
        half = np.arange(len(side)) < len(side) // 2
        low, high = np.where(half, low, middle), np.where(half, middle, high)
    pairs, first = np.unique(np.concatenate(found), return_index=True)
    return pairs // max(len(points), 1), pairs % max(len(points), 1), np.concatenate(shares)[first]


def free_sides(polygons: Polygons, survivor: IntArray, is_sound: BoolArray | None = None) -> Sides:
    """Find the sides of one polygon alone, of those that are sound (p,), if points that are one are joined."""
    corners, n = polygons.corners, len(survivor)
    inside = (corners >= 0) & (corners < n)
    ends = np.cumsum(polygons.sizes)
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = ends - polygons.sizes
    at = survivor[np.where(inside, corners, 0)] if n else corners
    sides = np.column_stack([at, at[following]])
    low, high = sides.min(axis=1), sides.max(axis=1)
    counts = inside & inside[following] & (low != high)
    if is_sound is not None:
        counts &= is_sound[polygons.of_corner]
    rows = np.flatnonzero(counts)
    _, edge, count = np.unique(low[rows] * n + high[rows], return_inverse=True, return_counts=True)
    rows = rows[count[edge] == 1]
    return Sides(rows, sides[rows])


def without_t_junctions(asset: Asset, survivor: IntArray, is_sound: BoolArray) -> tuple[Asset, BoolArray]:
    """Insert points into the sides that they lie on until none is left; returns also which points (n,) were inserted."""
    inserted = np.zeros(len(asset.points), dtype=bool)
    # each round gives a polygon points that it did not have, so they come to an end
    while True:
        free = free_sides(asset.polygons, survivor, is_sound)
        found = t_junctions(asset.placed_points, asset.polygons, survivor, free)
        if not len(found.points):
            return asset, inserted
        asset = _with_points_on_sides(asset, found)
        inserted[found.points] = True


def _with_points_on_sides(asset: Asset, found: TJunctions) -> Asset:
    """Insert points into the sides that they lie on; values of corners there lie between those of the ends."""
    polygons = asset.polygons
    of = polygons.of_corner[found.corners]
    place = found.corners + 1
    corners = np.insert(polygons.corners, place, found.points)
    index = np.insert(np.arange(len(polygons.corners)), place, found.corners)
    sizes = polygons.sizes + np.bincount(of, minlength=len(polygons))
    everything = np.arange(len(asset.points))
    divided = Polygons(corners, sizes, asset.points)
    rows = Renumbering(everything, everything, divided, np.arange(len(sizes)), index)
    new = place + np.arange(len(place))
    ends = np.cumsum(polygons.sizes)
    following = np.where(place == ends[of], ends[of] - polygons.sizes[of], place)
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
