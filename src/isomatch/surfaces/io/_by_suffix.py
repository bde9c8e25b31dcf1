"""Reading and writing of mesh files. The suffix of the name determines the format."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isomatch._files import opened, replaced
from isomatch.errors import DescriptorError, FormatError
from isomatch.surfaces.io import obj, off, ply, stl
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.point_cloud import PointCloud


@dataclass(frozen=True)
class MeshFormat:
    """How one format is read and written.

    Parameters
    ----------
    read : callable
        Makes a mesh of the bytes of a file and its name, which is for messages.
    write : callable
        Makes bytes of a mesh and of those options of `write_mesh` that the format has, by keyword.
    options : frozenset of str
        Names of these options: ``"binary"``, ``"colors"``.
    """

    read: Callable[[bytes, str], Mesh]
    write: Callable[..., bytes]
    options: frozenset[str] = frozenset()


FORMATS: dict[str, MeshFormat] = {
    ".off": MeshFormat(off.read, off.write),
    ".obj": MeshFormat(obj.read, obj.write, frozenset({"colors"})),
    ".ply": MeshFormat(ply.read, ply.write, frozenset({"binary", "colors"})),
    ".stl": MeshFormat(stl.read, stl.write, frozenset({"binary"})),
}
"""The format of each suffix, in lower case and with its dot. To add a format, add an entry."""


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    r"""Read a triangle mesh from an OFF, OBJ, PLY or STL file.

    The vertices have the same order and number as in the file, so indices into the file remain valid. Polygons are
    split into fans of triangles, in order. A file without faces gives a mesh of 0 faces. The surface is not examined
    for defects; see `check`.

    Parameters
    ----------
    path : path_like
        File with suffix ``.off``, ``.obj``, ``.ply`` or ``.stl``, in upper or lower case.

    Returns
    -------
    Mesh
        The mesh, in the units of the file.

    Raises
    ------
    MissingFileError
        If there is no such file.
    FormatError
        If the suffix is unknown, or the file cannot be opened, is cut short, or is not of that format. A message
        about its content starts with ``file:line:`` (text) or ``file: byte N:`` (binary).

    Notes
    -----
    Linear time: for 655 000 vertices 0.1 s from binary PLY, 0.3 s from OBJ, OFF and text PLY, 0.5 s from binary STL. The
    file is read into memory. Numbers in text become the nearest floats. STL files do not store connectivity: corners at
    exactly the same position become one vertex, and vertices are numbered in order of first appearance.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "triangle.off"
    >>> _ = path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    >>> read_mesh(path)
    Mesh(3 vertices, 1 faces)
    """
    path = Path(path)
    mesh_format = _format_of(path)
    with opened(path) as file:
        return mesh_format.read(file.read(), str(path))


def read_point_cloud(path: str | os.PathLike[str], n_neighbours: int = 30) -> PointCloud:
    r"""Read the vertices of a file as a point cloud; faces are ignored.

    Parameters
    ----------
    path : path_like
        File as for `read_mesh`.
    n_neighbours : int
        See `PointCloud`.

    Returns
    -------
    PointCloud
        The points, in the units and order of the file.

    Raises
    ------
    MissingFileError, FormatError
        As `read_mesh`.
    MeshError
        If the points do not make a point cloud; see `PointCloud`.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "points.obj"
    >>> _ = path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n")
    >>> read_point_cloud(path)
    PointCloud(4 points, 30 neighbours)
    """
    return PointCloud(read_mesh(path).vertices, n_neighbours)


def write_mesh(
    path: str | os.PathLike[str],
    mesh: Mesh,
    *,
    binary: bool | None = None,
    colors: ArrayLike | None = None,
) -> None:
    """Write a mesh to an OFF, OBJ, PLY or STL file; an existing file is replaced.

    The data is written to a temporary file, which is then renamed, so an interrupted write leaves an existing file
    intact.

    Parameters
    ----------
    path : path_like
        File with suffix ``.off``, ``.obj``, ``.ply`` or ``.stl``, in upper or lower case.
    mesh : Mesh
        The mesh.
    binary : bool, optional
        For PLY and STL only: whether to write binary (the default) or text.
    colors : (n, 3) array_like of uint8, optional
        For PLY and OBJ only: red, green and blue of each vertex, 0…255.

    Raises
    ------
    FormatError
        If the suffix is unknown, or the format does not have a requested option.
    UnwritableFileError
        If the file cannot be written.
    DescriptorError
        If the colours do not fit the mesh.
    MeshError
        If the format cannot represent the mesh.

    Notes
    -----
    `read_mesh` returns exactly the same float64 coordinates, except from binary STL, which stores float32. STL also
    loses the order of the vertices, and vertices that no face uses.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "triangle.ply"
    >>> write_mesh(path, Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> read_mesh(path).vertices[1].tolist()
    [1.0, 0.0, 0.0]
    """
    path = Path(path)
    mesh_format = _format_of(path)
    options: dict[str, object] = {}
    if binary is not None:
        options["binary"] = binary
    if colors is not None:
        options["colors"] = _vertex_colors(colors, mesh.n_vertices)
    for option in sorted(options.keys() - mesh_format.options):
        able = ", ".join(suffix for suffix, other in FORMATS.items() if option in other.options)
        raise FormatError(f"{path}: a {path.suffix} file has no option {option!r}; use one of {able}")
    data = mesh_format.write(mesh, **options)
    with replaced(path) as file:
        file.write(data)


def _format_of(path: Path) -> MeshFormat:
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        found = f"suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise FormatError(f"{path}: {found} is not a mesh format; use one of {', '.join(FORMATS)}") from None


def _vertex_colors(colors: ArrayLike, n_vertices: int) -> NDArray[np.uint8]:
    array = np.asarray(colors)
    if array.shape != (n_vertices, 3) or array.dtype != np.uint8:
        raise DescriptorError(
            f"colors have shape {array.shape} and type {array.dtype}, expected ({n_vertices}, 3) and uint8: "
            "red, green and blue from 0 to 255 per vertex"
        )
    return array
