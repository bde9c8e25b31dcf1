"""Properties of PLY elements as attributes, and attributes as properties."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from isomatch.assets.attribute import Attribute, Domain, Kind
from isomatch.assets.attribute_names import guessed_kind, told_apart
from isomatch.assets.formats._ply_body import Table
from isomatch.assets.formats._ply_header import Element, Property
from isomatch.assets.formats._ply_rows import Cells, cells
from isomatch.values.arrays import AnyArray, IntArray

_GROUPS: tuple[tuple[str, Kind, tuple[str, ...]], ...] = (
    ("normal", "normal", ("nx", "ny", "nz")),
    ("color", "colour", ("red", "green", "blue", "alpha")),
    ("color", "colour", ("red", "green", "blue")),
    ("color", "colour", ("r", "g", "b")),
    ("color", "colour", ("diffuse_red", "diffuse_green", "diffuse_blue")),
    ("uv", "uv", ("s", "t")),
    ("uv", "uv", ("u", "v")),
    ("uv", "uv", ("texture_u", "texture_v")),
)
_CORNER_UV = "texcoord"


@dataclass(frozen=True)
class Columns:
    """The properties of an element as attributes.

    ``names`` are the properties of each attribute, and ``others`` what makes no attribute, as it was.
    """

    attributes: tuple[Attribute, ...] = ()
    names: Mapping[tuple[str, Domain], tuple[str, ...]] = field(default_factory=dict)
    others: tuple[Cells, ...] = ()


def read_columns(
    element: Element, table: Table, domain: Domain, used: Sequence[str], sizes: IntArray
) -> Columns:
    """Make attributes of the properties that are not used otherwise; ``sizes`` are those of the polygons."""
    left = {each.name: each for each in element.properties if each.name not in used}
    single = {name: each for name, each in left.items() if each.count_type is None}
    found: list[tuple[Attribute, tuple[str, ...]]] = []
    for name, kind, members in _GROUPS:
        types = {single[member].type for member in members if member in single}
        if all(member in single for member in members) and len(types) == 1:
            if kind != "colour" and types.pop().kind != "f":
                continue
            values = np.stack([_values(table, single.pop(member)) for member in members], axis=1)
            found.append((Attribute(name, domain, kind, values), members))
    for name, members in _numbered(single).items():
        values = np.stack([_values(table, single.pop(member)) for member in members], axis=1)
        found.append((Attribute(name, domain, guessed_kind(name, values), values), members))
    for name, each in single.items():
        values = _values(table, each)
        found.append(
            (Attribute(name, domain, "label" if values.dtype.kind in "iu" else "scalar", values), (name,))
        )
    others = []
    for name, each in left.items():
        if each.count_type is None:
            continue
        column = table.columns[name]
        corner = _of_corners(name, _values(table, each), column.counts, sizes) if domain == "face" else None
        if corner is None:
            others.append(Cells(each, column.values.ravel(), np.array(column.counts)))
        else:
            found.append((corner, (name,)))
    order = list(left)
    found.sort(key=lambda pair: order.index(pair[1][0]))
    attributes = told_apart(attribute for attribute, _ in found)
    names = {(a.name, a.domain): members for a, (_, members) in zip(attributes, found)}
    return Columns(attributes, names, tuple(others))


def write_columns(
    attributes: Sequence[Attribute],
    domain: Domain,
    names: Mapping[tuple[str, Domain], tuple[str, ...]],
    sizes: IntArray,
    used: Iterable[str],
) -> list[Cells]:
    """Make properties of the attributes of an element, with those of corners as lists of the faces.

    None has a name that is used.
    """
    given = {
        key: names[key]
        for a in attributes
        if (key := (a.name, a.domain)) in names
        and (a.domain == "corner" or len(names[key]) == a.plain.size // max(len(a), 1))
    }
    taken = {*used, *(member for members in given.values() for member in members)}
    columns: list[Cells] = []
    for attribute in attributes:
        values = attribute.plain
        of_corners = attribute.domain == "corner" and domain == "face"
        if of_corners or attribute.domain == domain:
            members = given.get((attribute.name, attribute.domain)) or _members(attribute, values, taken)
            taken.update(members)
            if of_corners:
                columns.append(_list_of_faces(members[0], values, sizes))
            else:
                columns += [cells(name, column) for name, column in zip(members, np.atleast_2d(values.T))]
    return columns


def _numbered(single: Mapping[str, Property]) -> dict[str, tuple[str, ...]]:
    """Properties of one type whose names differ in the numbers 0, 1, … at their ends, by what is before."""
    found: dict[str, tuple[str, ...]] = {}
    for name in single:
        if name.endswith("_0"):
            stem = name[:-2]
            members = tuple(takewhile(single.__contains__, (f"{stem}_{i}" for i in range(len(single)))))
            if len(members) > 1 and len({single[member].type for member in members}) == 1:
                found[stem] = members
    return found


def _members(attribute: Attribute, values: AnyArray, taken: Collection[str]) -> tuple[str, ...]:
    """Names of the properties of a new attribute: those in use, or its own, with numbers where it has columns."""
    width = values.shape[1] if values.ndim == 2 else 1
    standard: list[tuple[str, ...]]
    if attribute.domain == "corner":
        standard = [(_CORNER_UV,)] if attribute.kind == "uv" else []
    else:
        standard = [
            members
            for name, kind, members in _GROUPS
            if len(members) == width and (name == attribute.name or kind == attribute.kind == "colour")
        ]
    for members in standard:
        if not any(member in taken for member in members):
            return members
    stem = re.sub("[^!-~]+", "_", attribute.name) or "_"  # no blanks in PLY, and no letters but of ASCII
    while True:
        members = tuple(f"{stem}_{i}" for i in range(width))
        if attribute.domain == "corner" or values.ndim == 1:
            members = (stem,)
        if not any(member in taken for member in members):
            return members
        stem += "_"


def _of_corners(name: str, values: AnyArray, counts: IntArray, sizes: IntArray) -> Attribute | None:
    """Make an attribute of a list that has as many values as its face has corners, or twice as many, or none."""
    width = 2 if name == _CORNER_UV else 1
    given = counts == width * sizes
    if not len(counts) or not given.any() or not (given | (counts == 0)).all():
        return None
    if width == 2:
        uv = np.full((int(sizes.sum()), 2), np.nan, values.dtype)
        uv[np.repeat(given, sizes)] = values.reshape(-1, 2)
        return Attribute("uv", "corner", "uv", uv)
    if not given.all():
        return None
    return Attribute(name, "corner", "label" if values.dtype.kind in "iu" else "scalar", values)


def _list_of_faces(name: str, values: AnyArray, sizes: IntArray) -> Cells:
    """Make a list of the values of corners; a face with a corner of nan has an empty one."""
    width = values.shape[1] if values.ndim == 2 else 1
    counts = width * sizes
    if values.dtype.kind == "f" and name == _CORNER_UV:
        missing = np.isnan(values).any(axis=1)
        without = np.add.reduceat(missing, np.cumsum(sizes) - sizes) > 0 if len(sizes) else sizes > 0
        values = values[~np.repeat(without, sizes)]
        counts = np.where(without, 0, counts)
    return cells(name, values, counts)


def _values(table: Table, each: Property) -> AnyArray:
    """Values in the type that the header declares, which text need not keep to."""
    values = table.columns[each.name].values.ravel()
    if each.type.kind == "f":
        with np.errstate(over="ignore"):
            return values.astype(each.type.newbyteorder("="))
    if values.dtype.kind != "f":
        return values.astype(each.type.newbyteorder("="))
    limits = np.iinfo(each.type.str)
    fits = (values == np.rint(values)) & (limits.min <= values) & (values <= limits.max)
    return values.astype(each.type) if fits.all() else values
