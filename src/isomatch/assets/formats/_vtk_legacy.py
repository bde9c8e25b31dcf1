"""Whether a legacy VTK file holds all that it declares; VTK itself does not ask, and can crash on one that does not."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from isomatch.errors import FormatError
from isomatch.values.arrays import AnyArray, IntArray
from isomatch.values.cached import cached_property

_HEADER = re.compile(
    rb"# vtk DataFile Version (?P<version>\d+)[^\n]*\n[^\n]*\n\s*(?P<encoding>ASCII|BINARY)[^\n]*\n", re.I
)
_TYPES = {
    "char": "i1", "unsigned_char": "u1", "short": ">i2", "unsigned_short": ">u2", "int": ">i4", "unsigned_int": ">u4",
    "long": ">i8", "unsigned_long": ">u8", "float": ">f4", "double": ">f8", "vtkidtype": ">i4", "vtktypeint64": ">i8",
    "vtktypeuint64": ">u8", "vtktypeint32": ">i4", "vtktypeuint32": ">u4",
}  # fmt: skip
_PER_ROW = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "GLOBAL_IDS": 1, "PEDIGREE_IDS": 1, "EDGE_FLAGS": 1}
_REST = "copy or export it again"


def require_complete(data: bytes, name: str) -> None:
    """Raise `FormatError` if an array of a legacy file is cut short, or its cells do not fit their declared number.

    What comes after a keyword or type that is not known here is not examined.
    """
    header = _HEADER.match(data)
    if header is None:
        return
    file = _Sections(name, data, header["encoding"].upper() == b"ASCII", header.end())
    try:
        _walk(file, int(header["version"]))
    except FormatError:
        raise
    except KeyError:  # a type that is not known here
        return
    except (ValueError, IndexError) as error:
        raise FormatError(
            f"{name}: byte {file.at}: expected a section of a legacy file, found {error}; {_REST}"
        ) from None


def _walk(file: _Sections, version: int) -> None:
    n_rows = 0
    while words := file.line():
        match [words[0].upper(), *words[1:]]:
            case ["POINTS", count, kind]:
                file.values(3 * int(count), kind)
            case ["VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" | "CELLS", count, size]:
                _walk_cells(file, int(count), int(size), version)
            case ["CELL_TYPES", count]:
                file.values(int(count), "int")
            case ["CELL_DATA" | "POINT_DATA", count]:
                n_rows = int(count)
            case ["SCALARS", _, kind, *width]:
                before = file.at
                if "".join(file.line()[:1]).upper() != "LOOKUP_TABLE":
                    file.at = before
                file.values(n_rows * int((width or ["1"])[0]), kind)
            case ["COLOR_SCALARS", _, width]:
                file.values(n_rows * int(width), "unsigned_char")
            case ["LOOKUP_TABLE", _, size]:
                file.values(4 * int(size), "unsigned_char")
            case ["TEXTURE_COORDINATES", _, width, kind]:
                file.values(n_rows * int(width), kind)
            case [keyword, _, kind] if keyword in _PER_ROW:
                file.values(n_rows * _PER_ROW[keyword], kind)
            case ["FIELD", _, count]:
                for _ in range(int(count)):
                    words = file.line()
                    if words[:1] == ["METADATA"]:  # of the array before
                        file.skip_metadata()
                        words = file.line()
                    _, width, rows, kind = words
                    file.values(int(width) * int(rows), kind)
            case ["METADATA"]:
                file.skip_metadata()
            case ["DATASET", _]:
                pass
            case _:
                return


def _walk_cells(file: _Sections, count: int, size: int, version: int) -> None:
    """Require that cells use their list of points up: since version 5 with offsets, before with a number before each."""
    if version >= 5:
        starts = file.values(count, file.line()[1])
        file.values(size, file.line()[1])
        whole = not count or (starts[0] == 0 and starts[-1] == size and (np.diff(starts) >= 0).all())
    else:
        numbers, at, cell = file.values(size, "int").tolist(), 0, 0
        while at < size and cell < count and numbers[at] >= 0:
            at, cell = at + 1 + int(numbers[at]), cell + 1
        whole = (at, cell) == (size, count)
    if not whole:
        raise FormatError(
            f"{file.name}: byte {file.at}: expected {count} cells in {size} numbers before it, found others; {_REST}"
        )


@dataclass
class _Sections:
    """A place in a legacy file."""

    name: str
    data: bytes
    is_text: bool
    at: int

    def line(self) -> list[str]:
        """Read the words of the next line that has some, none at the end."""
        found = re.compile(rb"\s*([^\n]*)\n?").match(self.data, self.at)
        self.at = found.end() if found else len(self.data)
        return found[1].decode("latin-1").split() if found else []

    def skip_metadata(self) -> None:
        """Go to the end of what is said of an array, which is a blank line."""
        end = re.compile(rb"\n[ \r]*\n").search(self.data, self.at - 1)
        self.at = end.end() if end else len(self.data)

    def values(self, n: int, kind: str) -> AnyArray:
        """Read numbers of a type."""
        dtype = np.dtype(_TYPES[kind.lower()])
        if self.is_text:
            starts, ends = self._words
            first = int(np.searchsorted(starts, self.at))
            if 0 <= n <= len(starts) - first:
                start, self.at = self.at, int(ends[first + n - 1]) if n else self.at
                return np.array(self.data[start : self.at].split(), dtype=np.float64)
        elif 0 <= n <= (len(self.data) - self.at) // dtype.itemsize:
            self.at += n * dtype.itemsize
            return np.frombuffer(self.data, dtype, n, self.at - n * dtype.itemsize)
        raise FormatError(
            f"{self.name}: byte {self.at}: expected {n} numbers, found the end of the file; it is cut short or "
            f"damaged, {_REST}"
        )

    @cached_property
    def _words(self) -> tuple[IntArray, IntArray]:
        """Where each word of a text starts and ends."""
        blank = np.array([chr(c).isspace() for c in range(256)])[np.frombuffer(self.data, np.uint8)]
        edges = np.flatnonzero(np.diff(blank, prepend=True, append=True))
        return edges[::2], edges[1::2]
