"""Values of an asset that is repaired: where they differ at welded points, and normals of faces turned over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch.assets import Asset, Attribute, Renumbering
from isomatch.surfaces import Mesh
from isomatch.values.arrays import AnyArray, BoolArray, IntArray


def welded_apart(asset: Asset, survivor: IntArray) -> dict[str, int]:
    """Count, for each attribute of points, those that are welded onto a point with another value."""
    rows = np.flatnonzero(survivor != np.arange(len(survivor)))
    counts = {}
    for attribute in asset.attributes:
        if attribute.domain != "point" or not len(rows):
            continue
        differ = _differ(attribute.values, rows, survivor[rows])
        if attribute.joints is not None:
            differ |= _differ(attribute.joints, rows, survivor[rows])
        if differ.any():
            counts[attribute.name] = int(differ.sum())
    return counts


def _differ(values: AnyArray, rows: IntArray, others: IntArray) -> BoolArray:
    one, other = values[rows].reshape(len(rows), -1), values[others].reshape(len(rows), -1)
    differ = np.not_equal(one, other)
    if values.dtype.kind == "f":
        differ &= ~(np.isnan(one) & np.isnan(other))
    found: BoolArray = np.any(differ, axis=1)
    return found


def goes_to_corners(asset: Asset, attribute: Attribute) -> bool:
    """Whether values of points that differ at welded ones are kept at corners.

    Texture coordinates of one side of a seam would smear the texture. Normals too have two sides at a sharp edge, and
    glTF, whose files have parts, splits points for them again.
    """
    directed = attribute.kind == "normal" or attribute.is_tangent
    is_free = all((a.name, a.domain) != (attribute.name, "corner") for a in asset.attributes)
    return is_free and (attribute.kind == "uv" or (directed and bool(asset.parts)))


def kept_at_corners(asset: Asset, apart: dict[str, int]) -> Asset:
    """Return the asset before it is welded, with these attributes of points at corners where that keeps both sides."""
    corners = asset.polygons.corners
    inside = np.where((corners >= 0) & (corners < len(asset.points)), corners, 0)
    attributes = tuple(
        a.at(inside, "corner") if a.domain == "point" and a.name in apart and goes_to_corners(asset, a) else a
        for a in asset.attributes
    )
    return replace(asset, attributes=attributes)


def turned_over(asset: Asset, before: Asset, rows: Renumbering, rewound: IntArray) -> Asset:
    """Turn normals over where all faces were, given as the triangles before, unless they agree with them now."""
    if not asset.of_kind("normal") or not len(rewound):
        return asset
    of_face = np.isin(rows.polygon_index, before.polygons.of_triangle[rewound])
    polygons = asset.polygons
    of_corner = of_face[polygons.of_corner]
    n_turned, n_all = (
        np.bincount(corners, minlength=len(asset.points))
        for corners in (polygons.corners[of_corner], polygons.corners)
    )
    turned = {"face": of_face, "corner": of_corner, "point": (n_turned > 0) & (n_turned == n_all)}
    mesh = Mesh(asset.placed_points, polygons.triangles)
    first = np.unique(polygons.of_triangle, return_index=True)[1]
    at_points = mesh.vertex_normals
    now = {"face": mesh.face_cross[first], "corner": at_points[polygons.corners], "point": at_points}

    def right(attribute: Attribute) -> Attribute:
        if attribute.kind != "normal":
            return attribute
        placed = asset.placed.attribute(attribute.name, attribute.domain).values
        against = (placed * now[attribute.domain]).sum(axis=1) < 0
        sign = np.where(turned[attribute.domain] & against, -1, 1).astype(attribute.values.dtype)
        return attribute.with_values(attribute.values * sign[:, None]) if (sign < 0).any() else attribute

    return replace(asset, attributes=tuple(map(right, asset.attributes)))
