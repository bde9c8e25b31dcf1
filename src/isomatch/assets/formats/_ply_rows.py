"""The rows of a PLY element, written as text or binary from columns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch.assets.formats._ply_header import Property
from isomatch.assets.formats._text import interleaved, interleaved_lines, numbered
from isomatch.assets.polygons import spans
from isomatch.values.arrays import AnyArray, IntArray

_LETTERS = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint", "f4": "float",
    "f8": "double", "i8": "int64", "u8": "uint64",
}  # fmt: skip


@dataclass(frozen=True)
class Cells:
    """The values of one property in all rows, one after another; of a list also the number of each row."""

    declared: Property
    values: AnyArray
    counts: IntArray | None = None

    def at(self, rows: IntArray) -> Cells:
        """Return the values of some rows, in this order."""
        if self.counts is None:
            return replace(self, values=self.values[rows])
        starts = np.cumsum(self.counts) - self.counts
        return replace(
            self, values=self.values[spans(starts[rows], self.counts[rows])], counts=self.counts[rows]
        )

    @property
    def declaration(self) -> str:
        """The line of the header."""
        kind = _LETTERS[self.declared.type.str[1:]]
        if self.declared.count_type is None:
            return f"property {kind} {self.declared.name}"
        return f"property list {_LETTERS[self.declared.count_type.str[1:]]} {kind} {self.declared.name}"


def cells(name: str, values: AnyArray, counts: IntArray | None = None) -> Cells:
    """Make a column whose type is the smallest of PLY that holds the values."""
    count_type = None
    if counts is not None:
        count_type = np.dtype("u1" if counts.max(initial=0) < 256 else "i4")
    return Cells(Property(name, _type_of(values), count_type), values.ravel(), counts)


def holds(values: AnyArray) -> bool:
    """Whether PLY, which has no integers of 64 bits, holds values."""
    return values.dtype.kind in "biuf" and _type_of(values).str[1:] in set(_LETTERS) - {"i8", "u8"}


def _type_of(values: AnyArray) -> np.dtype[np.generic]:
    if values.dtype.kind in "biu" and values.dtype.itemsize in (1, 8):
        for kind in ("u1", "i1", "i4", "u4") if values.dtype.itemsize == 1 else ("i4", "u4"):
            limits = np.iinfo(kind)
            if limits.min <= values.min(initial=0) and values.max(initial=0) <= limits.max:
                return np.dtype(kind)
    if values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
        return np.dtype("f4" if values.dtype.itemsize == 2 else "f8")
    return values.dtype


def write_rows(columns: list[Cells], n_rows: int, byte_order: str) -> bytes:
    """Write the rows of an element; the byte order is that of binary files, ``"<"`` or ``">"``, and ``""`` of text."""
    fields: list[tuple[IntArray, AnyArray, str]] = []  # numbers in each row, all of them, their type
    for column in columns:
        each = np.ones(n_rows, dtype=np.int64)
        if column.counts is not None and column.declared.count_type is not None:
            fields.append((each, column.counts, column.declared.count_type.str[1:]))
            each = column.counts
        fields.append((each, column.values, column.declared.type.str[1:]))
    if not byte_order:
        return _text(fields, n_rows)
    if all((each == each[:1]).all() for each, _, _ in fields):
        row = [
            (f"{i}", byte_order + kind, (int(each[0]) if n_rows else 0,))
            for i, (each, _, kind) in enumerate(fields)
        ]
        rows = np.zeros(n_rows, row)
        for i, (_, values, _) in enumerate(fields):
            rows[f"{i}"] = values.reshape(rows[f"{i}"].shape)
        return rows.tobytes()
    octets = [
        (each * int(kind[1:]), np.ascontiguousarray(values, byte_order + kind).view(np.uint8))
        for each, values, kind in fields
    ]
    return interleaved(octets, n_rows, np.uint8).tobytes()


def _text(fields: list[tuple[IntArray, AnyArray, str]], n_rows: int) -> bytes:
    formats = {"f4": "%.9g", "f8": "%r"}
    words = [(each, numbered(values, formats.get(kind, "%d"))) for each, values, kind in fields]
    return interleaved_lines(words, n_rows)
