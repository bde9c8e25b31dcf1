"""The tables of a PLY file, read from text or binary data into columns."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from isomatch._arrays import AnyArray, IntArray
from isomatch.errors import FormatError
from isomatch.surfaces.io._ply_header import Element, Header
from isomatch.surfaces.io._polygons import spans
from isomatch.surfaces.io._text import TextLines, read_lines


@dataclass(frozen=True)
class Column:
    """The values of one property, concatenated over all rows; ``counts`` is the number of values of each row."""

    values: AnyArray
    counts: IntArray


@dataclass(frozen=True)
class Table:
    """The columns of an element, by name; ``place(row)`` is the position of a row in the file, for messages."""

    columns: dict[str, Column]
    place: Callable[[int], str]


def read_tables(data: bytes, name: str, header: Header) -> dict[str, Table]:
    """Read every element that is declared in the header."""
    return _text_tables(data, name, header) if header.text else _binary_tables(data, name, header)


def _text_tables(data: bytes, name: str, header: Header) -> dict[str, Table]:
    lines = read_lines(name, data[header.n_bytes :], before=header.n_lines)
    tables: dict[str, Table] = {}
    start = 0
    for element in header.elements:
        stop = start + (element.n_rows if element.properties else 0)
        if stop > len(lines):
            lines.fail(
                len(lines), f"{element.n_rows} lines of element {element.name}, not {len(lines) - start}"
            )
        tables[element.name] = _text_table(element, lines[start:stop])
        start = stop
    if start != len(lines):
        lines.fail(
            start, "no line after the elements declared in the header", "correct the counts in the header"
        )
    return tables


def _text_table(element: Element, lines: TextLines) -> Table:
    expected = f"{element.name}: " + " ".join(
        p.name if p.count_type is None else f"count {p.name}…" for p in element.properties
    )
    rows = lines.parse()
    cursor, ends = rows.starts, rows.starts + rows.counts
    columns: dict[str, Column] = {}
    for column in element.properties:
        counts = np.ones(len(lines), dtype=np.int64)
        if column.count_type is not None:
            rows.require(cursor < ends, expected)
            counts = rows.whole(cursor, expected)
            rows.require(counts >= 0, expected)
            cursor = cursor + 1
        rows.require(cursor + counts <= ends, expected)
        columns[column.name] = Column(rows.values[spans(cursor, counts)], counts)
        cursor = cursor + counts
    rows.require(cursor == ends, expected)
    return Table(columns, lambda row: f"{lines.name}:{lines.numbers[row]}")


def _binary_tables(data: bytes, name: str, header: Header) -> dict[str, Table]:
    tables: dict[str, Table] = {}
    position = header.n_bytes
    for element in header.elements:
        uniform = _uniform_table(element, data, position, name)
        table, position = uniform or _mixed_table(element, data, position, name)
        tables[element.name] = table
    if data[position:].strip():
        raise FormatError(
            f"{name}: byte {position}: expected the end of the file, found {len(data) - position} more "
            "bytes; the counts in the header do not fit the data, export the file again"
        )
    return tables


def _uniform_table(element: Element, data: bytes, start: int, name: str) -> tuple[Table, int] | None:
    """Read a whole table at once, assuming that all its lists are as long as those of the first row.

    None if the assumption is wrong.
    """
    row_type = _type_of_first_row(element, data, start)
    end = start + element.n_rows * row_type.itemsize
    if not row_type.itemsize or not element.n_rows or end > len(data):
        return None
    rows = np.frombuffer(data, row_type, element.n_rows, start)
    columns: dict[str, Column] = {}
    for i, column in enumerate(element.properties):
        values = rows[f"values{i}"]
        counts = np.full(len(rows), values.shape[1], dtype=np.int64)
        if column.count_type is not None and (rows[f"count{i}"] != values.shape[1]).any():
            return None
        columns[column.name] = Column(values.ravel(), counts)
    return Table(columns, lambda row: f"{name}: byte {start + row * row_type.itemsize}"), end


def _type_of_first_row(element: Element, data: bytes, start: int) -> np.dtype[np.void]:
    fields: list[tuple[object, ...]] = []
    for i, column in enumerate(element.properties):
        count = 1
        if column.count_type is not None:
            position = start + np.dtype(fields).itemsize
            found = np.frombuffer(
                data[position : position + column.count_type.itemsize].ljust(8, b"\0"), column.count_type
            )
            count = int(found[0])
            if not 0 <= count * column.type.itemsize <= len(data):
                count = 0  # not plausible: the table is read row by row, which reports the error
            fields.append((f"count{i}", column.count_type))
        fields.append((f"values{i}", column.type, (count,)))
    return np.dtype(fields)


def _mixed_table(element: Element, data: bytes, start: int, name: str) -> tuple[Table, int]:
    """Read a table whose rows differ in length, row by row."""
    sizes = [column.type.itemsize for column in element.properties]
    readers = [
        column.count_type and struct.Struct(_struct_code(column.count_type)) for column in element.properties
    ]
    starts: list[list[int]] = [[] for _ in sizes]
    counts: list[list[int]] = [[] for _ in sizes]
    row_starts: list[int] = []
    position = start
    for row in range(element.n_rows if sizes else 0):
        row_starts.append(position)
        for i, (size, reader) in enumerate(zip(sizes, readers)):
            count = 1
            if reader:
                count = reader.unpack_from(data, position)[0] if position + reader.size <= len(data) else 0
                position += reader.size
            starts[i].append(position)
            counts[i].append(count)
            position += count * size
            if count < 0 or position > len(data):
                raise FormatError(
                    f"{name}: byte {row_starts[-1]}: expected {element.n_rows} rows of element "
                    f"{element.name}, found the end of the file in row {row}; it is cut short or damaged, "
                    "copy or export it again"
                )
    octets = np.frombuffer(data, np.uint8)
    columns: dict[str, Column] = {}
    for i, column in enumerate(element.properties):
        lengths = np.array(counts[i], dtype=np.int64)
        where = spans(np.array(starts[i], dtype=np.int64), lengths * sizes[i])
        columns[column.name] = Column(octets[where].view(column.type), lengths)
    return Table(columns, lambda row: f"{name}: byte {row_starts[row]}"), position


def _struct_code(count_type: np.dtype[np.generic]) -> str:
    order = ">" if count_type.byteorder == ">" else "<"
    # numpy may call 32-bit integers "l", which has 64 bits or another alignment in struct
    return order + count_type.char.replace("l", "i").replace("L", "I")
