"""Meshes for other libraries, which are imported when one is made."""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch.assets.appearance import with_one_texture
from isomatch.assets.asset import Asset
from isomatch.assets.attribute_names import told_apart
from isomatch.assets.seams import split_at_seams
from isomatch.loading.first_use import package
from isomatch.values.arrays import AnyArray


def to_trimesh(asset: Asset) -> Any:
    """Make a ``trimesh.Trimesh`` of triangles; points are split where texture coordinates have seams.

    Raises
    ------
    MissingDependencyError
        If the package is not installed; the message names the extra. So do the other conversions.
    """
    trimesh = package("trimesh", "io", "a mesh of trimesh")
    shown, texture = with_one_texture(asset)
    split = _at_points(shown)
    mesh = trimesh.Trimesh(split.points, split.polygons.triangles, process=False)
    of_triangle = split.polygons.of_triangle
    has_uv = any(uv.domain == "point" for uv in split.of_kind("uv"))  # instead of colours
    for attribute in split.attributes:
        values = attribute.plain
        of_points = attribute.domain == "point"
        if attribute.kind == "uv" and of_points:
            material = None
            if texture is not None:
                image = package("PIL.Image", None, "a texture").fromarray(texture)
                # white, as the tint is painted into it; with none given, trimesh would write a dark grey
                material = trimesh.visual.material.SimpleMaterial(image=image, diffuse=(255, 255, 255))
            mesh.visual = trimesh.visual.TextureVisuals(uv=np.nan_to_num(values[:, :2]), material=material)
        elif attribute.kind == "colour" and not has_uv:
            if values.dtype.kind == "f":
                values = np.nan_to_num(values, nan=attribute.full)  # white is none
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


def to_pyvista(asset: Asset) -> Any:
    """Make a ``pyvista.PolyData`` with all polygons; points are split where values of corners differ."""
    pyvista = package("pyvista", "vtk", "a mesh of PyVista")
    split = _at_points(asset)
    cells = np.insert(split.polygons.corners, split.polygons.starts, split.polygons.sizes)
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


def to_meshio(asset: Asset) -> Any:
    """Make a ``meshio.Mesh`` with all polygons; points are split where values of corners differ.

    Polygons of as many corners in a row are a block.
    """
    meshio = package("meshio", "io", "a mesh of meshio")
    split = _at_points(asset)
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


def to_open3d(asset: Asset) -> Any:
    """Make an ``open3d.geometry.TriangleMesh`` with its colours, normals and texture coordinates."""
    open3d = package("open3d", None, "a mesh of Open3D")
    shown, texture = with_one_texture(asset)
    asset = shown.placed

    def vector(values: AnyArray) -> Any:
        kind = open3d.utility.Vector3dVector if values.shape[1] == 3 else open3d.utility.Vector2dVector
        return kind(np.array(values, dtype=np.float64))  # which can be written to

    polygons = asset.polygons
    index = open3d.utility.Vector3iVector(np.array(polygons.triangles, dtype=np.int32))
    mesh = open3d.geometry.TriangleMesh(vector(asset.points), index)
    for attribute in asset.attributes:
        values = attribute.values
        match attribute.kind, attribute.domain:
            case "normal", "point":
                mesh.vertex_normals = vector(values)
            case "normal", "face":
                mesh.triangle_normals = vector(values[polygons.of_triangle])
            case "colour", "point":
                mesh.vertex_colors = vector(attribute.fractions[:, :3])
            case "uv", "point":
                mesh.triangle_uvs = vector(values[polygons.triangles.ravel(), :2])
            case "uv", "corner":
                mesh.triangle_uvs = vector(values[polygons.corner_of_triangle.ravel(), :2])
    if texture is not None:  # row 0 is at the bottom there
        mesh.textures = [open3d.geometry.Image(np.ascontiguousarray(texture[::-1]))]
        mesh.triangle_material_ids = open3d.utility.IntVector(np.zeros(len(mesh.triangles), dtype=np.int32))
    return mesh


def _at_points(asset: Asset) -> Asset:
    """Return the same with values of corners at points, of which there are more at seams; equal names are numbered."""
    asset = asset.placed
    if any(attribute.domain == "corner" for attribute in asset.attributes):
        asset.require_points()
    split = split_at_seams(asset.polygons, len(asset.points), asset.attributes)
    return Asset(
        asset.points[split.source],
        asset.polygons.between(split.corners),
        told_apart(split.attributes),
    )
