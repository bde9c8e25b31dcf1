"""Surfaces from what a user has: a file, two arrays, or a mesh of another library, which is not imported."""

from __future__ import annotations

import os
from typing import Any, TypeAlias

from isomatch.assets.files import read_mesh
from isomatch.assets.from_libraries import geometry_of
from isomatch.assets.polygons import Polygons
from isomatch.errors import MeshError
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface

SurfaceLike: TypeAlias = Any
"""What `surface_from` takes. As a type it says nothing, because other libraries' classes are not imported."""


def surface_from(given: SurfaceLike) -> Surface:
    """Make a surface of what a user has.

    Vertices keep their order and number, so results refer to those of the user. Polygons are split into triangles, as
    by `read_mesh`. Without faces, the vertices of a file or an object become a `PointCloud`. An array of points alone
    is refused, as nothing says what it samples: give ``PointCloud(points)``.

    Parameters
    ----------
    given : Mesh, PointCloud, Graph, path_like, tuple or object
        A surface, which is returned as it is; the path of a mesh file, see `read_mesh`; a tuple (vertices, faces) of
        array_likes; or a ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh``, a ``TriangleMesh`` of Open3D, or
        anything else with the same attributes; or a ``PointCloud`` of trimesh or Open3D. Of a meshio
        mesh, triangles, quads and polygons are taken.

    Returns
    -------
    Mesh, PointCloud or Graph

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
    """Make a mesh of what a user has, as `surface_from`; it may have no faces.

    Raises
    ------
    MeshError, FormatError
        As `surface_from`, and for a point cloud or a graph.
    """
    if isinstance(given, Mesh):
        return given
    if isinstance(given, str | os.PathLike):
        return read_mesh(given)
    if isinstance(given, tuple) and len(given) == 2:
        return Mesh(*given)
    if isinstance(given, PointCloud):
        raise MeshError("a PointCloud is no mesh; give a surface with faces")
    found = geometry_of(given)
    points = Mesh(found.points, []).vertices
    return Mesh(points, Polygons(found.corners, found.sizes, points).triangles)
