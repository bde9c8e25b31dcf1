"""Meshes and point clouds of Open3D itself, in and out, and our files in its readers."""

import numpy as np
import pytest
from made import ATTRIBUTES, BY_CORNER, POINTS, POLYGONS, TEXTURE, textured, whole

from isomatch import PointCloud, read_asset, write_asset
from isomatch.io import asset_from, looks_of, mesh_from, pixels_of, surface_from, to_open3d

o3d = pytest.importorskip("open3d")


def shown(asset):
    """The pixels of the texture of an asset, as octets."""
    [look] = looks_of(asset).looks
    return np.rint(255 * pixels_of(look.base.picture.data)).astype(np.uint8)


def test_vertices_and_faces_are_the_same():
    given = to_open3d(whole())
    assert isinstance(given, o3d.geometry.TriangleMesh)
    found = mesh_from(given)
    assert np.array_equal(found.vertices, POINTS)
    assert np.array_equal(found.faces, POLYGONS.triangles)


def test_what_open3d_made_itself():
    box = o3d.geometry.TriangleMesh.create_box()
    box.compute_vertex_normals()
    box.paint_uniform_color([1, 0.5, 0])
    found = asset_from(box)
    assert found.mesh.n_vertices == 8
    assert found.mesh.n_faces == 12
    assert np.allclose(found.attribute("normal", "point").values, np.asarray(box.vertex_normals))
    assert np.allclose(found.attribute("normal", "face").values, np.asarray(box.triangle_normals))
    assert np.allclose(found.attribute("color").fractions, [1, 0.5, 0])


def test_empty_meshes():
    for made in (o3d.geometry.TriangleMesh(), o3d.geometry.PointCloud()):
        assert len(asset_from(made).points) == 0


def test_point_clouds_are_points():
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    cloud.estimate_normals()
    cloud.paint_uniform_color([1, 0, 0])
    assert isinstance(surface_from(cloud), PointCloud)
    assert np.array_equal(surface_from(cloud).vertices, POINTS)
    assert {a.kind for a in asset_from(cloud).attributes} == {"normal", "colour"}


def test_a_texture_goes_out_and_in():
    assert np.array_equal(shown(asset_from(to_open3d(textured()))), TEXTURE)


def test_open3d_reads_our_files_and_we_read_its(tmp_path):
    path = tmp_path / "a.glb"
    write_asset(path, textured())
    found = o3d.io.read_triangle_mesh(str(path))
    assert np.array_equal(np.asarray(found.textures[0])[::-1], TEXTURE)
    assert np.allclose(np.asarray(found.triangle_uvs), BY_CORNER[POLYGONS.corner_of_triangle.ravel()])
    o3d.io.write_triangle_mesh(str(tmp_path / "c.ply"), to_open3d(whole()))
    again = read_asset(tmp_path / "c.ply")
    assert np.array_equal(again.points, POINTS)
    assert np.allclose(again.attribute("color").fractions, ATTRIBUTES["colour"].fractions, atol=1 / 255)
