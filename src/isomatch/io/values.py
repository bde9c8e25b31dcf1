"""Files of values on points that hold no surface: tables, arrays, and those of GIFTI and FreeSurfer, by their suffix."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from itertools import dropwhile
from pathlib import Path

import numpy as np

from isomatch._core.arrays import AnyArray
from isomatch._core.errors import DescriptorError, FormatError
from isomatch._core.files import contents, replaced
from isomatch._core.texts import SEPARATORS, decoded, encoding_of, joined, separated
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute, Kind, guessed_kind, told_apart
from isomatch.io.formats import freesurfer, gifti
from isomatch.io.formats._reading import reading, unexpected
from isomatch.io.formats._text import number_of

_INDEX_NAMES = ("", "index", "vertex", "vertex_index", "point", "node", "unnamed: 0")
_BLANK = {"", "nan", "na", "n/a", "#n/a", "none", "null"}


@dataclass(frozen=True)
class ValuesFormat:
    """How values on points are read and written, and which have a place in the file."""

    # of the bytes of a file, its name, and the surface that they belong to, if that is known
    read: Callable[[bytes, str, Asset | None], tuple[Attribute, ...]]
    write: Callable[[Sequence[Attribute]], bytes]
    keeps: Callable[[Attribute], bool] = lambda attribute: attribute.domain != "corner"
    is_single: bool = False  # whether it holds only one attribute
    has_names: bool = False  # of labels


def holds_values(path: str | os.PathLike[str]) -> bool:
    """Whether a file of this name holds values, and no surface.

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
    """Read values on points from a file that holds no surface, or besides one: labels, scalars or vectors.

    Parameters
    ----------
    path : path_like
        GIFTI (``.shape.gii``, ``.func.gii``, ``.label.gii``), a FreeSurfer annotation or curvature (``lh.aparc.annot``,
        ``lh.curv``, ``lh.sulc``, ``lh.thickness``), a NumPy array ``.npy``, or columns of text in ``.csv``, ``.tsv`` or
        ``.txt``, with or without a line of names.
    surface : Asset, optional
        The surface that they belong to; `DescriptorError` if it has another number of points. Arrays and tables of one
        row for each of its polygons are then values on these; values of some points alone are spread over all.
    """
    path = Path(path)
    attributes = _format_of(path).read(contents(path), str(path), surface)
    return attributes if surface is None else tuple(_on(surface, each, path) for each in attributes)


def _on(surface: Asset, attribute: Attribute, path: Path) -> Attribute:
    """Return values of points or polygons, by the number of rows; those of welded points go to all."""
    n = len(attribute)
    if n == len(surface.points):
        return attribute
    if n == len(surface.polygons):
        return replace(attribute, domain="face")
    if n == surface.mesh.n_vertices:
        return attribute.at(surface.vertex_of_point)
    there = f"{len(surface.points)} points and {len(surface.polygons)} polygons"
    raise DescriptorError(f"{path}: {n} rows for a surface of {there}; give the values of this surface")


def write_attribute(path: str | os.PathLike[str], attribute: Attribute) -> None:
    """Write values as `write_attributes`; `FormatError` if the format has no place for them."""
    if attribute in write_attributes(path, [attribute]):
        raise FormatError(f"{path}: {attribute!r} has no place in a {Path(path).suffix} file")


def write_attributes(path: str | os.PathLike[str], attributes: Sequence[Attribute]) -> tuple[Attribute, ...]:
    """Write values to a file of their own, if it has a place for one; return what is not there, or "names of" one.

    An existing file is replaced. Numbers that seem to be labels are written as such where the format has only labels, and
    labels as numbers where it has only these. GIFTI has no place for skinning weights and for values of corners and
    faces, FreeSurfer but for labels (``.annot``) and scalars.
    """
    path = Path(path)
    values_format = _format_of(path)
    kept, left = list[Attribute](), list[Attribute]()
    for attribute in attributes:
        place = _placed(attribute, values_format)
        is_full = kept and (values_format.is_single or len(kept[0]) != len(attribute))
        if place is None or is_full:
            left.append(attribute)
            continue
        kept.append(place)
        if attribute.names and not (values_format.has_names and place.kind == "label"):
            left.append(replace(attribute, name=f"names of {attribute.name}"))
    if kept:
        data = values_format.write(kept)
        with replaced(path) as file:
            file.write(data)
    return tuple(left)


def _placed(attribute: Attribute, values_format: ValuesFormat) -> Attribute | None:
    """Return an attribute as the format keeps it; None if it does not."""
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
    """Read a ``.npy`` file of one row, number or text for each point."""
    with reading(name, "a .npy file of numbers or texts, without pickled objects"):
        values = np.load(BytesIO(data), allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.ndim not in (1, 2) or values.dtype.kind not in "fiubUS":
        expected = "an array (n,) or (n, k) of numbers or texts, a row for each point"
        raise FormatError(f"{name}: expected {expected}")
    values = np.char.decode(values, encoding_of(values.tobytes())) if values.dtype.kind == "S" else values
    values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
    title = Path(name).stem
    return (Attribute(title, "point", guessed_kind(title, values), values),)


def _write_array(attributes: Sequence[Attribute]) -> bytes:
    """Write the values of one attribute as a ``.npy`` file."""
    file = BytesIO()
    np.save(file, _words_or_numbers(*attributes), allow_pickle=False)
    return file.getvalue()


def _words_or_numbers(attribute: Attribute) -> AnyArray:
    return attribute.values if attribute.kind == "label" else attribute.plain


def _read_table(data: bytes, name: str, surface: Asset | None) -> tuple[Attribute, ...]:
    """Read columns of a text; those without a header are named by the file."""
    n_rows = (len(surface.points), len(surface.polygons)) if surface else ()
    rows, may_have_commas = _rows_of(decoded(data), name)
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        content = "rows of different lengths" if rows else "nothing"
        raise unexpected(name, "columns of one row for each point", content, "export it again")
    has_header = _has_header(rows, n_rows, may_have_commas)
    titles = rows.pop(0) if has_header else []
    stem = Path(name).stem
    columns = [_column(list(cells), may_have_commas) for cells in zip(*rows)]
    first = columns[0]  # named vertex, index or nothing, different whole numbers say which point a row is of
    is_named = len(columns) > 1 and has_header and titles[0].lower() in _INDEX_NAMES
    is_whole = first.dtype.kind == "i" and bool(first.min(initial=0) >= 0)
    is_index = is_named and is_whole and len(np.unique(first)) == len(first)
    titles = titles or ([stem] if len(columns) == 1 else [f"{stem}_{i}" for i in range(len(columns))])
    attributes = [
        Attribute(title or f"{stem}_{i}", "point", guessed_kind(title, column), column)
        for i, (title, column) in enumerate(zip(titles[is_index:], columns[is_index:]))
    ]
    if is_index:
        total = int(first.max(initial=-1)) + 1
        n = next((n for n in n_rows if n >= total), total)
        attributes = [each.spread(first, n) for each in attributes]
    return told_apart(attributes)


def _write_table(attributes: Sequence[Attribute], mark: str = ",") -> bytes:
    """Write a line of names, and a row for each point, with a mark between the columns."""
    names, columns = [], []
    for attribute in attributes:
        table = _words_or_numbers(attribute).reshape(len(attribute), -1)
        numbered = [f"{attribute.name}_{i}" for i in range(table.shape[1])]
        names += numbered if len(numbered) != 1 else [attribute.name]
        columns += table.T.tolist()
    return joined([names, *zip(*columns)], mark).encode(errors="backslashreplace")


def _rows_of(text: str, name: str) -> tuple[list[list[str]], bool]:
    """Split lines at a mark of the first one, or at blanks; say whether numbers may have decimal commas."""
    lines = [line for line in text.splitlines() if line.strip()]
    lines = list(dropwhile(lambda line: line.strip() == "#" or line.startswith("# "), lines))
    marks = [each for each in SEPARATORS if lines and each in lines[0]]
    if marks:
        rows, mark = separated("\n".join(lines), name, marks)
        return [row for _, row in rows], mark != ","
    words = [line.split() for line in lines]
    is_table = all(len(row) == len(words[0]) for row in words)
    return words if is_table else [[line.strip()] for line in lines], True


def _has_header(rows: list[list[str]], n_rows: Collection[int], may_have_commas: bool) -> bool:
    """Whether the first line is one of names, by the number of rows, if that is known, or by numbers that follow it."""

    def is_number(cell: str) -> bool:
        with suppress(ValueError):
            number_of(cell, may_have_commas)
            return True
        return False

    first, *others = rows
    if any(map(is_number, first)):
        return False
    if len(first) > 1 and first[0].lower() in _INDEX_NAMES:
        return True
    if (len(rows) in n_rows) != (len(rows) - 1 in n_rows):
        return len(rows) not in n_rows
    return bool(others) and (any(map(is_number, others[0])) or not any(row == first for row in others))


def _column(cells: list[str], may_have_commas: bool) -> AnyArray:
    """Return whole numbers, numbers with nan for blanks, or texts; commas are decimal if there are no points."""
    if any("_" in cell for cell in cells):
        return np.array(cells)
    with suppress(ValueError, OverflowError):
        return np.array([int(cell) for cell in cells], dtype=np.int64)
    has_commas = may_have_commas and not any("." in cell for cell in cells)
    with suppress(ValueError):
        return np.array([np.nan if cell.lower() in _BLANK else number_of(cell, has_commas) for cell in cells])
    return np.array(cells)


def _on_points(kind: Kind) -> Callable[[Attribute], bool]:
    return lambda attribute: (attribute.domain, attribute.kind) == ("point", kind)


_GIFTI = partial(ValuesFormat, gifti.read_attributes, gifti.write_attributes, has_names=True)
_FREESURFER = partial(
    ValuesFormat, freesurfer.read_attributes, freesurfer.write_attributes, is_single=True, has_names=True
)
VALUES_FORMATS = {
    ".gii": _GIFTI(gifti.keeps),
    ".annot": _FREESURFER(_on_points("label")),
    ".label.gii": _GIFTI(_on_points("label")),
    ".shape.gii": _GIFTI(_on_points("scalar")),
    **dict.fromkeys(freesurfer.VALUES, _FREESURFER(_on_points("scalar"))),
    ".npy": ValuesFormat(_read_array, _write_array, is_single=True),
    ".csv": ValuesFormat(_read_table, _write_table),
    **dict.fromkeys((".tsv", ".txt"), ValuesFormat(_read_table, partial(_write_table, mark="\t"))),
}
