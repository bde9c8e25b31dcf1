"""Carry the values of an asset through a repair, and turn normals over with their faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, IntArray
from isomatch.io import Asset, Attribute, Renumbering
from isomatch.repair.draft import Draft, count
from isomatch.surfaces import Mesh


def carry_asset(asset: Asset, draft: Draft, onto: IntArray) -> tuple[Asset, IntArray, list[str]]:
    """Make the repaired asset of the asset of a draft; ``onto`` (n,) is the point each was welded onto.

    Return also the old polygon of each of its polygons, and notes on values that differed.
    """
    differing = count_differing(asset, onto)
    mesh, trace = draft.mesh, draft.trace
    rows = Renumbering.of(asset.polygons, trace.given, trace.current, draft.faces, draft.rewound, mesh.faces)
    whole = keep_at_corners(asset, differing).renumbered(rows)
    whole = turn_normals_over(whole, asset, rows, draft.faces[draft.rewound])
    if draft.contacts:
        at_contacts = np.isin(trace.given, np.concatenate(draft.contacts))
        whole = _with_normals(whole.placed_at(mesh.vertices), mesh, at_contacts)
    return whole, rows.polygon_index, [_note(asset, name, n) for name, n in differing.items()]


def _note(asset: Asset, name: str, n: int) -> str:
    """Say what became of the values of an attribute that differed at n welded vertices."""
    welded = count(n, "welded vertex")
    if goes_to_corners(asset, asset.attribute(name, "point")):
        return f"kept {name} at corners, as it differs at {welded}"
    return f"kept the first value of {name} at {welded} where it differs"


def _with_normals(asset: Asset, mesh: Mesh, rows: BoolArray) -> Asset:
    """Give some points (n,) the normals of a mesh: merged points had averages over both limbs."""
    if asset.parts:
        return asset
    attributes = []
    for attribute in asset.attributes:
        if attribute.kind == "normal" and attribute.domain == "point":
            values = np.where(rows[:, None], mesh.vertex_normals, attribute.values)
            attribute = replace(attribute, values=values.astype(attribute.values.dtype))
        attributes.append(attribute)
    return replace(asset, attributes=tuple(attributes))


def count_differing(asset: Asset, survivor: IntArray) -> dict[str, int]:
    """Count, by attribute, the points that are welded onto a point with another value."""
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
    """Whether values of some points differ from the values of others, (k,); nan equals nan."""
    values_here, other_values = (values[points].reshape(len(rows), -1) for points in (rows, others))
    differ = np.not_equal(values_here, other_values)
    if values.dtype.kind == "f":
        differ &= ~(np.isnan(values_here) & np.isnan(other_values))
    return np.asarray(differ.any(axis=1))


def goes_to_corners(asset: Asset, attribute: Attribute) -> bool:
    """Whether values of points that differ at welded ones are kept at corners."""
    # With the texture coordinates of one side of a seam, a welded point would smear the texture on the other.
    # Normals also differ beside a sharp edge; they go to corners for glTF, whose files have parts and which
    # splits points again.
    directed = attribute.kind == "normal" or attribute.is_tangent
    is_free = all((a.name, a.domain) != (attribute.name, "corner") for a in asset.attributes)
    return is_free and (attribute.kind == "uv" or (directed and bool(asset.parts)))


def keep_at_corners(asset: Asset, differing: dict[str, int]) -> Asset:
    """Move attributes that differ at welded points to corners, where that keeps both sides of a seam."""
    corners = asset.polygons.corners
    inside = np.where((corners >= 0) & (corners < len(asset.points)), corners, 0)
    attributes = tuple(
        a.at(inside, "corner")
        if a.domain == "point" and a.name in differing and goes_to_corners(asset, a)
        else a
        for a in asset.attributes
    )
    return replace(asset, attributes=attributes)


def turn_normals_over(asset: Asset, before: Asset, renumbering: Renumbering, rewound: IntArray) -> Asset:
    """Turn normals over where all faces were rewound, unless they agree with these faces now."""
    if not asset.of_kind("normal") or not len(rewound):
        return asset
    of_face = np.isin(renumbering.polygon_index, before.polygons.of_triangle[rewound])
    polygons = asset.polygons
    of_corner = of_face[polygons.of_corner]
    corners, n = polygons.corners, len(asset.points)
    n_turned, n_all = (np.bincount(points, minlength=n) for points in (corners[of_corner], corners))
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
