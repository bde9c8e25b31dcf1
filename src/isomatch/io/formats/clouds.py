"""Clouds of points, which are read only: XYZ, columns of text; PCD, through pypcd4; and arrays of NumPy."""

from __future__ import annotations

import re
from io import BytesIO

import numpy as np

from isomatch._core.arrays import AnyArray
from isomatch._core.first_use import package
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute
from isomatch.io.formats._reading import Room, damaged, reading, unexpected
from isomatch.io.formats._text import read_lines, told_frame
from isomatch.io.polygons import Polygons

_SPREAD = 0.05  # by which the length of a normal may be off, as of few digits
_WORDS = re.compile(rb"[ \t]*(?://|[A-DF-Za-df-z_])[^\n]*")  # a line that names the columns; E is in numbers
_POINTS = re.compile(rb"(?m)^POINTS\s+(\d{1,18})\s*$")
_LONGEST_HEADER = 2**16  # bytes
_NORMAL = ("normal_x", "normal_y", "normal_z")
_NO_POLYGONS = Polygons([], [])


def read_xyz(data: bytes, name: str) -> Asset:
    """Read rows of x, y, z, and what follows: bytes of a colour, a normal, or other numbers."""
    # a line that names the columns, or the number of the rows before them, is passed over
    data, notes = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n"), list[str]()
    if heading := _WORDS.match(data):
        data = data[heading.end() :]
        notes.append(f"the first line is taken as names: {heading[0].decode(errors='replace')}")
    lines_of_numbers = (line for line in data.split(b"\n") if line.strip() and line.lstrip()[:1] != b"#")
    first = next(lines_of_numbers, b"")
    for mark in (b";", b","):
        if first.count(mark) > 1:  # which no decimal comma is
            data = data.replace(mark, b" ")
    lines = read_lines(name, data, before=1 if heading else 0)
    if len(lines) > 1 and lines.row(0).strip() == str(len(lines) - 1):
        lines = lines[1 : len(lines)]
    rows = lines.parse()
    points = rows.leading(3, "at least 3 numbers x y z of a point")
    others = rows.columns(3, max(int(rows.counts.max(initial=3)) - 3, 0))
    return Asset(points, _NO_POLYGONS, _columns(others), notes=tuple(notes), frame=told_frame(data))


def read_npy(data: bytes, name: str) -> Asset:
    """Read an array (n, 3 or more) of positions and what follows them, as in `read_xyz`."""
    with reading(name, "a NumPy array"):
        array = np.load(BytesIO(data), allow_pickle=False)
    lies = array.ndim == 2 and array.shape[0] == 3 < array.shape[1]
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "iuf" or lies:
        remedy = "save the transposed array" if lies else "save x, y, z as columns"
        raise unexpected(name, "an array (n, 3) of positions", f"{array.dtype} {array.shape}", remedy)
    table = array.astype(np.float64)
    return Asset(table[:, :3], _NO_POLYGONS, _columns(table[:, 3:]))


def read_pcd(data: bytes, name: str) -> Asset:
    """Read the fields of a cloud of PCL: positions, a colour, a normal, and others by their names."""
    pypcd4, what = package("pypcd4", "io", "a .pcd file"), "a PCD file"
    points = _POINTS.search(data[:_LONGEST_HEADER])
    n = int(points[1]) if points else 0
    Room(len(data)).take(n * 12, f"{name}: the header")
    with reading(name, what):
        fields = pypcd4.PointCloud.from_fileobj(BytesIO(data)).pc_data
        columns = {column: fields[column].ravel() for column in fields.dtype.names if "~" not in column}
    if missing := [axis for axis in "xyz" if axis not in columns]:
        raise unexpected(name, "fields x, y, z", f"no {', '.join(missing)}", "export it with positions")
    if len(fields) != n:
        raise damaged(name, what, f"{len(fields)} points, {n} declared")
    attributes = list[Attribute]()
    for packed in [name for name in ("rgba", "rgb") if name in columns][:1]:  # a number of 32 bits
        octets = columns.pop(packed).view("u1").reshape(n, -1)[:, 2::-1]
        attributes.append(Attribute("color", "point", "colour", octets))
    if columns.keys() >= {*_NORMAL}:
        normal = np.stack([columns.pop(axis) for axis in _NORMAL], axis=1)
        attributes.append(Attribute("normal", "point", "normal", normal))
    positions = np.stack([columns.pop(axis) for axis in "xyz"], axis=1, dtype=np.float64)
    attributes += [Attribute(column, "point", "scalar", values) for column, values in columns.items()]
    return Asset(positions, _NO_POLYGONS, tuple(attributes))


def _columns(others: AnyArray) -> tuple[Attribute, ...]:
    """Make attributes of the columns after the positions: three that can be a colour or a normal, or single ones."""
    attributes, at = dict[str, Attribute](), 0
    while at < others.shape[1]:
        three, name = others[:, at : at + 3], f"column {at + 4}"
        whole = three.shape[1] == 3 and len(three)
        if whole and "normal" not in attributes and _are_normals(three):
            attributes["normal"] = Attribute("normal", "point", "normal", three)
        elif whole and "color" not in attributes and _are_bytes(three):
            attributes["color"] = Attribute("color", "point", "colour", three.astype(np.uint8))
        else:
            attributes[name] = Attribute(name, "point", "scalar", others[:, at])
        at += 1 if name in attributes else 3
    return tuple(attributes.values())


def _are_normals(three: AnyArray) -> bool:
    return bool((np.abs(np.linalg.norm(three, axis=1) - 1) < _SPREAD).all())


def _are_bytes(three: AnyArray) -> bool:
    return bool((three == np.rint(three)).all() and three.min() >= 0 and 1 < three.max() <= 255)
