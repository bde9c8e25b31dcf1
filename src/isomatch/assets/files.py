"""Assets from files and to files. The suffix of the name determines the format."""

from __future__ import annotations

import os

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute
from isomatch.assets.formats._by_suffix import read_contents, write_contents
from isomatch.errors import FormatError, InputError


def read_asset(path: str | os.PathLike[str]) -> Asset:
    r"""Read a surface file with its attributes and all else that it carries.

    Parameters
    ----------
    path : path_like
        File as for `read_mesh`.

    Returns
    -------
    Asset
        Points, polygons and attributes in the order of the file.

    Raises
    ------
    MissingFileError
        If there is no such file.
    FormatError
        If the suffix is unknown, or the file is damaged or not of that format.
    MissingDependencyError
        If the format needs a package that is not installed; the message names the extra.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "square.obj"
    >>> _ = path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng floor\nf 1 2 3 4\n")
    >>> read_asset(path)
    Asset(4 points, 1 polygons; group)
    """
    found = read_contents(path)
    try:
        return Asset.from_contents(found)
    except InputError as error:
        raise FormatError(f"{os.fspath(path)}: {error}") from None


def write_asset(path: str | os.PathLike[str], asset: Asset) -> tuple[Attribute, ...]:
    """Write an asset; an existing file is replaced, and an interrupted write leaves it intact.

    In the format that it was read from, all else that the file carried is written too: comments, materials, node
    transforms, skins and images.

    Parameters
    ----------
    path : path_like
        File as for `read_mesh`.
    asset : Asset
        The asset.

    Returns
    -------
    tuple of Attribute
        What is not in the file, because the format has no place for it.

    Raises
    ------
    FormatError
        If the suffix is unknown.
    UnwritableFileError
        If the file cannot be written.
    MissingDependencyError
        If the format needs a package that is not installed; the message names the extra.
    MeshError
        If the format cannot represent the surface.
    """
    return write_contents(path, asset)
