"""Surfaces from what a user has: a file, two arrays, or a mesh of another library, which is not imported."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from isomatch._arrays import IntArray
from isomatch.errors import MeshError
from isomatch.surfaces.graph import Graph
from isomatch.surfaces.io import read_mesh
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.point_cloud import PointCloud
from isomatch.surfaces.polygons import triangulate
from isomatch.surfaces.surface import Surface

SurfaceLike: TypeAlias = Any
"""What `surface_from` takes. As a type it says nothing, because other libraries' classes are not imported."""


def surface_from(given: SurfaceLike) -> Surface:
    """Make a surface of what a user has.

    Vertices keep their order and number, so results refer to those of the user. Polygons are split into fans of
    triangles. Without faces, the vertices of a file or an object become a `PointCloud`. An array of points alone is
    refused, as nothing says what it samples: give ``PointCloud(points)``.

    Parameters
    ----------
    given : Mesh, PointCloud, Graph, path_like, tuple or object
        A surface, which is returned as it is; the path of a mesh file, see `read_mesh`; a tuple (vertices, faces) of
        array_likes; or a ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh`` or ``open3d.geometry.TriangleMesh``,
        or anything else with the same attributes. Of a meshio mesh, triangles, quads and polygons are taken.

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
    for names, make in _ATTRIBUTES.items():
        if all(_has(given, name) for name in names):
            return make(given, *(getattr(given, name) for name in names))
    raise MeshError(
        f"a {type(given).__module__}.{type(given).__qualname__} is no mesh; give a Mesh, the path of a mesh file, a "
        "tuple (vertices, faces), or a mesh of trimesh, PyVista (PolyData), meshio or Open3D (TriangleMesh); where "
        "points will do, PointCloud(points)"
    )


def _has(given: object, name: str) -> bool:
    found = getattr(given, name, None)
    return found is not None and not callable(found)


def _of_triangles(_: object, vertices: Any, triangles: Any) -> Mesh:
    return Mesh(np.asarray(vertices), np.asarray(triangles))


def _of_polydata(given: Any, points: Any, faces: Any) -> Mesh:
    """Make a mesh of faces stored one after the other, each as the number of its corners and these."""
    flat = np.asarray(faces, dtype=np.int64)
    if flat.ndim == 2:
        return Mesh(points, flat)
    if getattr(given, "n_strips", 0):
        raise MeshError(f"the {type(given).__name__} has strips of triangles; call its triangulate() first")
    starts = np.arange(0, flat.size, flat[0] + 1) if flat.size else flat
    if flat.size and (flat.size % (flat[0] + 1) or (flat[starts] != flat[0]).any()):
        starts = np.array(_starts(flat.tolist()))
    corners = np.ones(flat.size, dtype=bool)
    corners[starts] = False
    return Mesh(points, _split(flat[corners], flat[starts]))


def _starts(flat: list[int]) -> list[int]:
    found, at = [], 0
    while at < len(flat):
        found.append(at)
        at += flat[at] + 1
    return found


def _of_blocks(given: Any, points: Any, cells: Any) -> Mesh:
    """Make a mesh of blocks, each of the cells of one type."""
    kinds = [block.type for block in cells]
    flat = [
        np.asarray(block.data, dtype=np.int64)
        for block in cells
        if block.type in ("triangle", "quad", "polygon")
    ]
    if not flat and set(kinds) - {"vertex"}:
        raise MeshError(
            f"the {type(given).__name__} has no triangles, quads or polygons but {', '.join(sorted(set(kinds)))}; "
            "extract its surface first"
        )
    parts = [_split(block.ravel(), np.full(len(block), block.shape[1])) for block in flat]
    return Mesh(points, np.concatenate(parts) if parts else [])


def _split(corners: IntArray, counts: IntArray) -> IntArray:
    """Split polygons into triangles; those of fewer than three corners have none."""
    kept = counts >= 3
    inside = np.repeat(kept, counts)
    return triangulate(corners[inside], counts[kept])


_ATTRIBUTES: dict[tuple[str, str], Callable[[Any, Any, Any], Mesh]] = {
    ("vertices", "faces"): _of_triangles,  # trimesh
    ("vertices", "triangles"): _of_triangles,  # Open3D
    ("points", "faces"): _of_polydata,  # PyVista
    ("points", "cells"): _of_blocks,  # meshio
}
