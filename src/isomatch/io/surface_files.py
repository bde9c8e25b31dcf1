"""Read and write surface files, by their suffix, and convert surfaces of other kinds."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import DescriptorError, FormatError, IsomatchError, MeshError
from isomatch._core.files import read_bytes, replaced
from isomatch._core.skipped import tell_skipped
from isomatch._core.texts import natural_order
from isomatch.io.appearance import list_lost_looks, prepare_for_writing
from isomatch.io.asset import MAX_ROUNDING, REPORTED_ROUNDING, Asset
from isomatch.io.attribute import Attribute, number_equal_names
from isomatch.io.formats.ply import names_without_blanks
from isomatch.io.formats.registry import CLOUDS, FORMATS, UNREADABLE, MeshFormat, format_of, naming
from isomatch.io.libraries import read_geometry
from isomatch.io.polygons import merge_corners
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface

SurfaceLike: TypeAlias = Any
"""What `surface_from` takes; it is `Any`, because classes of other libraries are not imported."""


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    r"""Read a triangle mesh from a file.

    Vertices keep their order and number. Polygons are split into triangles, in order. A file without
    faces gives a mesh of 0 faces. Defects are not sought; see `check`. The notes of `read_asset` say
    what the reader left out or assumed.

    Parameters
    ----------
    path : path_like
        File with a suffix of `FORMATS`, in upper or lower case: OFF, OBJ, PLY, STL, glTF and GLB; with the extra ``io``
        GIFTI and FreeSurfer (``lh.pial``, ``rh.white``, …); with the extra ``vtk`` VTP, VTU and VTK.
        Point clouds: XYZ, ASC, NPY, and with ``io`` PCD.

    Returns
    -------
    Mesh
        The mesh, in the units of the file; meshes of a glTF file one after another, placed by its nodes.

    Raises
    ------
    MissingFileError
        If there is no such file.
    FormatError
        If the suffix is unknown, or the file is damaged or not of that format. The message starts with ``file:line:``
        (text) or ``file: byte N:`` (binary).

    Notes
    -----
    Linear time: for 655 000 vertices 0.02 s from binary PLY, 0.3 s from OBJ, OFF and text PLY, 0.5 s
    from binary STL. STL files have no connectivity: corners at exactly the same position become one
    vertex, in order of first appearance.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "triangle.off"
    >>> _ = path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    >>> read_mesh(path)
    Mesh(3 vertices, 1 faces)
    """
    path = Path(path)
    return format_of(path, reading=True).read(read_bytes(path), str(path))


def read_point_cloud(path: str | os.PathLike[str], n_neighbours: int = 30) -> PointCloud:
    r"""Read the vertices of a file, as `read_mesh`, as a `PointCloud`; faces are ignored.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "points.obj"
    >>> _ = path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n")
    >>> read_point_cloud(path)
    PointCloud(4 points, 30 neighbours)
    """
    return PointCloud(read_mesh(path).vertices, n_neighbours)


def read_asset(path: str | os.PathLike[str], *, sound: bool = True) -> Asset:
    r"""Read a surface file with all its contents, in its order; see `read_mesh`.

    Unless ``sound``, polygons may refer to missing points, which `repair` removes.
    `MissingDependencyError` names the extra of a format that needs a package.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "square.obj"
    >>> _ = path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng floor\nf 1 2 3 4\n")
    >>> read_asset(path)
    Asset(4 points, 1 polygons; group)
    """
    path = Path(path)
    mesh_format, data, name = format_of(path, reading=True), read_bytes(path), str(path)
    with naming(name):
        if mesh_format.read_asset is None:
            return Asset.of_mesh(mesh_format.read(data, name))
        asset = mesh_format.read_asset(data, name)
        if sound:
            asset.require_points()
        return asset.with_note_of_uncut


def read_as_far_as_possible(path: str | os.PathLike[str]) -> Asset:
    """Read a surface file as `read_asset`, or only points and triangles, with a note why."""
    try:
        return read_asset(path)
    except IsomatchError as error:
        return replace(Asset.of_mesh(read_mesh(path)), notes=(str(error),))


def meshes_among(paths: Iterable[Path]) -> list[Path]:
    """Select the surface files, in the natural order of their names, without hidden ones of macOS.

    Point clouds, as text or PCD, count only where there are no surfaces: otherwise they are values or
    landmarks.
    """
    seen = [path for path in paths if not path.name.startswith(".")]
    for path in seen:
        suffix = path.suffix.lower()
        if suffix in UNREADABLE:
            tell_skipped(f"{path}: left out, as {suffix} files are not read; {UNREADABLE[suffix]}")
        elif suffix in {*FORMATS, *CLOUDS} and not path.is_file():
            what = "leads nowhere" if path.is_symlink() and not path.exists() else "is not a file"
            tell_skipped(f"{path}: left out, as it {what}")
    found = [path for path in seen if path.suffix.lower() in FORMATS]
    found = found or [path for path in seen if path.suffix.lower() in (".xyz", ".asc", ".pcd")]
    return sorted((path for path in found if path.is_file()), key=lambda path: natural_order(str(path)))


def write_mesh(
    path: str | os.PathLike[str],
    mesh: Mesh,
    *,
    binary: bool | None = None,
    colors: ArrayLike | None = None,
    rounded: bool = False,
) -> None:
    """Write a mesh to a file.

    An existing file is replaced; an interrupted write leaves it intact.

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
    rounded : bool
        Whether the file may move vertices by more than a thousandth of the mean edge, and PLY has float32
        instead of doubles, which some programs cannot read; see `write_asset`.

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
    `read_mesh` returns exactly the same float64 coordinates from OFF, OBJ, PLY and VTP. Binary STL,
    glTF, GIFTI and FreeSurfer store float32, and VTK legacy files as text 11 digits. STL also loses the
    order of the vertices, and unused vertices.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "triangle.ply"
    >>> write_mesh(path, Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> read_mesh(path).vertices[1].tolist()
    [1.0, 0.0, 0.0]
    """
    path = Path(path)
    asset = Asset.of_mesh(mesh)
    if colors is not None:
        array, expected = np.asarray(colors), (mesh.n_vertices, 3)
        if array.shape != expected or array.dtype != np.uint8:
            found = f"shape {array.shape} and type {array.dtype}, expected {expected} and uint8"
            raise DescriptorError(f"colors have {found}: red, green and blue from 0 to 255 per vertex")
        color = Attribute("color", "point", "colour", array)
        _require_option(path, "colors", lambda other: other.keeps(color))
        asset = asset.with_attributes(color)
    write_asset(path, asset, binary=binary, rounded=rounded)


def write_asset(
    path: str | os.PathLike[str], asset: Asset, *, binary: bool | None = None, rounded: bool = False
) -> tuple[Attribute, ...]:
    """Write an asset as `write_mesh` writes a mesh; by default text or binary as it was read.

    The format that it was read from also keeps other contents of the file: glTF the whole document, PLY
    comments and other elements, OBJ the material libraries. Libraries and pictures are written beside
    an OBJ file, unless they exist, also those of materials from a glTF file.

    Positions that float32 would round are written as doubles to PLY, as text to STL, and with a
    translation of the node to glTF. `MeshError` if a file still moves them by more than a thousandth
    of the mean edge, unless ``rounded`` allows it.

    Returns
    -------
    tuple of Attribute
        What the format has no place for: attributes, "names of" or "opacity of" one, the frame of the
        coordinates, with its matrix as the values, or digits of the positions, with the distances moved.
    """
    path = Path(path)
    mesh_format = format_of(path)
    if binary is not None:
        _require_option(path, "binary", lambda other: "binary" in other.options)
    lost, (asset, beside) = list_lost_looks(path, asset), prepare_for_writing(path, asset)
    if not mesh_format.has_parts:
        asset = replace(asset.placed, document=asset.document)
    if any(attribute.domain == "corner" for attribute in asset.attributes):
        asset.require_points()
    kept, left = list[Attribute](), list(lost)
    for attribute in asset.attributes:
        place: Attribute | None = attribute
        if attribute.domain == "corner" and not mesh_format.keeps(attribute):
            place = merge_corners(asset.polygons, len(asset.points), attribute)
        # some formats keep one attribute of a kind on faces, and one on points or corners
        kinds = [(other.kind, other.domain == "face") for other in kept if other.kind in mesh_format.single]
        if place and mesh_format.keeps(place) and (place.kind, place.domain == "face") not in kinds:
            kept.append(place)
            left += mesh_format.missing(place)
        else:
            left.append(attribute)
    if mesh_format.middles and (binary or "binary" not in mesh_format.options):
        left += _rounded(path, asset, mesh_format.middles(asset), rounded)
    if asset.frame is not None and not mesh_format.keeps_frame(asset.frame):
        turned = asset.frame.axes and mesh_format.axes not in (None, asset.frame.axes)
        turn = f"; positions are turned to {mesh_format.axes}" if turned else ""
        name = f"the frame of the coordinates ({asset.frame}{turn})"
        left.append(Attribute(name, "point", "vector", asset.frame.matrix))
    if path.suffix.lower() == ".ply":
        left += names_without_blanks(replace(asset, attributes=tuple(kept)))
    options = {} if binary is None else {"binary": binary}
    if rounded and "single" in mesh_format.options:
        options["single"] = True
        left += _rounded(path, asset, np.zeros(3), is_allowed=True)
    data = mesh_format.write(replace(asset, attributes=number_equal_names(kept)), **options)
    for file_path, content in {**beside, path: data}.items():
        with replaced(file_path) as file:
            file.write(content)
    return tuple(left)


def _rounded(path: Path, asset: Asset, middles: FloatArray, is_allowed: bool) -> list[Attribute]:
    """Report how far float32 moves the points, if at all; `MeshError` if that is too far."""
    moved = asset.rounding(middles)
    most = float(moved.max(initial=0))
    if not most > REPORTED_ROUNDING * asset.mean_edge > 0:
        return []
    if most > MAX_ROUNDING * asset.mean_edge and not (is_allowed and most < float(np.finfo(np.float32).max)):
        raise MeshError(
            f"{path}: positions would move by up to {most:.2g}, {most / asset.mean_edge:.2g} times the mean edge, as "
            f"{path.suffix} files round them; write a .ply file, or allow it (--rounded, in Python rounded=True)"
        )
    lost = f"the last digits of the positions (moved by up to {most:.2g})"
    return [Attribute(lost, "point", "scalar", moved)]


def files_beside(path: str | os.PathLike[str], asset: Asset) -> tuple[Path, ...]:
    """List the files that `write_asset` writes beside a surface, such as libraries and pictures.

    Files that exist with the same contents are left out, as they stay.
    """
    return tuple(prepare_for_writing(Path(path), asset)[1])


def _require_option(path: Path, option: str, is_able: Callable[[MeshFormat], bool]) -> None:
    if not is_able(format_of(path)):
        able = ", ".join(suffix for suffix, other in FORMATS.items() if is_able(other))
        raise FormatError(f"{path}: a {path.suffix} file has no option {option!r}; use one of {able}")


def surface_from(given: SurfaceLike) -> Surface:
    """Make a `Mesh`, `PointCloud` or `Graph` of a file, arrays or a mesh of another library.

    Vertices keep their order and number. Polygons are split into triangles. Without faces, the vertices
    of a file or an object become a `PointCloud`. A bare array of points is refused, because it is
    unclear what it samples: give ``PointCloud(points)``.

    Parameters
    ----------
    given : Mesh, PointCloud, Graph, path_like, tuple or object
        A surface, which is returned as it is; the path of a mesh file, see `read_mesh`; a tuple (vertices, faces) of
        array_likes; a ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh``, a ``TriangleMesh`` of Open3D, or
        anything else with the same attributes; or a ``PointCloud`` of trimesh or Open3D.

    Raises
    ------
    MeshError
        If it is none of these, or its arrays make no mesh.
    FormatError
        If the file cannot be read.

    Examples
    --------
    >>> surface_from(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    Mesh(3 vertices, 1 faces)
    """
    if isinstance(given, Mesh | PointCloud | Graph):
        return given
    mesh = mesh_from(given)
    return mesh if mesh.n_faces else PointCloud(mesh.vertices)


def mesh_from(given: SurfaceLike) -> Mesh:
    """Make a mesh as `surface_from`, possibly without faces. A point cloud or a graph is refused."""
    if isinstance(given, Mesh):
        return given
    if isinstance(given, str | os.PathLike):
        return read_mesh(given)
    if isinstance(given, tuple) and len(given) == 2:
        return Mesh(*given)
    if isinstance(given, PointCloud):
        raise MeshError("a PointCloud is no mesh; give a surface with faces")
    geometry, _ = read_geometry(given)
    points = Mesh(geometry.points, []).vertices
    return Mesh(points, geometry.polygons.at(points).triangles)
