"""The header of a PLY file, which declares the elements, their properties and the encoding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.assets.formats._text import TextLines, is_count, octets_of
from isomatch.errors import FormatError

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LONGEST_HEADER = 2**18  # bytes
MOST_DECLARED = 1000  # elements and properties; files in use have fewer than a hundred


@dataclass(frozen=True)
class Property:
    """One column of an element; a list if ``count_type`` is given."""

    name: str
    type: np.dtype[np.generic]
    count_type: np.dtype[np.generic] | None = None


@dataclass(frozen=True)
class Element:
    """A table of the file, such as ``vertex``: its name, number of rows and columns."""

    name: str
    n_rows: int
    properties: list[Property]


@dataclass(frozen=True)
class Header:
    """The contents of the header; ``n_lines`` and ``n_bytes`` are its own length.

    The byte order is that of `numpy.dtype`, or empty if the file is text. Comments are whole lines, ``obj_info`` too.
    """

    byte_order: str
    elements: tuple[Element, ...]
    n_lines: int
    n_bytes: int
    comments: tuple[str, ...] = ()


def read_header(data: bytes, name: str) -> Header:
    """Read the header of a PLY file."""
    lines, n_bytes = _header_lines(data, name)
    words = lines.row(1).split() if len(lines) > 1 else []
    if len(words) != 3 or words[0] != "format" or words[1] not in _BYTE_ORDERS:
        lines.fail(1, f"'format' and one of {', '.join(_BYTE_ORDERS)}")
    order = _BYTE_ORDERS[words[1]]
    elements: dict[str, Element] = {}
    properties: list[Property] = []
    comments: list[str] = []
    n_declared = 0
    for i in range(2, len(lines) - 1):
        words = lines.row(i).split()
        match words:
            case ["comment" | "obj_info", *_]:
                comments.append(lines.row(i))
                continue
            case ["element", element, n_rows] if is_count(n_rows) and element not in elements:
                properties = []
                elements[element] = Element(element, int(n_rows), properties)
            case ["property", "list", count, kind, column] if elements and _is_list(count, kind):
                properties.append(
                    Property(column, np.dtype(order + _TYPES[kind]), np.dtype(order + _TYPES[count]))
                )
            case ["property", kind, column] if elements and kind in _TYPES:
                properties.append(Property(column, np.dtype(order + _TYPES[kind])))
            case _:
                lines.fail(
                    i,
                    "a line 'element NAME COUNT' with a new name, 'property TYPE NAME' or "
                    "'property list TYPE TYPE NAME'",
                )
        n_declared += 1
        if n_declared > MOST_DECLARED:
            lines.fail(i, f"at most {MOST_DECLARED} elements and properties", "remove those not needed")
    return Header(order, tuple(elements.values()), len(lines), n_bytes, tuple(comments))


def _header_lines(data: bytes, name: str) -> tuple[TextLines, int]:
    """Return the lines up to ``end_header``, and their length in bytes."""
    mark = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    if data[mark : mark + 3].lower() != b"ply" or data[mark + 3 : mark + 4] not in (b"\n", b"\r", b" "):
        raise FormatError(
            f"{name}:1: expected 'ply', found {data[:10]!r}; give a PLY file, or rename this one"
        )
    mark = data.find(b"end_header", 0, LONGEST_HEADER)
    end = data.find(b"\r" if b"\n" not in data[:mark] else b"\n", mark)
    if mark < 0 or end < 0:
        raise FormatError(
            f"{name}:1: expected a header closed by 'end_header', found none in the first 256 KiB; copy the file again"
        )
    text = data[:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n").rstrip(b"\n") + b"\n"
    return TextLines(name, octets_of(text), np.arange(1, text.count(b"\n") + 1)), end + 1


def _is_list(count: str, kind: str) -> bool:
    return kind in _TYPES and _TYPES.get(count, "f") in ("i1", "u1", "i2", "u2", "i4", "u4")
