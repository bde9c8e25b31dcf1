"""Laws of every format: what is written is read back, number for number and in order."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from isomatch._core.errors import DescriptorError, FormatError, MeshError, MissingFileError
from isomatch.io import FORMATS, Asset, read_mesh, write_mesh
from isomatch.surfaces import Mesh
from zoo import grid, zoo

INDEXED = [(".off", {}), (".obj", {}), (".ply", {"binary": True}), (".ply", {"binary": False})]
SOUP = [(".stl", {"binary": True}), (".stl", {"binary": False})]
BLACK_TO_WHITE = np.linspace(0, 255, 36).astype(np.uint8).reshape(12, 3)


@st.composite
def meshes(draw, width=64):
    n = draw(st.integers(1, 7))
    vertices = draw(arrays(np.float64, (n, 3), elements=st.floats(width=width)))
    faces = draw(arrays(np.int64, (draw(st.integers(0, 6)), 3), elements=st.integers(0, n - 1)))
    return Mesh(vertices, faces)


def round_trip(mesh, suffix, options):
    mesh_format = FORMATS[suffix]
    return mesh_format.read(mesh_format.write(Asset.of_mesh(mesh), **options), "file")


def assert_same(a, b):
    np.testing.assert_array_equal(a.vertices, b.vertices)
    np.testing.assert_array_equal(a.faces, b.faces)


@pytest.mark.parametrize(("suffix", "options"), INDEXED)
@given(mesh=meshes())
@settings(max_examples=40, deadline=None)
def test_indexed_formats_keep_every_number_and_the_order(suffix, options, mesh):
    assert_same(round_trip(mesh, suffix, options), mesh)


@pytest.mark.parametrize(("suffix", "options"), SOUP)
@given(mesh=meshes(width=32))
@settings(max_examples=40, deadline=None)
@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
def test_stl_keeps_every_corner(suffix, options, mesh):
    read = round_trip(mesh, suffix, options)
    np.testing.assert_array_equal(read.vertices[read.faces], mesh.vertices[mesh.faces])


@pytest.mark.parametrize(("suffix", "options"), INDEXED + SOUP)
@pytest.mark.parametrize("specimen", zoo("sound"), ids=repr)
def test_a_file_on_disk_holds_the_mesh(tmp_path, suffix, options, specimen):
    path = tmp_path / f"shape{suffix.upper()}"
    write_mesh(path, specimen.mesh, **options)
    read = read_mesh(path)
    np.testing.assert_allclose(
        read.vertices[read.faces], specimen.mesh.vertices[specimen.mesh.faces], rtol=1e-6
    )
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize(("suffix", "options"), [case for case in INDEXED if case[0] != ".obj"])
def test_faces_out_of_range_are_left_to_check(suffix, options):
    mesh = Mesh(np.eye(3), [[0, 1, 3], [-2, 0, 1]])
    assert_same(round_trip(mesh, suffix, options), mesh)


def test_colours_are_written_as_the_formats_have_them(tmp_path):
    write_mesh(tmp_path / "map.obj", grid(3, 4), colors=BLACK_TO_WHITE)
    assert (tmp_path / "map.obj").read_text().splitlines()[11].endswith(" 0.941176 0.968627 1")
    write_mesh(tmp_path / "map.ply", grid(3, 4), colors=BLACK_TO_WHITE, binary=False)
    text = (tmp_path / "map.ply").read_text()
    assert "property uchar blue" in text
    assert " 240 247 255\n" in text


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (
            "a.stl",
            {"colors": BLACK_TO_WHITE},
            "a .stl file has no option 'colors'; use one of .off, .obj, .ply",
        ),
        ("a.obj", {"binary": True}, "a .obj file has no option 'binary'; use one of .ply, .stl"),
        ("a.xyz", {}, "suffix '.xyz' is not a mesh format; use one of .off, .obj, .ply, .stl"),
        ("a", {}, "no suffix is not a mesh format"),
        ("absent/a.off", {}, "cannot be written"),
    ],
)
def test_refused_writes(tmp_path, name, options, message):
    with pytest.raises(FormatError, match=message.replace("(", r"\(")):
        write_mesh(tmp_path / name, grid(3, 4), **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("colors", [BLACK_TO_WHITE[:3], BLACK_TO_WHITE.astype(float)])
def test_colours_that_do_not_fit(tmp_path, colors):
    with pytest.raises(DescriptorError, match="uint8"):
        write_mesh(tmp_path / "a.ply", grid(3, 4), colors=colors)


@pytest.mark.parametrize(
    ("suffix", "mesh", "message", "options"),
    [
        (".ply", Mesh(np.eye(3), [[0, 1, 2**31]]), "exceed the 32 bits", {}),
        (".obj", Mesh(np.eye(3), [[0, 1, -2]]), "outside 0…2", {}),
        (".stl", Mesh(np.eye(3), [[0, 1, 3]]), "outside 0…2", {}),
        (".stl", Mesh(np.eye(3) * 1e39, [[0, 1, 2]]), "would move", {"binary": True, "rounded": True}),
    ],
)
def test_meshes_that_a_format_cannot_hold(tmp_path, suffix, mesh, message, options):
    with pytest.raises(MeshError, match=message):
        write_mesh(tmp_path / f"a{suffix}", mesh, **options)


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(MissingFileError, match="absent"):
        read_mesh(tmp_path / "absent.off")
    (tmp_path / "folder.off").mkdir()
    with pytest.raises(FormatError, match="opened"):
        read_mesh(tmp_path / "folder.off")


@pytest.mark.parametrize(("suffix", "options"), INDEXED + SOUP)
@given(data=st.data())
@settings(max_examples=30, deadline=None)
def test_a_damaged_file_gives_a_mesh_or_one_line_that_says_where(suffix, options, data):
    content = bytearray(FORMATS[suffix].write(Asset.of_mesh(grid(3, 3)), **options))
    start = data.draw(st.integers(0, len(content)))
    content[start : start + data.draw(st.integers(0, 6))] = data.draw(st.binary(max_size=4))
    message = "file:1: expected nothing else"
    try:
        FORMATS[suffix].read(bytes(content), "file")
    except FormatError as error:
        message = str(error)
    assert re.match(r"file:( byte )?\d+: expected [^\n]+\Z", message)
