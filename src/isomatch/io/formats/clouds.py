"""Readers of point clouds: XYZ, columns of text; PCD, by pypcd4; NPY, arrays of NumPy."""

from __future__ import annotations

import re
from dataclasses import replace
from io import BytesIO

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray
from isomatch._core.first_use import package
from isomatch._core.tables import BLANKS, Table, parse_table
from isomatch._core.texts import decode_text
from isomatch.io.asset import Asset, Frame
from isomatch.io.attribute import Attribute, Kind, number_equal_names
from isomatch.io.formats._reading import Room, damaged, reading, unexpected
from isomatch.io.formats._text import are_bytes, frame_in_comments, read_lines
from isomatch.io.polygons import Polygons

_NORMAL_TOLERANCE = 0.05  # largest difference of the length of a normal from 1; chosen
_POSITIONS = ("x", "y", "z")  # names of the columns with positions
_EXAMINED_LETTERS = 2**16  # characters at the start of a text that show its columns and separator; chosen
_ROW_COUNT = re.compile(r"(?:[ \t]*(?:(?://|#).*)?\n)*[ \t]*(\d{1,18})[ \t]*\n")
"""Matches a line with the number of points, before them and perhaps after comments."""
# name and kind of the attribute that is made of columns, by the names of the columns
_NAMED_COLUMNS: dict[tuple[str, ...], tuple[str, Kind]] = {
    ("r", "g", "b"): ("color", "colour"),
    ("red", "green", "blue"): ("color", "colour"),
    ("nx", "ny", "nz"): ("normal", "normal"),
    ("normal_x", "normal_y", "normal_z"): ("normal", "normal"),
}
_POINT_COUNT = re.compile(rb"(?m)^POINTS\s+(\d{1,18})\s*$")  # the line of PCD with the number of points
_MAX_HEADER_BYTES = 2**16  # number of first bytes in which a PCD file must give its number of points; chosen
_NORMAL_COLUMNS = ("normal_x", "normal_y", "normal_z")  # names of the columns of PCD that hold normals
_NO_POLYGONS = Polygons([], [])  # the polygons of a cloud: none


def read_xyz(data: bytes, name: str) -> Asset:
    """Read rows of x, y, z, by the names of columns or in this order, and colours, normals or numbers."""
    frame, text, notes = frame_in_comments(data), re.sub(r"\r\r?\n|\r", "\n", decode_text(data)), list[str]()
    counted = _ROW_COUNT.match(text)
    if counted and int(counted[1]) == text[counted.end() :].rstrip().count("\n") + 1:
        text = text[: counted.start(1)] + text[counted.end(1) :]
    end = text.find("\n", _EXAMINED_LETTERS)
    head = parse_table(text if end < 0 else text[:end], name)
    table = head.titled(_POSITIONS)
    width = len(table.filled[0].cells) if table.filled else 0
    is_row = table.rows is not head.rows
    if {*_POSITIONS} <= {title.lower() for title in table.titles}:
        notes.append(f"the columns are taken as {', '.join(filter(None, table.titles))}")
    elif table.titles and (not is_row or len(head.filled[0].cells) != width):
        notes += [f"the first line is taken as a title: {head.filled[0].text.strip()}"] * is_row
        table = replace(table, titles=())
    first = table.filled[0].line - 1 if table.filled else 0
    lines = _plain_lines(text.split("\n")[first:] if first else [text], table)
    rows = read_lines(name, lines, before=first).parse()
    rows.leading(3, "at least 3 numbers x y z of a point")
    values = rows.columns(0, int(rows.counts.max(initial=3)))
    values = values[:, ~(np.isnan(values).all(axis=0) & (np.arange(values.shape[1]) > 2))]
    return _make_cloud(values, table, notes, frame)


def _plain_lines(lines: list[str], table: Table) -> bytes:
    """Rewrite lines for the fast reader: blanks between numbers, decimal points, nan for no number."""
    text = "\n".join(lines).replace('"', "").replace("−", "-")
    if table.separator != BLANKS:
        mark = re.escape(table.separator)
        text = re.sub(rf"(?m)(?<={mark})[ \t]*(?={mark}|$)|^[ \t]*(?={mark})", "nan", text)
        text = text.replace(table.separator, " ")
    return (text.replace(",", ".") if table.has_decimal_commas else text).encode()


def _make_cloud(values: FloatArray, table: Table, notes: list[str], frame: Frame | None) -> Asset:
    """Make a cloud of columns, by their names if there are any; `FormatError` if x, y or z is missing."""
    titles = [title.lower() for title in table.titles]
    axes_found = [titles.index(axis) for axis in "xyz" if axis in titles]
    if titles and (len(axes_found) < 3 or len(titles) != values.shape[1]):
        found = ", ".join(table.titles)[:80]
        raise unexpected(table.name, "columns x, y, z", found, "name them so in the first line")
    n_rows, n_columns = values.shape
    if (
        not titles
        and n_columns > 3
        and n_rows > 2
        and (values[:, 0] - values[0, 0] == np.arange(n_rows)).all()
    ):
        found = "a first column that counts the rows"
        raise unexpected(table.name, "x, y, z", found, "name the columns in the first line, such as id x y z")
    positions = axes_found or [0, 1, 2]
    others = [i for i in range(values.shape[1]) if i not in positions and titles[i : i + 1] != [""]]
    names = [table.titles[i] for i in others] if axes_found else []
    attributes = list[Attribute]()
    for axes, (name, kind) in _NAMED_COLUMNS.items():
        lower = [title.lower() for title in names]
        if {*axes} <= {*lower} and not any(title.name == name for title in attributes):
            chosen = [lower.index(axis) for axis in axes]
            three = values[:, [others[i] for i in chosen]]
            is_share = 0 <= three.min(initial=0) <= three.max(initial=1) <= 1
            if kind == "normal" or is_share or are_bytes(three):
                three = three.astype(np.uint8) if kind == "colour" and are_bytes(three) else three
                attributes.append(Attribute(name, "point", kind, three))
                others = [x for i, x in enumerate(others) if i not in chosen]
                names = [x for i, x in enumerate(names) if i not in chosen]
    if axes_found:
        for i, title in zip(others, names):
            attributes.append(Attribute(title or f"column {i + 1}", "point", "scalar", values[:, i]))
    else:
        attributes += _guess_columns(values[:, 3:])
    named = number_equal_names(attributes)
    return Asset(values[:, positions], _NO_POLYGONS, named, notes=(*notes,), frame=frame)


def read_npy(data: bytes, name: str) -> Asset:
    """Read an array (n, 3 or more) of positions and further columns, as in `read_xyz`."""
    with reading(name, "a NumPy array"):
        array = np.load(BytesIO(data), allow_pickle=False)
    lies = array.ndim == 2 and array.shape[0] == 3 < array.shape[1]
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "iuf" or lies:
        remedy = "save the transposed array" if lies else "save x, y, z as columns"
        raise unexpected(name, "an array (n, 3) of positions", f"{array.dtype} {array.shape}", remedy)
    table = array.astype(np.float64)
    return Asset(table[:, :3], _NO_POLYGONS, _guess_columns(table[:, 3:]))


def read_pcd(data: bytes, name: str) -> Asset:
    """Read the fields of a cloud of PCL: positions, colour, normal, and others by their names."""
    pypcd4, what = package("pypcd4", "io", "a .pcd file"), "a PCD file"
    points = _POINT_COUNT.search(data[:_MAX_HEADER_BYTES])
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
    # A single column may hold the colour, one byte for each of blue, green, red.
    for packed in [name for name in ("rgba", "rgb") if name in columns][:1]:
        octets = columns.pop(packed).view("u1").reshape(n, -1)[:, 2::-1]
        attributes.append(Attribute("color", "point", "colour", octets))
    if columns.keys() >= {*_NORMAL_COLUMNS}:
        normal = np.stack([columns.pop(axis) for axis in _NORMAL_COLUMNS], axis=1)
        attributes.append(Attribute("normal", "point", "normal", normal))
    positions = np.stack([columns.pop(axis) for axis in "xyz"], axis=1, dtype=np.float64)
    attributes += [Attribute(column, "point", "scalar", values) for column, values in columns.items()]
    return Asset(positions, _NO_POLYGONS, tuple(attributes))


def _guess_columns(others: AnyArray) -> tuple[Attribute, ...]:
    """Make attributes of further columns: three that can be a colour or a normal, or single ones."""
    attributes, column = dict[str, Attribute](), 0
    while column < others.shape[1]:
        three, name = others[:, column : column + 3], f"column {column + 4}"
        whole = three.shape[1] == 3 and len(three)
        if whole and "normal" not in attributes and _are_normals(three):
            attributes["normal"] = Attribute("normal", "point", "normal", three)
        elif whole and "color" not in attributes and are_bytes(three):
            attributes["color"] = Attribute("color", "point", "colour", three.astype(np.uint8))
        else:
            attributes[name] = Attribute(name, "point", "scalar", others[:, column])
        column += 1 if name in attributes else 3
    return tuple(attributes.values())


def _are_normals(three: AnyArray) -> bool:
    with np.errstate(over="ignore"):  # a length beyond the largest float becomes infinite
        return bool((np.abs(np.linalg.norm(three, axis=1) - 1) < _NORMAL_TOLERANCE).all())
