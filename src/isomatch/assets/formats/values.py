"""Files of values on points that hold no surface. The suffix of the name determines the format."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from isomatch._files import opened, replaced
from isomatch.assets.attribute import Attribute
from isomatch.assets.formats import freesurfer, gifti
from isomatch.errors import FormatError

ATTRIBUTE_FORMATS: dict[str, tuple[Callable[[bytes, str], tuple[Attribute, ...]], Callable[..., bytes]]] = {
    ".gii": (gifti.read_attributes, gifti.write_attribute),
    ".annot": (freesurfer.read_attributes, freesurfer.write_attribute),
    **dict.fromkeys(freesurfer.VALUES, (freesurfer.read_attributes, freesurfer.write_attribute)),
}
"""How files of each suffix are read and written that hold values on points but no surface."""


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
    read, _ = _attribute_format_of(path)
    with opened(path) as file:
        return read(file.read(), str(path))


def write_attribute(path: str | os.PathLike[str], attribute: Attribute) -> None:
    """Write values on points to a file of their own, see `read_attributes`; an existing file is replaced.

    Raises
    ------
    FormatError
        If the suffix is unknown, or its format has no place for the attribute: GIFTI has none for skinning weights and
        for values of corners and faces, FreeSurfer but for labels (``.annot``) and scalars.
    """
    path = Path(path)
    _, write = _attribute_format_of(path)
    suffix = path.suffix.lower()
    if suffix == ".gii":
        fits = gifti.keeps(attribute)
    else:
        fits = attribute.domain == "point" and attribute.kind == ("label" if suffix == ".annot" else "scalar")
    if not fits:
        raise FormatError(f"{path}: {attribute!r} has no place in a {path.suffix} file")
    data = write(attribute)
    with replaced(path) as file:
        file.write(data)


def _attribute_format_of(
    path: Path,
) -> tuple[Callable[[bytes, str], tuple[Attribute, ...]], Callable[..., bytes]]:
    try:
        return ATTRIBUTE_FORMATS[path.suffix.lower()]
    except KeyError:
        raise FormatError(f"{path}: no format of values; use one of {', '.join(ATTRIBUTE_FORMATS)}") from None
