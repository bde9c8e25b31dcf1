"""Reading and writing of mesh files. The suffix of the name determines the format."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import replace as with_changes
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from isomatch._files import opened, replaced
from isomatch.assets.attribute import Attribute, told_apart
from isomatch.assets.contents import Contents
from isomatch.assets.formats import freesurfer, gifti, gltf, obj, off, ply, stl, vtk
from isomatch.assets.seams import merged_corners
from isomatch.errors import DescriptorError, FormatError, InputError
from isomatch.surfaces import Mesh, PointCloud


@dataclass(frozen=True)
class MeshFormat:
    """How one format is read and written.

    Parameters
    ----------
    read : callable
        Makes a mesh of the bytes of a file and its name, which is for messages.
    write : callable
        Makes bytes of `Contents` and of those options of `write_mesh` that the format has, by keyword.
    options : frozenset of str
        Names of these options: ``"binary"``.
    read_contents : callable, optional
        Makes `Contents` of the bytes of a file and its name; by default points and triangles alone.
    keeps : callable, optional
        Whether the format has a place for an attribute; by default it has none.
    single : frozenset of str
        Kinds of attributes of which it has only one.
    has_parts : bool
        Whether it stores parts and their transforms.
    """

    read: Callable[[bytes, str], Mesh]
    write: Callable[..., bytes]
    options: frozenset[str] = frozenset()
    read_contents: Callable[[bytes, str], Contents] | None = None
    keeps: Callable[[Attribute], bool] = lambda attribute: False
    single: frozenset[str] = frozenset()
    has_parts: bool = False


def _with_attributes(
    read_contents: Callable[[bytes, str], Contents],
    write: Callable[..., bytes],
    keeps: Callable[[Attribute], bool] = lambda attribute: False,
    options: frozenset[str] = frozenset(),
    has_parts: bool = False,
) -> MeshFormat:
    """Make a format whose meshes are read with all that the file holds."""

    def read(data: bytes, name: str) -> Mesh:
        contents = _checked(read_contents, data, name)
        return Mesh(contents.placed_points, contents.polygons.triangles)

    return MeshFormat(read, write, options, read_contents, keeps, has_parts=has_parts)


_BINARY = frozenset({"binary"})

FORMATS: dict[str, MeshFormat] = {
    ".off": MeshFormat(
        off.read,
        off.write,
        read_contents=off.read_contents,
        keeps=off.keeps,
        single=frozenset({"colour", "normal"}),
    ),
    ".obj": MeshFormat(
        obj.read,
        obj.write,
        read_contents=obj.read_contents,
        keeps=obj.keeps,
        single=frozenset({"colour", "uv", "normal"}),
    ),
    ".ply": MeshFormat(ply.read, ply.write, _BINARY, ply.read_contents, ply.keeps),
    ".stl": MeshFormat(stl.read, stl.write, _BINARY),
    ".glb": _with_attributes(gltf.read_contents, gltf.write_glb, gltf.keeps, has_parts=True),
    ".gltf": _with_attributes(gltf.read_contents, gltf.write_gltf, gltf.keeps, has_parts=True),
    ".vtk": _with_attributes(vtk.read_vtk, vtk.write_vtk, vtk.keeps, _BINARY),
    ".vtp": _with_attributes(vtk.read_vtp, vtk.write_vtp, vtk.keeps, _BINARY),
    ".vtu": _with_attributes(vtk.read_vtu, vtk.write_vtu, vtk.keeps, _BINARY),
    ".gii": _with_attributes(gifti.read_contents, gifti.write, gifti.keeps),
    **dict.fromkeys(freesurfer.SURFACES, _with_attributes(freesurfer.read_contents, freesurfer.write)),
}
"""The format of each suffix, in lower case and with its dot. To add a format, add an entry."""


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    r"""Read a triangle mesh from a file.

    The vertices have the same order and number as in the file, so indices into the file remain valid. Polygons are
    split into fans of triangles, in order. A file without faces gives a mesh of 0 faces. The surface is not examined
    for defects; see `check`.

    Parameters
    ----------
    path : path_like
        File with a suffix of `FORMATS`, in upper or lower case: OFF, OBJ, PLY, STL, glTF and GLB; with the extra ``io``
        VTU, GIFTI and FreeSurfer (``lh.pial``, ``rh.white``, …); with the extra ``vtk`` VTP and VTK.

    Returns
    -------
    Mesh
        The mesh, in the units of the file; the meshes of a glTF file one after another, where its nodes put them.

    Raises
    ------
    MissingFileError
        If there is no such file.
    FormatError
        If the suffix is unknown, or the file cannot be opened, is cut short, or is not of that format. A message
        about its content starts with ``file:line:`` (text) or ``file: byte N:`` (binary).

    Notes
    -----
    Linear time: for 655 000 vertices 0.02 s from binary PLY, 0.3 s from OBJ, OFF and text PLY, 0.5 s from binary STL. The
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
    """Write a mesh to a file; an existing file is replaced.

    The data is written to a temporary file, which is then renamed, so an interrupted write leaves an existing file
    intact.

    Parameters
    ----------
    path : path_like
        File with a suffix of `FORMATS`, as for `read_mesh`.
    mesh : Mesh
        The mesh.
    binary : bool, optional
        For PLY, STL and VTK only: whether to write binary (the default) or text.
    colors : (n, 3) array_like of uint8, optional
        For formats with colours: red, green and blue of each vertex, 0…255.

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
    `read_mesh` returns exactly the same float64 coordinates from OFF, OBJ, PLY and VTP. Binary STL, glTF, GIFTI and
    FreeSurfer store float32, and other VTK files as text fewer digits. STL also loses the order of
    the vertices, and vertices that no face uses.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "triangle.ply"
    >>> write_mesh(path, Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> read_mesh(path).vertices[1].tolist()
    [1.0, 0.0, 0.0]
    """
    path = Path(path)
    contents = Contents.of_mesh(mesh)
    if colors is not None:
        color = _vertex_colors(colors, mesh.n_vertices)
        if not _format_of(path).keeps(color):
            raise _no_option(
                path, "colors", [suffix for suffix, other in FORMATS.items() if other.keeps(color)]
            )
        contents = contents.with_attributes(color)
    write_contents(path, contents, binary=binary)


def read_contents(path: str | os.PathLike[str]) -> Contents:
    """Read all that a surface file holds; see `read_mesh` for the errors.

    Parameters
    ----------
    path : path_like
        File as for `read_mesh`.

    Returns
    -------
    Contents
        Points, polygons and attributes, in the order of the file.
    """
    path = Path(path)
    mesh_format = _format_of(path)
    with opened(path) as file:
        data = file.read()
    if mesh_format.read_contents is None:
        return Contents.of_mesh(mesh_format.read(data, str(path)))
    return _checked(mesh_format.read_contents, data, str(path))


def write_contents(
    path: str | os.PathLike[str], contents: Contents, *, binary: bool | None = None
) -> tuple[Attribute, ...]:
    """Write a surface file; an existing file is replaced, see `write_mesh` for the errors.

    Parameters
    ----------
    path : path_like
        File as for `write_mesh`.
    contents : Contents
        What to write. If it was read from a file of the same format, all else in that file is written too.
    binary : bool, optional
        For PLY, STL and VTK only: whether to write binary or text; by default as the file was that was read.

    Returns
    -------
    tuple of Attribute
        Attributes for which the format has no place and which are not in the file.
    """
    path = Path(path)
    mesh_format = _format_of(path)
    if binary is not None and "binary" not in mesh_format.options:
        able = [suffix for suffix, other in FORMATS.items() if "binary" in other.options]
        raise _no_option(path, "binary", able)
    if not mesh_format.has_parts:
        contents = contents.placed
    kept: list[Attribute] = []
    left: list[Attribute] = []
    for attribute in contents.attributes:
        place: Attribute | None = attribute
        if attribute.domain == "corner" and not mesh_format.keeps(attribute):
            place = merged_corners(contents.polygons, len(contents.points), attribute)
        if (
            place is None
            or not mesh_format.keeps(place)
            or (place.kind in mesh_format.single and any(place.kind == other.kind for other in kept))
        ):
            left.append(attribute)
        else:
            kept.append(place)
    data = mesh_format.write(
        with_changes(contents, attributes=told_apart(kept)), **({} if binary is None else {"binary": binary})
    )
    with replaced(path) as file:
        file.write(data)
    return tuple(left)


def _checked(read: Callable[[bytes, str], Contents], data: bytes, name: str) -> Contents:
    try:
        return read(data, name)
    except InputError as error:
        raise FormatError(f"{name}: {error}") from None


def _no_option(path: Path, option: str, able: list[str]) -> FormatError:
    return FormatError(f"{path}: a {path.suffix} file has no option {option!r}; use one of {', '.join(able)}")


def _format_of(path: Path) -> MeshFormat:
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        found = f"suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise FormatError(f"{path}: {found} is not a mesh format; use one of {', '.join(FORMATS)}") from None


def _vertex_colors(colors: ArrayLike, n_vertices: int) -> Attribute:
    array = np.asarray(colors)
    if array.shape != (n_vertices, 3) or array.dtype != np.uint8:
        raise DescriptorError(
            f"colors have shape {array.shape} and type {array.dtype}, expected ({n_vertices}, 3) and uint8: "
            "red, green and blue from 0 to 255 per vertex"
        )
    return Attribute("color", "point", "colour", array)
