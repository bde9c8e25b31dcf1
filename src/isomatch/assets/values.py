"""Files of values on points that hold no surface. The suffix of the name determines the format."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute, Kind
from isomatch.assets.formats import freesurfer, gifti, tables
from isomatch.errors import DescriptorError, FormatError
from isomatch.storage.files import opened, replaced


@dataclass(frozen=True)
class ValuesFormat:
    """How values on points are read and written, and which have a place in the file."""

    # of the bytes of a file, its name, and the surface that they belong to, if that is known
    read: Callable[[bytes, str, Asset | None], tuple[Attribute, ...]]
    write: Callable[[Sequence[Attribute]], bytes]
    keeps: Callable[[Attribute], bool]
    is_single: bool = False  # whether it holds only one attribute
    has_names: bool = False  # of labels


def _gifti(*kinds: Kind) -> ValuesFormat:
    return ValuesFormat(
        lambda data, name, surface: gifti.read_attributes(
            data, name, len(surface.points) if surface else None
        ),
        gifti.write_attributes,
        lambda attribute: gifti.keeps(attribute) and (not kinds or attribute.kind in kinds),
        has_names=True,
    )


def _freesurfer(kind: Kind) -> ValuesFormat:
    return ValuesFormat(
        lambda data, name, surface: freesurfer.read_attributes(data, name),
        lambda attributes: freesurfer.write_attribute(*attributes),
        lambda attribute: (attribute.domain, attribute.kind) == ("point", kind),
        is_single=True,
        has_names=True,
    )


def _table(mark: str) -> ValuesFormat:
    return ValuesFormat(
        lambda data, name, surface: tables.read_table(
            data, name, (len(surface.points), len(surface.polygons)) if surface else ()
        ),
        lambda attributes: tables.write_table(attributes, mark),
        lambda attribute: attribute.domain != "corner",
    )


VALUES_FORMATS = {
    ".gii": _gifti(),
    ".annot": _freesurfer("label"),
    ".label.gii": _gifti("label"),
    ".shape.gii": _gifti("scalar"),
    **dict.fromkeys(freesurfer.VALUES, _freesurfer("scalar")),
    ".npy": ValuesFormat(
        lambda data, name, surface: tables.read_array(data, name),
        tables.write_array,
        lambda attribute: attribute.domain != "corner",
        is_single=True,
    ),
    ".csv": _table(","),
    ".tsv": _table("\t"),
    ".txt": _table("\t"),
}


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
    values_format = _format_of(path)
    with opened(path) as file:
        found = values_format.read(file.read(), str(path), surface)
    return found if surface is None else tuple(_on(surface, attribute, path) for attribute in found)


def _on(surface: Asset, attribute: Attribute, path: Path) -> Attribute:
    """Return values of points or polygons, by the number of rows; those of welded points go to all."""
    n = len(attribute)
    if n == len(surface.points):
        return attribute
    if n == len(surface.polygons):
        return replace(attribute, domain="face")
    if n == surface.mesh.n_vertices:
        return attribute.at(surface.vertex_of_point)
    raise DescriptorError(
        f"{path}: {n} rows for a surface of {len(surface.points)} points and {len(surface.polygons)} polygons; give the "
        "values of this surface"
    )


def write_attribute(path: str | os.PathLike[str], attribute: Attribute) -> None:
    """Write values as `write_attributes`; `FormatError` if the format has no place for them."""
    if attribute in write_attributes(path, [attribute]):
        raise FormatError(f"{path}: {attribute!r} has no place in a {Path(path).suffix} file")


def write_attributes(path: str | os.PathLike[str], attributes: Sequence[Attribute]) -> tuple[Attribute, ...]:
    """Write values to a file of their own, if it has a place for at least one; return what is not there, or "names of" one.

    An existing file is replaced. Numbers that seem to be labels are written as such where the format has only labels, and
    labels as numbers where it has only these. GIFTI has no place for skinning weights and for values of corners and
    faces, FreeSurfer but for labels (``.annot``) and scalars.
    """
    path = Path(path)
    values_format = _format_of(path)
    kept: list[Attribute] = []
    left: list[Attribute] = []
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
    name = path.name.lower()
    for suffix in sorted(VALUES_FORMATS, key=len, reverse=True):
        if name.endswith(suffix):
            return VALUES_FORMATS[suffix]
    raise FormatError(f"{path}: no format of values; use one of {', '.join(VALUES_FORMATS)}")
