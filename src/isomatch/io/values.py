"""Files with values and no surface, by their suffix: tables, arrays, GIFTI and FreeSurfer."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from itertools import dropwhile
from pathlib import Path

import numpy as np

from isomatch._core.arrays import AnyArray, IntArray
from isomatch._core.errors import DescriptorError, FormatError
from isomatch._core.files import read_bytes, replaced
from isomatch._core.tables import NO_TEXT, Row, Table, parse_table
from isomatch._core.texts import decode_text, encoding_of, table_text
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute, Kind, guess_kind, number_equal_names
from isomatch.io.formats import freesurfer, gifti
from isomatch.io.formats._reading import reading, unexpected

# titles, in lower case, of a column with the numbers of vertices
_VERTEX_NAMES = ("vertex", "vertex_index", "vertex_id", "vertexid", "point", "point_id", "node")
# titles, in lower case, of a column with the numbers of faces
_FACE_NAMES = ("face", "face_index", "polygon", "polygon_index", "triangle", "cell", "element")
_INDEX_NAMES = ("index", "unnamed: 0", "id")  # titles of a column with numbers of vertices or of faces
_DOMAIN_OF_NAMES = {_VERTEX_NAMES: "vertex", _FACE_NAMES: "face"}  # what a column counts, by its title
# matches a number with separators of thousands, such as 1,234,567.8
_IN_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[.,]\d{3})*(?:[.,]\d+)?", re.ASCII)
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ValuesFormat:
    """Reader and writer of a format of values, and which attributes it keeps."""

    # function that reads the bytes of a file; it also takes its name and, if known, the surface of the values
    read: Callable[[bytes, str, Asset | None], tuple[Attribute, ...]]
    write: Callable[[Sequence[Attribute], Asset | None], bytes]
    keeps: Callable[[Attribute], bool] = lambda attribute: attribute.domain != "corner"
    is_single: bool = False  # whether a file holds only one attribute
    has_names: bool = False  # whether files keep names of labels


def holds_values(path: str | os.PathLike[str]) -> bool:
    """Whether a file with this name holds values and no surface.

    Examples
    --------
    >>> [holds_values(name) for name in ("lh.aparc.annot", "lh.pial", "a.surf.gii", "a.func.gii")]
    [True, False, False, True]
    """
    suffixes = [suffix.lower() for suffix in Path(path).suffixes[-2:]]
    if suffixes[-1:] == [".gii"]:
        return suffixes[0] in gifti.VALUES
    return suffixes[-1:] != [] and suffixes[-1] in VALUES_FORMATS


def read_attributes(path: str | os.PathLike[str], surface: Asset | None = None) -> tuple[Attribute, ...]:
    """Read values from a file without a surface: labels, scalars or vectors.

    Parameters
    ----------
    path : path_like
        GIFTI (``.shape.gii``, ``.func.gii``, ``.label.gii``), a FreeSurfer annotation or curvature (``lh.aparc.annot``,
        ``lh.curv``, ``lh.sulc``, ``lh.thickness``), a NumPy array ``.npy``, or columns of text in ``.csv``, ``.tsv`` or
        ``.txt``, with or without a line of names.
    surface : Asset, optional
        The surface of the values; `DescriptorError` if it has another number of points. Arrays and tables
        with a row for each polygon are values of polygons; values of some points are spread over all.
    """
    path = Path(path)
    attributes = _format_of(path).read(read_bytes(path), str(path), surface)
    if surface is None:
        return attributes
    return tuple(_fit_to_surface(surface, attribute, path) for attribute in attributes)


def _fit_to_surface(surface: Asset, attribute: Attribute, path: Path) -> Attribute:
    """Assign values to points or polygons by the number of rows; welded points share a row."""
    n = len(attribute)
    if n == len(surface.points):
        return attribute
    if n == len(surface.polygons):
        return replace(attribute, domain="face")
    if n == surface.mesh.n_vertices:
        return attribute.at(surface.vertex_of_point)
    numbers = f"{len(surface.points)} points and {len(surface.polygons)} polygons"
    raise DescriptorError(f"{path}: {n} rows for a surface of {numbers}; give the values of this surface")


def write_attribute(path: str | os.PathLike[str], attribute: Attribute) -> None:
    """Write values as `write_attributes`; `FormatError` if the format has no place for them."""
    if attribute in write_attributes(path, [attribute]):
        raise FormatError(f"{path}: {attribute!r} has no place in a {Path(path).suffix} file")


def write_attributes(
    path: str | os.PathLike[str], attributes: Sequence[Attribute], surface: Asset | None = None
) -> tuple[Attribute, ...]:
    """Write values to a file without a surface; return what it does not keep, or "names of" it.

    An existing file is replaced. A format with only labels takes numbers that seem to be labels, and one
    with only numbers takes labels. GIFTI keeps no skinning weights and no values of corners and faces,
    FreeSurfer only labels (``.annot``) and scalars. GIFTI names the anatomical structure of the
    ``surface``.
    """
    path = Path(path)
    values_format = _format_of(path)
    kept, left = list[Attribute](), list[Attribute]()
    for attribute in attributes:
        place = _convert(attribute, values_format)
        is_full = kept and (values_format.is_single or len(kept[0]) != len(attribute))
        if place is None or is_full:
            left.append(attribute)
            continue
        kept.append(place)
        if attribute.names and not (values_format.has_names and place.kind == "label"):
            left.append(replace(attribute, name=f"names of {attribute.name}"))
    if kept:
        data = values_format.write(kept, surface)
        with replaced(path) as file:
            file.write(data)
    return tuple(left)


def _convert(attribute: Attribute, values_format: ValuesFormat) -> Attribute | None:
    """Convert an attribute to a kind that the format keeps; None if there is none."""
    if values_format.keeps(attribute):
        return attribute
    if attribute.kind == "scalar" and attribute.seems_labels:
        codes = np.where(np.isnan(attribute.values), -1, attribute.values).astype(np.int64)
        other = replace(attribute, kind="label", values=codes)
    elif attribute.kind == "label":
        other = replace(attribute, kind="scalar", values=attribute.plain)
    else:
        return None
    return other if values_format.keeps(other) else None


def _format_of(path: Path) -> ValuesFormat:
    for suffix in sorted(VALUES_FORMATS, key=len, reverse=True):
        if path.name.lower().endswith(suffix):
            return VALUES_FORMATS[suffix]
    raise FormatError(f"{path}: no format of values; use one of {', '.join(VALUES_FORMATS)}")


def _read_array(data: bytes, name: str, surface: Asset | None) -> tuple[Attribute, ...]:
    """Read a ``.npy`` file with a row, number or text for each point."""
    with reading(name, "a .npy file of numbers or texts, without pickled objects"):
        values = np.load(BytesIO(data), allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.ndim not in (1, 2) or values.dtype.kind not in "fiubUS":
        expected = "an array (n,) or (n, k) of numbers or texts, a row for each point"
        raise FormatError(f"{name}: expected {expected}")
    values = np.char.decode(values, encoding_of(values.tobytes())) if values.dtype.kind == "S" else values
    values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
    title = Path(name).stem
    return (Attribute(title, "point", guess_kind(title, values), values),)


def _write_array(attributes: Sequence[Attribute], surface: Asset | None) -> bytes:
    """Write the values of one attribute as a ``.npy`` file."""
    file = BytesIO()
    np.save(file, _words_or_numbers(*attributes), allow_pickle=False)
    return file.getvalue()


def _words_or_numbers(attribute: Attribute) -> AnyArray:
    return attribute.values if attribute.kind == "label" else attribute.plain


def _read_table(data: bytes, name: str, surface: Asset | None) -> tuple[Attribute, ...]:
    """Read columns of text; without a header they are named after the file."""
    n_rows = (len(surface.points), len(surface.polygons)) if surface else ()
    table = parse_table(decode_text(data), name).titled({*_VERTEX_NAMES, *_FACE_NAMES}, n_rows=n_rows)
    if not table.filled:
        raise unexpected(name, "columns of one row for each point", "nothing", "export it again")
    table.require_width()
    table.require_one_reading()
    names = (*_VERTEX_NAMES, *_FACE_NAMES, *_INDEX_NAMES)
    index_column = table.column(*names) if table.width > 1 else None
    if index_column is None and table.width > 1 and table.titles[:1] == ("",):
        index_column = 0
    index = None if index_column is None else _index(table, index_column, n_rows)
    # Without a column of indices, an empty line is a row without a value.
    missing = Row(0, [], "")
    after = (table.rows + i * [missing] for i in range(table.n_empty_after + 1))
    choices = [*after, table.filled, [*dropwhile(lambda row: not row.cells, table.rows)]]
    rows = next((attribute for attribute in choices if len(attribute) in n_rows), choices[-1])
    table = replace(table, rows=table.filled if index else rows)
    titles, stem = table.titles, Path(name).stem
    titles = titles or ((stem,) if table.width == 1 else tuple(f"{stem}_{i}" for i in range(table.width)))
    columns = {i: _column(table, i) for i in range(table.width) if index is None or i != index_column}
    attributes = list[Attribute]()
    for i, column in columns.items():
        attribute = Attribute(titles[i] or f"{stem}_{i}", "point", guess_kind(titles[i], column), column)
        attributes.append(attribute.spread(*index) if index else attribute)
    return number_equal_names(attributes)


def _index(table: Table, column: int, n_rows: Sequence[int]) -> tuple[IntArray, int] | None:
    """Return the point or polygon of each row, from 0, and their number; None if a column has none."""
    title, rows = table.titles[column], table.filled
    what = next((domain for names, domain in _DOMAIN_OF_NAMES.items() if title.lower() in names), "")
    numbers = [table.integer(row.cells[column]) for row in rows]
    valid = [number for number in numbers if number is not None and number >= 0]
    bad = next((row for row, number in zip(rows, numbers) if number is None or number < 0), None)
    first = dict(zip(reversed(numbers), reversed(rows)))
    twice = next((row for row, number in zip(rows, numbers) if first[number] is not row), None)
    if not what and (bad or twice):
        return None
    if wrong := bad or twice:
        problem = f"is not of one {what}: {title!r} has whole numbers from 0, each once"
        table.refuse(wrong, f"{problem}; correct the line")
    most, least, count = max(valid), min(valid), len(valid)
    is_counted = [*range(1, count + 1)] == sorted(valid)
    if title.lower() == "id" and not (is_counted or [*range(count)] == sorted(valid)):
        return None
    faces = n_rows[1:] if what != "vertex" and (what or (count not in n_rows[:1] and count in n_rows)) else ()
    n = next(iter(faces or n_rows), count if is_counted else most + 1)
    base = int(least > 0 and (most == n or (is_counted and count == n)))
    last = rows[valid.index(most)]
    if most - base >= n:
        table.refuse(last, f"is of {title!r} {most}, and there are {n}; give the values of this surface")
    if is_counted and not base:
        problem = f"is the last of {title!r}, which may count from 0 or from 1 as there are {n}"
        table.refuse(last, f"{problem}; count from 0")
    logger.warning("%s: column %r is taken to count %s from %d", table.name, title, what or "rows", base)
    return np.array(valid) - base, n


def _write_table(attributes: Sequence[Attribute], surface: Asset | None, mark: str = ",") -> bytes:
    """Write a line of names and a row for each point, with a mark between the columns."""
    names, columns = [], []
    for attribute in attributes:
        table = _words_or_numbers(attribute).reshape(len(attribute), -1)
        numbered = [f"{attribute.name}_{i}" for i in range(table.shape[1])]
        names += numbered if len(numbered) != 1 else [attribute.name]
        columns += table.T.tolist()
    return table_text([names, *zip(*columns)], mark).encode(errors="backslashreplace")


def _column(table: Table, i: int) -> AnyArray:
    """Return a column as integers, floats with nan for no value, or texts."""
    cells = [row.cells[i] if i < len(row.cells) else "" for row in table.rows]
    numbers = [table.number(cell) for cell in cells]
    is_text = [number is None or re.fullmatch(r"[+-]?0\d+", cell) for cell, number in zip(cells, numbers)]
    if not any(is_text):
        whole = [table.integer(cell) if re.fullmatch(r"[+-]?\d+", cell) else None for cell in cells]
        return np.array(numbers, dtype=np.float64) if None in whole else np.array(whole, dtype=np.int64)
    fractions = [number for number in numbers if number is not None and np.isfinite(number) and number % 1]
    texts = [cell for cell, number in zip(cells, numbers) if number is None]
    if fractions or all(map(_IN_THOUSANDS.fullmatch, texts)):
        table.numbers(i)  # raises an error that quotes the first text
    return np.array(["" if cell.lower() in NO_TEXT else cell for cell in cells])


def _on_points(*kinds: Kind) -> Callable[[Attribute], bool]:
    return lambda attribute: attribute.domain == "point" and attribute.kind in kinds


_GIFTI = partial(ValuesFormat, gifti.read_attributes, gifti.write_attributes, has_names=True)
_FREESURFER = partial(  # the formats of FreeSurfer
    ValuesFormat, freesurfer.read_attributes, freesurfer.write_attributes, is_single=True, has_names=True
)
VALUES_FORMATS = {  # the format of files with a suffix
    ".gii": _GIFTI(gifti.keeps),
    ".annot": _FREESURFER(_on_points("label")),
    ".func.gii": _GIFTI(_on_points("scalar", "label")),
    ".label.gii": _GIFTI(_on_points("label")),
    ".rgba.gii": _GIFTI(_on_points("colour"), is_single=True),
    ".shape.gii": _GIFTI(_on_points("scalar")),
    **dict.fromkeys(freesurfer.VALUES, _FREESURFER(_on_points("scalar"))),
    ".npy": ValuesFormat(_read_array, _write_array, is_single=True),
    ".csv": ValuesFormat(_read_table, _write_table),
    **dict.fromkeys((".tsv", ".txt"), ValuesFormat(_read_table, partial(_write_table, mark="\t"))),
}
