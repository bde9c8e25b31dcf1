"""What each format and library carries in and out: the table of ``docs/formats.md``, row by row."""

import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from made import ATTRIBUTES, POINTS, POLYGONS, TEXTURE, textured, whole

from isomatch import read_asset, read_mesh, write_asset
from isomatch.io import (
    FORMATS,
    asset_from,
    linear_of,
    looks_of,
    pixels_of,
    srgb_of,
    to_meshio,
    to_open3d,
    to_pyvista,
    to_trimesh,
)

COLUMNS = ("polygons", "colour", "label", "face label", "scalar", "vector", "normal", "uv", "weights")
PAGE = Path(__file__).parents[2] / "docs" / "formats.md"
SUFFIXES = {
    "OFF": ".off",
    "OBJ": ".obj",
    "PLY": ".ply",
    "STL": ".stl",
    "glTF": ".gltf",
    "GLB": ".glb",
    "VTK": ".vtk",
    "VTP": ".vtp",
    "VTU": ".vtu",
    "GIFTI": ".gii",
    "FreeSurfer": ".pial",
}
OBJECTS = {
    "trimesh": to_trimesh,
    "PyVista": to_pyvista,
    "meshio": to_meshio,
    "Open3D": to_open3d,
}


def table():
    """The rows of the page: name to what it keeps."""
    rows = [
        [cell.strip() for cell in line.strip("|\n").split("|")]
        for line in PAGE.read_text("utf-8").splitlines()
    ]
    rows = [row for row in rows if row[0] in {*SUFFIXES, *OBJECTS}]
    return {
        row[0]: {column for column, cell in zip(COLUMNS, row[2:]) if cell.startswith("yes")} for row in rows
    }


def kept(found):
    """Which of the made attributes a surface still has, with the same values at the same corners."""
    whole_polygons = found.polygons.sizes.tolist() == POLYGONS.sizes.tolist()
    same = {"polygons"} if whole_polygons else set()
    for column, given in ATTRIBUTES.items():
        of_faces = given.domain == "face"
        named = given.kind in ("label", "scalar", "vector")
        for attribute in found.attributes:
            if (
                attribute.kind != given.kind
                or (attribute.domain == "face") != of_faces
                or (named and attribute.name != given.name)
            ):
                continue
            expected, values = at_corners(given, POLYGONS), at_corners(attribute, found.polygons)
            if not whole_polygons:
                expected = expected[POLYGONS.of_triangle if of_faces else POLYGONS.corner_of_triangle.ravel()]
            np.testing.assert_allclose(values[:, : expected.shape[1]], expected, atol=1e-6, err_msg=column)
            same.add(column)
    return same


def at_corners(attribute, polygons):
    """The values of the corners or faces as a table of floats."""
    values = attribute.dense_weights if attribute.kind == "weights" else attribute.values
    if attribute.kind == "colour" and values.dtype == np.uint8:
        values = values / 255
    if attribute.domain == "point":
        values = values[polygons.corners]
    return values.reshape(len(values), -1)


@pytest.fixture
def open3d(monkeypatch):
    """Open3D, or the few of its classes that a mesh is made of."""
    if find_spec("open3d"):
        return
    module = ModuleType("open3d")
    module.utility = SimpleNamespace(
        Vector3dVector=lambda values: values,
        Vector3iVector=lambda values: values,
        Vector2dVector=lambda values: values,
    )
    module.geometry = SimpleNamespace(
        TriangleMesh=lambda vertices, triangles: SimpleNamespace(vertices=vertices, triangles=triangles)
    )
    monkeypatch.setitem(sys.modules, "open3d", module)


def test_the_page_lists_every_format_and_library():
    assert set(table()) == {*SUFFIXES, *OBJECTS}
    assert set(SUFFIXES.values()) <= set(FORMATS)
    text = PAGE.read_text("utf-8")
    assert [suffix for suffix in FORMATS if f"`{suffix}`" not in text] == []


@pytest.mark.parametrize("name", SUFFIXES)
def test_a_file_keeps_what_the_page_says(tmp_path, name):
    path = tmp_path / f"surface{SUFFIXES[name]}"
    left = write_asset(path, whole())
    found = read_asset(path)
    np.testing.assert_allclose(found.mesh.vertices[found.vertex_of_corner][:3], POINTS[[0, 1, 2]], atol=1e-6)
    assert kept(found) == table()[name]
    lost = {column for column, a in ATTRIBUTES.items() if a in left}
    assert lost == set(ATTRIBUTES) - table()[name]
    assert read_mesh(path).n_faces == 7
    assert write_asset(path, found) == ()
    assert kept(read_asset(path)) == table()[name]


@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_keeps_what_the_page_says(name, open3d):
    found = asset_from(OBJECTS[name](whole()))
    assert kept(found) == table()[name]
    assert found.mesh.n_vertices == 7
    assert found.mesh.n_faces == 7


@pytest.mark.parametrize("kind", ["PBR", "simple"])
def test_a_texture_of_trimesh_goes_out_and_in(kind):
    given = to_trimesh(textured())
    if kind == "PBR":
        given.visual.material = given.visual.material.to_pbr()
    looks = looks_of(asset_from(given))
    [look] = looks.looks
    assert set(looks.of_triangle) == {0}
    assert np.array_equal(np.rint(255 * pixels_of(look.base.picture.data)), TEXTURE)
    assert list(look.base.tint) == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("change", "tint"),
    [
        (lambda m: setattr(m, "diffuse", np.uint8([51, 102, 255, 255])), [0.2, 0.4, 1, 1]),
        (lambda m: setattr(m, "diffuse", [0.2, 0.4, 1.0]), [0.2, 0.4, 1, 1]),
        (lambda m: setattr(m, "diffuse", type(m)().diffuse), [1, 1, 1, 1]),  # none was given
        (lambda m: setattr(m, "baseColorFactor", [0.2, 0.4, 1.0, 0.6]), srgb_of([0.2, 0.4, 1, 0.6])),
        (lambda m: setattr(m, "baseColorFactor", None), [1, 1, 1, 1]),
        (lambda m: setattr(m, "diffuse", np.array([51.0, 102, 255, 255])), [0.2, 0.4, 1, 1]),
    ],
    ids=["simple", "fractions", "unset", "PBR", "PBR without", "floats"],
)
def test_the_tint_of_a_texture_of_trimesh_stays(change, tint, request, tmp_path):
    mesh = to_trimesh(textured())
    if request.node.callspec.id.startswith("PBR"):
        mesh.visual.material = mesh.visual.material.to_pbr()
    change(mesh.visual.material)
    write_asset(tmp_path / "tinted.glb", asset_from(mesh))
    asset = read_asset(tmp_path / "tinted.glb")
    [look] = looks_of(asset).looks
    assert list(look.base.tint) == pytest.approx(tint)
    assert np.array_equal(np.rint(255 * pixels_of(look.base.picture.data)), TEXTURE)

    opened = to_trimesh(asset).visual.material.to_pbr()  # as trimesh writes it to a GLB file
    shown = np.asarray(opened.baseColorTexture) * (opened.baseColorFactor / 255)
    light = linear_of(TEXTURE / 255) * linear_of(tint)
    assert np.abs(shown - 255 * srgb_of(light)).max() < 0.51
