"""Meshes for other libraries, which are imported when one is made."""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch._packages import package
from isomatch.assets.attribute import told_apart
from isomatch.assets.contents import Contents
from isomatch.assets.polygons import Polygons
from isomatch.assets.seams import split_at_seams


def to_trimesh(contents: Contents) -> Any:
    """Make a ``trimesh.Trimesh`` with its colours, texture coordinates and other values."""
    trimesh = package("trimesh", "io", "a mesh of trimesh")
    split = _at_points(contents)
    mesh = trimesh.Trimesh(split.points, split.polygons.triangles, process=False)
    of_triangle = split.polygons.of_triangle
    has_uv = any(uv.domain == "point" for uv in split.of_kind("uv"))  # instead of colours
    for attribute in split.attributes:
        values = attribute.plain
        of_points = attribute.domain == "point"
        if attribute.kind == "uv" and of_points:
            mesh.visual = trimesh.visual.TextureVisuals(uv=np.nan_to_num(values[:, :2]))
        elif attribute.kind == "colour" and not has_uv:
            values = trimesh.visual.to_rgba(values)
            if of_points:
                mesh.visual.vertex_colors = values
            else:
                mesh.visual.face_colors = values[of_triangle]
        elif of_points:
            mesh.vertex_attributes[attribute.name] = values
        else:
            mesh.face_attributes[attribute.name] = values[of_triangle]
    return mesh


def to_pyvista(contents: Contents) -> Any:
    """Make a ``pyvista.PolyData`` with all polygons and values."""
    pyvista = package("pyvista", "vtk", "a mesh of PyVista")
    split = _at_points(contents)
    sizes = split.polygons.sizes
    starts = np.cumsum(sizes) - sizes
    cells = np.insert(split.polygons.corners, starts, sizes)
    mesh = pyvista.PolyData(split.points, cells if len(cells) else None)
    for attribute in split.attributes:
        data = mesh.point_data if attribute.domain == "point" else mesh.cell_data
        values = attribute.plain
        data[attribute.name] = values
        if attribute.kind == "uv" and attribute.domain == "point":
            data.active_texture_coordinates_name = attribute.name
        if attribute.kind == "normal":
            data.active_normals_name = attribute.name
    return mesh


def to_meshio(contents: Contents) -> Any:
    """Make a ``meshio.Mesh`` with all polygons and values; polygons of as many corners in a row are a block."""
    meshio = package("meshio", "io", "a mesh of meshio")
    split = _at_points(contents)
    sizes = split.polygons.sizes
    first = np.flatnonzero(np.diff(sizes, prepend=0))
    stops = np.append(first[1:], len(sizes))
    corners = split.polygons.corners
    at = np.append(0, np.cumsum(sizes))
    blocks = [
        ({3: "triangle", 4: "quad"}.get(size, "polygon"), corners[at[a] : at[b]].reshape(-1, size))
        for a, b, size in zip(first, stops, sizes[first].tolist())
    ]
    if not blocks:  # a file without cells cannot be read
        blocks = [("vertex", np.arange(len(split.points))[:, None])]
    return meshio.Mesh(
        split.points,
        blocks,
        point_data={a.name: a.plain for a in split.attributes if a.domain == "point"},
        cell_data={
            a.name: [a.plain[i:j] for i, j in zip(first, stops)]
            for a in split.attributes
            if a.domain == "face" and len(sizes)
        },
    )


def to_open3d(contents: Contents) -> Any:
    """Make an ``open3d.geometry.TriangleMesh`` with its colours, normals and texture coordinates."""
    open3d = package("open3d", None, "a mesh of Open3D")
    vector, index = open3d.utility.Vector3dVector, open3d.utility.Vector3iVector
    contents = contents.placed
    mesh = open3d.geometry.TriangleMesh(vector(contents.points), index(contents.polygons.triangles))
    for attribute in contents.attributes:
        values = attribute.plain
        if attribute.domain == "point" and attribute.kind == "normal":
            mesh.vertex_normals = vector(values.astype(np.float64))
        elif attribute.domain == "point" and attribute.kind == "colour":
            mesh.vertex_colors = vector(attribute.fractions[:, :3])
        elif attribute.kind == "uv":
            rows = contents.polygons.corner_of_triangle.ravel()
            if attribute.domain == "point":
                rows = contents.polygons.corners[rows]
            mesh.triangle_uvs = open3d.utility.Vector2dVector(values[rows, :2].astype(np.float64))
    return mesh


def _at_points(contents: Contents) -> Contents:
    """Return the same with values of corners at points, of which there are more at seams; equal names are numbered."""
    contents = contents.placed
    split = split_at_seams(contents.polygons, len(contents.points), contents.attributes)
    return Contents(
        contents.points[split.source],
        Polygons(split.corners, contents.polygons.sizes),
        told_apart(split.attributes),
    )
