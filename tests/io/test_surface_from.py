"""What a user has becomes a surface: files, arrays and the meshes of other libraries, vertex by vertex the same."""

from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import (
    Correspondence,
    FormatError,
    Mesh,
    MeshError,
    MissingFileError,
    PointCloud,
    canonical_form,
    check,
    distance_basis,
    geodesic_distances,
    laplace_basis,
    match,
    prepare,
    repair,
    write_mesh,
)
from isomatch.io import mesh_from, surface_from
from isomatch_lab.sets import relabelled
from shapes import icosphere

meshio = pytest.importorskip("meshio")
pyvista = pytest.importorskip("pyvista")
trimesh = pytest.importorskip("trimesh")

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [9, 9, 9]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
POLYGONS = np.array([4, 0, 1, 2, 3, 3, 1, 4, 2])  # a quad and a triangle
SPLIT = [[0, 1, 2], [0, 2, 3], [1, 4, 2]]


def open3d_mesh(vertices, triangles):
    try:
        import open3d
    except ImportError:
        return SimpleNamespace(vertices=list(vertices), triangles=list(triangles))
    return open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(np.array(vertices)),
        open3d.utility.Vector3iVector(np.array(triangles, dtype=np.int32)),
    )


MAKERS = {
    "arrays": lambda v, f: (v.tolist(), f.astype(np.int32)),
    "trimesh": lambda v, f: trimesh.Trimesh(v, f, process=False),
    "pyvista": lambda v, f: pyvista.PolyData.from_regular_faces(v, f),
    "meshio": lambda v, f: meshio.Mesh(v, [("triangle", f)]),
    "open3d": open3d_mesh,
}


@pytest.fixture(params=MAKERS)
def made(request):
    return MAKERS[request.param]


def test_meshes_of_other_libraries_keep_their_vertices_and_faces(made):
    found = surface_from(made(VERTICES, TRIANGLES))
    assert isinstance(found, Mesh)
    np.testing.assert_array_equal(found.vertices, VERTICES)
    np.testing.assert_array_equal(found.faces, TRIANGLES)


def test_polygons_are_split():
    polydata = pyvista.PolyData(VERTICES, POLYGONS)
    blocks = meshio.Mesh(VERTICES, [("line", [[0, 4]]), ("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])])
    polygons = meshio.Mesh(VERTICES, [("polygon", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])])
    for given in (polydata, blocks, polygons):
        np.testing.assert_array_equal(mesh_from(given).faces, SPLIT)


def test_paths(tmp_path):
    write_mesh(tmp_path / "mesh.ply", Mesh(VERTICES, TRIANGLES))
    for path in (tmp_path / "mesh.ply", str(tmp_path / "mesh.ply")):
        np.testing.assert_array_equal(mesh_from(path).faces, TRIANGLES)
    with pytest.raises(MissingFileError, match=r"nowhere\.ply"):
        surface_from(tmp_path / "nowhere.ply")
    with pytest.raises(FormatError, match="is not a mesh format"):
        match("mesh.blend", "mesh.blend")


def test_without_faces_the_vertices_are_points(tmp_path):
    write_mesh(tmp_path / "points.off", Mesh(VERTICES, []))
    for given in (
        tmp_path / "points.off",
        (VERTICES, []),
        pyvista.PolyData(VERTICES, faces=np.zeros(0, dtype=int)),
        trimesh.PointCloud(VERTICES),
    ):
        assert isinstance(surface_from(given), PointCloud)
        assert mesh_from(given).n_faces == 0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (VERTICES, "a numpy.ndarray is no mesh; give a Mesh, the path .* PointCloud"),
        ([VERTICES, TRIANGLES], "builtins.list is no mesh"),
        (None, "NoneType is no mesh"),
        (trimesh.Scene([trimesh.creation.box()]), r"trimesh.*Scene is no mesh; its to_geometry\(\) is one;"),
        (SimpleNamespace(points=VERTICES), "SimpleNamespace is no mesh; .* where points will do"),
        (pyvista.ImageData(), "ImageData is no mesh"),
        (meshio.Mesh(VERTICES, [("tetra", [[0, 1, 2, 3]])]), "no triangles, quads or polygons but tetra"),
        ((VERTICES, [[0, 1, 2, 3]]), r"faces have shape \(1, 4\), .* split polygons"),
        ((VERTICES[:, :2], TRIANGLES), r"vertices have shape \(6, 2\), expected \(n, 3\)"),
    ],
)
def test_what_is_no_surface(given, message):
    with pytest.raises(MeshError, match=message):
        surface_from(given)


def test_every_entrance_takes_them(made):
    sphere = icosphere(2)
    given = made(sphere.vertices, sphere.faces)
    assert check(given).ok
    assert repair(given).mesh.n_faces == sphere.n_faces
    np.testing.assert_array_equal(geodesic_distances(given, [0]), geodesic_distances(sphere, [0]))
    assert distance_basis(given, k=5, p=20).method == "predicted"
    assert laplace_basis(given, 5).values.shape == (5,)
    assert canonical_form(given, p=10).points.shape == (sphere.n_vertices, 3)


@pytest.mark.long
def test_matching_tells_the_vertices_of_the_user(tmp_path, example):
    """The source as a file, the target as an object of another library, shuffled."""
    mesh = example[0].mesh
    copy, new = relabelled(mesh, 1)
    write_mesh(tmp_path / "source.ply", mesh)
    given = trimesh.Trimesh(copy.vertices, copy.faces, process=False)
    result = match(str(tmp_path / "source.ply"), given)
    assert (result.map.vertices == new).mean() > 0.99
    result.map.check_fits(mesh, copy)
    assert prepare(given).surface.content_hash == copy.content_hash
    back = result.map.reversed(tmp_path / "source.ply", given)
    assert isinstance(back, Correspondence)
    assert back.matched.all()
