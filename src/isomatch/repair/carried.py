"""What an asset carries goes through a repair: values of points, corners and faces, and turned normals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, IntArray
from isomatch.io import Asset, Attribute, Renumbering
from isomatch.repair.draft import Draft, count
from isomatch.surfaces import Mesh


def carried(asset: Asset, draft: Draft, onto: IntArray) -> tuple[Asset, IntArray, list[str]]:
    """Make the mended asset; returns also the polygon of each of its polygons, and notes on values that differed."""
    # the asset of the draft, and the point (n,) of it that each of its points was welded onto
    differing = welded_apart(asset, onto)
    mesh, trace = draft.mesh, draft.trace
    rows = Renumbering.of(asset.polygons, trace.given, trace.current, draft.faces, draft.rewound, mesh.faces)
    whole = kept_at_corners(asset, differing).renumbered(rows)
    whole = turned_over(whole, asset, rows, draft.faces[draft.rewound])
    if draft.contacts:
        at_contacts = np.isin(trace.given, np.concatenate(draft.contacts))
        whole = _with_normals(whole.placed_at(mesh.vertices), mesh, at_contacts)
    return whole, rows.polygon_index, [_told(asset, name, n) for name, n in differing.items()]


def _told(asset: Asset, name: str, n: int) -> str:
    welded = count(n, "welded vertex")
    if goes_to_corners(asset, asset.attribute(name, "point")):
        return f"kept {name} at corners, as it differs at {welded}"
    return f"kept the first value of {name} at {welded} where it differs"


def _with_normals(asset: Asset, mesh: Mesh, rows: BoolArray) -> Asset:
    """Give some points (n,) the normals of a mesh: at merged points those of both limbs had been averaged."""
    if asset.parts:
        return asset
    attributes = []
    for each in asset.attributes:
        if each.kind == "normal" and each.domain == "point":
            values = np.where(rows[:, None], mesh.vertex_normals, each.values).astype(each.values.dtype)
            each = replace(each, values=values)
        attributes.append(each)
    return replace(asset, attributes=tuple(attributes))


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
    return np.asarray(differ.any(axis=1))


def goes_to_corners(asset: Asset, attribute: Attribute) -> bool:
    """Whether values of points that differ at welded ones are kept at corners."""
    # texture coordinates of one side of a seam would smear the texture. Normals too have two sides at a sharp edge, and
    # glTF, whose files have parts, splits points for them again
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
    corners, n = polygons.corners, len(asset.points)
    n_turned, n_all = (np.bincount(each, minlength=n) for each in (corners[of_corner], corners))
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
