"""Files of values on points that hold no surface. The suffix of the name determines the format."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from isomatch.assets.attribute import Attribute, Kind
from isomatch.assets.formats import freesurfer, gifti
from isomatch.errors import FormatError
from isomatch.storage.files import opened, replaced


class ValuesFormat(NamedTuple):
    """How values on points are read and written, and which have a place in the file."""

    read: Callable[[bytes, str], tuple[Attribute, ...]]
    write: Callable[[Attribute], bytes]
    keeps: Callable[[Attribute], bool]


def _freesurfer(kind: Kind) -> ValuesFormat:
    def keeps(attribute: Attribute) -> bool:
        return (attribute.domain, attribute.kind) == ("point", kind)

    return ValuesFormat(freesurfer.read_attributes, freesurfer.write_attribute, keeps)


VALUES_FORMATS = {
    ".gii": ValuesFormat(gifti.read_attributes, lambda a: gifti.write_attributes([a]), gifti.keeps),
    ".annot": _freesurfer("label"),
    **dict.fromkeys(freesurfer.VALUES, _freesurfer("scalar")),
}


def read_attributes(path: str | os.PathLike[str]) -> tuple[Attribute, ...]:
    """Read values on points from a file that holds no surface, or besides one.

    Parameters
    ----------
    path : path_like
        GIFTI (``.shape.gii``, ``.func.gii``, ``.label.gii``) or a FreeSurfer annotation or curvature (``lh.aparc.annot``,
        ``lh.curv``, ``lh.sulc``, ``lh.thickness``).

    Returns
    -------
    tuple of Attribute
        Labels with names and colours, scalars or vectors, one row for each point of the surface they belong to.

    Raises
    ------
    FormatError, MissingDependencyError
        As `read_mesh`.
    """
    path = Path(path)
    values_format = _format_of(path)
    with opened(path) as file:
        return values_format.read(file.read(), str(path))


def write_attribute(path: str | os.PathLike[str], attribute: Attribute) -> None:
    """Write values on points to a file of their own, see `read_attributes`; an existing file is replaced.

    Raises
    ------
    FormatError
        If the suffix is unknown, or its format has no place for the attribute: GIFTI has none for skinning weights and
        for values of corners and faces, FreeSurfer but for labels (``.annot``) and scalars.
    """
    path = Path(path)
    values_format = _format_of(path)
    if not values_format.keeps(attribute):
        raise FormatError(f"{path}: {attribute!r} has no place in a {path.suffix} file")
    data = values_format.write(attribute)
    with replaced(path) as file:
        file.write(data)


def _format_of(path: Path) -> ValuesFormat:
    try:
        return VALUES_FORMATS[path.suffix.lower()]
    except KeyError:
        raise FormatError(f"{path}: no format of values; use one of {', '.join(VALUES_FORMATS)}") from None
