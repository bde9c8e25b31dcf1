"""Values of corners in formats that have none: a point becomes several where the values of its corners differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from isomatch.assets.attribute import Attribute
from isomatch.assets.polygons import Polygons
from isomatch.surfaces import first_equal, welded
from isomatch.values.arrays import AnyArray, BoolArray, IntArray


@dataclass(frozen=True)
class Split:
    """Points of which each has one value of every attribute.

    ``source`` is the former point of each, in order; ``corners`` are the new points of the corners. There are no
    more attributes of corners.
    """

    source: IntArray
    corners: IntArray
    attributes: tuple[Attribute, ...]


def split_at_seams(polygons: Polygons, n_points: int, attributes: Sequence[Attribute]) -> Split:
    """Move the values of corners to points, of which there are then as many as different values meet at a point."""
    corners = polygons.corners
    of_corners = [a for a in attributes if a.domain == "corner"]
    if not of_corners:
        return Split(np.arange(n_points), corners, tuple(attributes))
    kept, place = welded(np.column_stack([corners, *(_codes(a.values) for a in of_corners)]))
    unused = np.ones(n_points, dtype=bool)
    unused[corners] = False
    source = np.concatenate([corners[kept], np.flatnonzero(unused)])
    order = np.argsort(source, kind="stable")
    corner = np.append(kept, np.zeros(unused.sum(), dtype=np.int64))
    return Split(
        source[order],
        np.argsort(order, kind="stable")[place],
        tuple(
            _without(a.at(corner[order], "point"), unused[source[order]])
            if a.domain == "corner"
            else a.at(source[order])
            if a.domain == "point"
            else a
            for a in attributes
        ),
    )


def merged_corners(polygons: Polygons, n_points: int, attribute: Attribute) -> Attribute | None:
    """Return an attribute of corners as one of points; None if the corners of a point differ."""
    corner = np.zeros(n_points, dtype=np.int64)
    corner[polygons.corners] = np.arange(len(polygons.corners))
    codes = _codes(attribute.values)
    if not len(codes) or (codes[corner[polygons.corners]] != codes).any():
        return None
    unused = np.ones(n_points, dtype=bool)
    unused[polygons.corners] = False
    return _without(attribute.at(corner, "point"), unused)


def _without(attribute: Attribute, rows: BoolArray) -> Attribute:
    """Return the same with no value in some rows: nan, −1, an empty text, or 0 where 0 is none."""
    if not rows.any():
        return attribute
    values = np.array(attribute.values)
    if attribute.kind == "label":
        values = values.astype(np.int64) if values.dtype.kind == "u" else values
        values[rows] = {"U": "", "b": False}.get(values.dtype.kind, -1)
    else:
        may_be_nan = values.dtype.kind == "f" and attribute.kind not in ("colour", "weights")
        values[rows] = np.nan if may_be_nan else 0
    return replace(attribute, values=values)


def _codes(values: AnyArray) -> IntArray:
    """One integer for each row, the same for equal rows; here nan is equal to nan."""
    table = values.reshape(len(values), -1)
    if table.dtype.kind == "U":
        return np.unique(values, return_inverse=True)[1]
    if table.dtype.kind == "f":
        table = np.where(np.isnan(table), np.finfo(np.float64).max, table.astype(np.float64))
    return first_equal(table.astype(np.float64))
