"""The tables of a PLY file, read from text or binary data into columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from isomatch.assets.formats._ply_header import Element, Header
from isomatch.assets.formats._text import TextLines, read_lines
from isomatch.assets.polygons import spans
from isomatch.errors import FormatError
from isomatch.loading.compiled import compiled
from isomatch.values.arrays import AnyArray, IntArray

ROWS_AT_ONCE = 10_000  # that are read row by row, with two integers for each list
LONGEST_TYPE = 2**31 - 1  # bytes of a numpy type


@dataclass(frozen=True)
class Column:
    """The values of one property in the order of the rows; ``counts`` is the number of values of each row."""

    values: AnyArray
    counts: IntArray


@dataclass(frozen=True)
class Table:
    """The columns of an element, by name; ``place(row)`` is the position of a row in the file, for messages."""

    columns: dict[str, Column]
    place: Callable[[int], str]


def read_tables(data: bytes, name: str, header: Header) -> dict[str, Table]:
    """Read every element that is declared in the header."""
    return _binary_tables(data, name, header) if header.byte_order else _text_tables(data, name, header)


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
        tables[element.name] = _text_table(element, lines, start, stop)
        start = stop
    if start != len(lines):
        lines.fail(
            start, "no line after the elements declared in the header", "correct the counts in the header"
        )
    return tables


def _text_table(element: Element, lines: TextLines, start: int, stop: int) -> Table:
    parts = (
        _text_columns(element, lines[first : min(first + ROWS_AT_ONCE, stop)])
        for first in range(start, stop, ROWS_AT_ONCE)
    )
    name, numbers = lines.name, lines.numbers
    return Table(_joined(element, parts), lambda row: f"{name}:{numbers[start + row]}")


def _text_columns(element: Element, lines: TextLines) -> list[Column]:
    expected = f"{element.name}: " + " ".join(
        p.name if p.count_type is None else f"count {p.name}…" for p in element.properties
    )
    rows = lines.parse()
    cursor, ends = rows.starts, rows.starts + rows.counts
    columns = []
    for column in element.properties:
        rows.require(cursor < ends, expected)
        counts = _repeated(1, len(lines))
        where = cursor
        if column.count_type is not None:
            counts = rows.whole(cursor, expected)
            rows.require((counts >= 0) & (counts < ends - cursor), expected)
            where = spans(cursor + 1, counts)
            cursor = cursor + 1
        columns.append(Column(rows.values[where], counts))
        cursor = cursor + counts
    rows.require(cursor == ends, expected)
    return columns


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
    if row_type is None or not row_type.itemsize or not element.n_rows:
        return None
    end = start + element.n_rows * row_type.itemsize
    if end > len(data):
        return None
    rows = np.frombuffer(data, row_type, element.n_rows, start)
    columns: dict[str, Column] = {}
    for i, column in enumerate(element.properties):
        values = rows[f"values{i}"]
        if column.count_type is not None and (rows[f"count{i}"] != values.shape[1]).any():
            return None
        columns[column.name] = Column(values, _repeated(values.shape[1], len(rows)))
    return Table(columns, lambda row: f"{name}: byte {start + row * row_type.itemsize}"), end


def _type_of_first_row(element: Element, data: bytes, start: int) -> np.dtype[np.void] | None:
    """Type of the first row; None if the data end before it, or it is too long for a type."""
    fields: list[tuple[object, ...]] = []
    position = start
    for i, column in enumerate(element.properties):
        count = 1
        if column.count_type is not None:
            after = position + column.count_type.itemsize
            if after > len(data):
                return None
            count = int(np.frombuffer(data[position:after], column.count_type)[0])
            fields.append((f"count{i}", column.count_type))
            position = after
        position += count * column.type.itemsize
        if count < 0 or position > min(len(data), start + LONGEST_TYPE):
            return None
        fields.append((f"values{i}", column.type, (count,)))
    return np.dtype(fields)


def _mixed_table(element: Element, data: bytes, start: int, name: str) -> tuple[Table, int]:
    """Read a table whose rows differ in length, row by row."""
    position = start

    def parts() -> Iterator[list[Column]]:
        nonlocal position
        for first in range(0, element.n_rows if element.properties else 0, ROWS_AT_ONCE):
            part, position = _mixed_columns(element, first, data, position, name)
            yield part

    columns = _joined(element, parts())

    def place(row: int) -> str:
        before = start
        for column in element.properties:
            before += int(columns[column.name].counts[:row].sum()) * column.type.itemsize
            before += row * column.count_type.itemsize if column.count_type else 0
        return f"{name}: byte {before}"

    return Table(columns, place), position


def _mixed_columns(
    element: Element, first: int, data: bytes, position: int, name: str
) -> tuple[list[Column], int]:
    """Read some rows, from row ``first`` at a position in the file, which is returned for the rows after them."""
    octets = np.frombuffer(data, np.uint8)
    sizes = np.array([column.type.itemsize for column in element.properties])
    count_types = [column.count_type or np.dtype("V0") for column in element.properties]
    count_sizes = np.array([count_type.itemsize for count_type in count_types])
    most = (len(data) - position) // int(np.where(count_sizes, count_sizes, sizes).sum()) + 1
    n_rows = min(ROWS_AT_ONCE, element.n_rows - first, most)
    starts, counts = np.zeros((2, n_rows, len(sizes)), dtype=np.int64)
    n_found, position = _locate(
        octets,
        position,
        sizes,
        count_sizes,
        np.array([count_type.kind == "i" for count_type in count_types]),
        any(count_type.byteorder == ">" for count_type in count_types),
        starts,
        counts,
    )
    if n_found < n_rows:
        raise FormatError(
            f"{name}: byte {position}: expected {element.n_rows} rows of element {element.name}, found the end of "
            f"the file in row {first + n_found}; it is cut short or damaged, copy or export it again"
        )
    columns = []
    for i, column in enumerate(element.properties):
        where = spans(starts[:, i], counts[:, i] * sizes[i])
        columns.append(Column(octets[where].view(column.type), counts[:, i].copy()))
    return columns, position


@compiled()
def _locate(
    octets: AnyArray,
    position: int,
    sizes: IntArray,
    count_sizes: IntArray,
    signed: AnyArray,
    big_endian: bool,
    starts: IntArray,
    counts: IntArray,
) -> tuple[int, int]:
    """Find the values of each row and property, up to a row that is cut short; return it, or the end, and its place.

    ``sizes`` are those of one value of each property, ``count_sizes`` those of the count before it, 0 of no list.
    """
    for row in range(len(starts)):
        row_start = position
        for i in range(len(sizes)):
            size, count = count_sizes[i], 1
            if size:
                position += size
                count = 0
                if position <= len(octets):
                    for k in range(1, size + 1):
                        count = 256 * count + octets[position - size - 1 + k if big_endian else position - k]
                    if signed[i] and count >> (8 * size - 1):
                        count -= 1 << (8 * size)
            starts[row, i], counts[row, i] = position, count
            position += count * sizes[i]
            if count < 0 or position > len(octets):
                return row, row_start
    return len(starts), position


def _joined(element: Element, parts: Iterable[list[Column]]) -> dict[str, Column]:
    """Join the columns of the parts of a table."""
    no_rows = [Column(np.zeros(0), np.zeros(0, dtype=np.int64))] * len(element.properties)
    columns: dict[str, Column] = {}
    for column, same in zip(element.properties, zip(*(list(parts) or [no_rows]))):
        values = np.concatenate([part.values for part in same])
        counts = _repeated(1, len(values))
        if column.count_type is not None:
            counts = np.concatenate([part.counts for part in same])
        columns[column.name] = Column(values, counts)
    return columns


def _repeated(count: int, n: int) -> IntArray:
    """Return the same count n times, without memory for each."""
    counts: IntArray = np.broadcast_to(np.int64(count), n)
    return counts
