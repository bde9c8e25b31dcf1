"""Dialects of OBJ, OFF, PLY and STL: what other programs write is read with its values, or told."""

import numpy as np
import pytest

from isomatch import (
    Asset,
    Correspondence,
    FormatError,
    carry_attributes,
    check,
    read_asset,
    read_mesh,
    write_asset,
)
from isomatch.cli import main
from isomatch.io import FORMATS, Attribute
from isomatch.io.formats import obj, off, ply, stl
from isomatch.io.polygons import Polygons

POINTS = [[0.5, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]


def lines(rows, keyword=""):
    return "".join(f"{keyword}{' '.join(map(str, row))}\n" for row in rows)


def off_file(points=POINTS, faces=((3, 0, 1, 2), (3, 0, 2, 3)), header="OFF\n4 2 0\n"):
    return (header + lines(points) + lines(faces)).encode()


def obj_file(vertices=POINTS):
    return (lines(vertices, "v ") + "f 1 2 3\nf 1 3 4\n").encode()


def ply_file(properties="", points=POINTS):
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    face = "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    return (head + properties + face + lines(points) + "3 0 1 2\n3 0 2 3\n").encode()


def stl_file():
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + lines(np.array(POINTS)[face].tolist(), "vertex ")
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid a\n{facets}endsolid a\n".encode()


def binary_stl(count=2, words=(0, 0), header=b"", after=b""):
    whole = stl.write(Asset.of_mesh(FORMATS[".stl"].read(stl_file(), "a.stl")))
    rows = np.frombuffer(whole[84:], np.uint8).reshape(2, 50).copy()
    rows[:, 48:] = np.array(words, "<u2").view(np.uint8).reshape(2, 2)
    return header.ljust(80) + count.to_bytes(4, "little") + rows.tobytes() + after


READERS = [
    (obj.read, obj_file()),
    (off.read, off_file()),
    (ply.read, ply_file()),
    (FORMATS[".stl"].read, stl_file()),
]


@pytest.mark.parametrize(("read", "data"), READERS)
def test_what_is_no_finite_number(read, data):
    for word in ("nan", "-nan", "NaN", "inf", "-Infinity"):
        mesh = read(data.replace(b"0.5", word.encode()), "a")
        np.testing.assert_array_equal(mesh.vertices[0], [float(word), 0, 0])
        assert len(check(mesh).non_finite_vertices)
    for word in ("1.#QNAN", "-1.#IND00", "1.#INF", "-nan(ind)", "nan(1)", "1.#", "0.5#"):
        with pytest.raises(FormatError, match="expected"):
            read(data.replace(b"0.5", word.encode()), "a")


@pytest.mark.parametrize(("read", "data"), READERS)
def test_decimal_commas(read, data):
    assert read(data.replace(b"0.5", b"0,5").replace(b".0", b""), "a").vertices.tolist() == POINTS
    with pytest.raises(FormatError, match="expected numbers"):
        read(data.replace(b"0.5 0", b"0,5 0.0"), "a")


def encoded(encoding, mark):
    return mark + obj_file().decode().encode(encoding)


@pytest.mark.parametrize(
    ("read", "data"),
    [
        (obj.read, encoded("utf-16-le", b"\xff\xfe")),
        (ply.read, b"\xef\xbb\xbf" + ply_file()),
        (ply.read, ply_file().replace(b"ply", b"PLY", 1)),
        (ply.read, ply_file().replace(b"uchar int", b"uchar int64")),
        (off.read, off_file(header="4 2 0\n")),
        (off.read, off_file(header="OFF # four\n4 2 0 # v f e\n")),
        (off.read, off_file([[*(2 * np.array(p)), 2] for p in POINTS], header="4OFF\n4 2 0\n")),
        (FORMATS[".stl"].read, stl_file().replace(b"solid a", b"solid part #3")),
        (FORMATS[".stl"].read, stl_file().replace(b"endsolid a\n", b"")),
        (FORMATS[".stl"].read, stl_file().replace(b"solid a", b"solid endsolid", 1)),
        (FORMATS[".stl"].read, stl_file().partition(b"\n")[2]),
        (FORMATS[".stl"].read, binary_stl(count=0)),
        (FORMATS[".stl"].read, binary_stl(count=2**32 - 1, header=b"solid")),
        (FORMATS[".stl"].read, binary_stl(after=b"made by hand" * 9, header=b"solid")),
    ],
)
def test_variants(read, data):
    mesh = read(data, "a")
    assert mesh.vertices.tolist() == POINTS
    assert mesh.faces.tolist() == FACES


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (binary_stl(after=b"\0\0"), "2 bytes after the triangles are left out"),
        (binary_stl(count=0), "the header says 0 triangles; the 2 that follow are read"),
        (binary_stl(count=2**32 - 1), "the header says −1 triangles; the 2 that follow are read"),
        (binary_stl(words=(1, 2)), "the two bytes after each triangle are left out"),
        (stl_file().replace(b"endsolid a\n", b""), "there is no endsolid; the file may be cut short"),
        (stl_file() + b"made by hand\n", "1 lines after the last endsolid are left out"),
    ],
)
def test_what_a_stl_file_has_beside_is_a_note(tmp_path, capsys, data, note):
    (tmp_path / "a.stl").write_bytes(data)
    assert read_asset(tmp_path / "a.stl").notes == (note,)
    main(["check", str(tmp_path / "a.stl")])
    assert f"note: {note}" in capsys.readouterr().out


def test_colours_of_binary_stl_files():
    red, half_blue = 0b0_00000_00000_11111, 0b0_01111_00000_00000
    magics = stl.read_asset(binary_stl(words=(red, half_blue + 2**15), header=b"COLOR=\1\2\3\377"), "a.stl")
    assert magics.attribute("color", "face").values.tolist() == [[255, 0, 0], [1, 2, 3]]
    viscam = stl.read_asset(binary_stl(words=(red + 2**15, half_blue + 2**15)), "a.stl")
    assert viscam.attribute("color", "face").values.tolist() == [[0, 0, 255], [123, 0, 0]]
    some = stl.read_asset(binary_stl(words=(red + 2**15, 0)), "a.stl")
    np.testing.assert_array_equal(some.attribute("color", "face").values, [[0, 0, 255], [np.nan] * 3])
    assert some.notes == ("1 of 2 faces have no colour; it is nan there",)


COLOURS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [51, 102, 153]])
FRACTIONS = (COLOURS / 255).round(4)


def with_columns(columns):
    return [[*point, *row] for point, row in zip(POINTS, columns)]


@pytest.mark.parametrize(
    ("vertices", "after", "type_"),
    [
        (with_columns(COLOURS), "", np.uint8),
        (with_columns(FRACTIONS), "", float),
        (with_columns(np.column_stack([COLOURS, [1] * 4])), "", np.uint8),
        (POINTS, "# colours\r\n#MRGB ffff0000ff00ff00ff0000ffff336699\r\n", np.uint8),
    ],
)
def test_colours_of_obj_files(vertices, after, type_):
    asset = obj.read_asset(obj_file(vertices) + after.encode(), "a.obj")
    color = asset.attribute("color")
    np.testing.assert_allclose(color.fractions[:, :3], COLOURS / 255, atol=1e-4)
    assert (color.fractions[:, 3:] == 1).all()
    assert color.values.dtype == type_
    assert asset.notes == ()


def test_colours_of_some_vertices_are_kept_where_they_are(tmp_path):
    vertices = [POINTS[0], *with_columns(FRACTIONS)[1:3], POINTS[3]]
    (tmp_path / "a.obj").write_bytes(obj_file(vertices))
    asset = read_asset(tmp_path / "a.obj")
    expected = np.where([[False], [True], [True], [False]], FRACTIONS, np.nan)
    np.testing.assert_array_equal(asset.attribute("color").values, expected)
    assert asset.notes == ("2 of 4 points have no colour; it is nan there",)
    write_asset(tmp_path / "b.obj", asset)
    np.testing.assert_array_equal(read_asset(tmp_path / "b.obj").attribute("color").values, expected)
    for suffix in (".glb", ".ply", ".off", ".vtp"):
        write_asset(tmp_path / f"b{suffix}", asset)
        found = read_asset(tmp_path / f"b{suffix}").attribute("color").fractions[:, :3]
        missing = np.ones(3) if suffix == ".glb" else np.full(3, np.nan)
        np.testing.assert_allclose(found, np.where(np.isnan(expected), missing, expected), atol=1e-6)


@pytest.mark.parametrize(
    ("header", "normals", "colours", "texture"),
    [
        ("OFF", 0, COLOURS, 0),
        ("OFF", 0, np.column_stack([COLOURS, [255, 255, 0, 128]]), 0),
        ("NCOFF", 1, np.column_stack([COLOURS, [255] * 4]), 0),
        ("STCNOFF", 1, FRACTIONS, 1),
        ("STOFF", 0, np.zeros((4, 0)), 1),
    ],
)
def test_columns_of_vertices_of_off_files(tmp_path, header, normals, colours, texture):
    uv = [[0.25, 0.5]] * 4
    columns = np.hstack(
        [[[0, 0, 1]] * 4 if normals else np.zeros((4, 0)), colours, uv if texture else np.zeros((4, 0))]
    )
    rows = [[f"{value:g}" for value in row] for row in columns.tolist()]
    (tmp_path / "a.off").write_bytes(off_file(with_columns(rows), header=f"{header}\n4 2 0\n"))
    for name in "ab":
        asset = read_asset(tmp_path / f"{name}.off")
        assert asset.points.tolist() == POINTS
        if colours.size:
            full = 255 if np.max(colours) > 1 else 1
            found, expected = asset.attribute("color").fractions, colours / full
            n = 4 if name == "a" else 3  # opacity is told to be left out
            np.testing.assert_allclose(found[:, :n], expected[:, :n])
        if normals:
            np.testing.assert_array_equal(asset.attribute("normal").values, [[0, 0, 1]] * 4)
        if texture:
            np.testing.assert_array_equal(asset.attribute("uv").values, uv)
        assert asset.notes == ()
        left = write_asset(tmp_path / "b.off", asset)
        assert [lost.name for lost in left] == (
            ["opacity of color"] if name == "a" and "128" in str(colours) else []
        )


def test_colours_of_faces_of_off_files(tmp_path):
    data = off_file(faces=[(4, 0, 1, 2, 3, 255, 0, 0), (3, 0, 2, 3, 51, 102, 153)])
    (tmp_path / "a.off").write_bytes(data)
    for name in "ab":
        asset = read_asset(tmp_path / f"{name}.off")
        assert asset.attribute("color", "face").values.tolist() == [[255, 0, 0], [51, 102, 153]]
        assert [a.domain for a in asset.attributes] == ["face"]
        assert write_asset(tmp_path / "b.off", asset) == ()
    both = asset.with_attributes(Attribute("color", "point", "colour", COLOURS.astype(np.uint8)))
    assert write_asset(tmp_path / "c.off", both) == ()
    found = read_asset(tmp_path / "c.off")
    assert found.attribute("color", "point").values.tolist() == COLOURS.tolist()
    assert found.attribute("color", "face").values.tolist() == [[255, 0, 0], [51, 102, 153]]


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (
            off_file(faces=[(3, 0, 1, 2, 7), (3, 0, 2, 3, 8)]),
            "indices into a colour map of faces are left out",
        ),
        (off_file(with_columns([[-1, 0, 2]] * 4)), "3 numbers after the positions of vertices are left out"),
        (
            off_file(with_columns([[5]] * 4), header="COFF\n4 2 0\n"),
            "indices into a colour map of vertices are left out",
        ),
    ],
)
def test_what_an_off_file_has_beside_is_a_note(data, note):
    assert off.read_asset(data, "a.off").notes == (note,)


@pytest.mark.parametrize("names", ["red green blue", "r g b", "diffuse_red diffuse_green diffuse_blue"])
def test_colours_of_ply_files(names):
    properties = "".join(f"property uchar {name}\n" for name in names.split())
    asset = ply.read_asset(ply_file(properties, with_columns(COLOURS)), "a.ply")
    assert asset.attribute("color").values.tolist() == COLOURS.tolist()


def test_whole_numbers_of_64_bits_in_ply_files(tmp_path):
    properties = "property int64 key\nproperty list uchar uint64 keys\n"
    rows = [[2**40, 1, 2**40], [1, 0], [2, 0], [3, 0]]
    asset = ply.read_asset(ply_file(properties, with_columns(rows)), "a.ply")
    assert asset.attribute("key").values.tolist() == [2**40, 1, 2, 3]
    assert [lost.name for lost in write_asset(tmp_path / "a.ply", asset)] == ["key"]
    assert b"property list uchar uint64 keys" in (tmp_path / "a.ply").read_bytes()


def test_missing_colours_are_grey_where_they_are_carried():
    asset = obj.read_asset(obj_file([POINTS[0], *with_columns(FRACTIONS)[1:]]), "a.obj")
    other = Asset(POINTS, Polygons([0, 1, 2, 0, 2, 3], [3, 3]))
    carried = carry_attributes(Correspondence(range(4), n_target=4), other, asset, ["color"])
    np.testing.assert_allclose(carried.asset.attribute("color").values, [[0.5] * 3, *FRACTIONS[1:]])


def test_meshes_and_assets_have_the_same_triangles(tmp_path):
    for name, data in (
        ("a.obj", obj_file()),
        ("a.off", off_file()),
        ("a.ply", ply_file()),
        ("a.stl", stl_file()),
    ):
        (tmp_path / name).write_bytes(data)
        asset, mesh = read_asset(tmp_path / name), read_mesh(tmp_path / name)
        np.testing.assert_array_equal(asset.points, mesh.vertices)
        np.testing.assert_array_equal(asset.polygons.triangles, mesh.faces)
