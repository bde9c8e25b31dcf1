"""Files as Blender, Connectome Workbench, ParaView and scanners write them, read and written back the same."""

import json
import struct

import numpy as np
import pytest
from PIL import Image

from isomatch import Asset, Correspondence, FormatError, Mesh, check, read_asset, read_mesh, write_asset
from isomatch.cli import main
from isomatch.io import (
    FORMATS,
    Attribute,
    Polygons,
    looks_of,
    read_attributes,
    unreadable_files,
    write_attributes,
)
from isomatch.io.formats.freesurfer import SURFACES
from shapes import icosphere

SPHERE = icosphere(1)
N = SPHERE.n_vertices


def ply(names, kind=b"float"):
    header = [b"ply", b"format binary_little_endian 1.0", b"element vertex 3"]
    header += [b"property float " + name for name in (b"x", b"y", b"z")]
    header += [b"property " + kind + b" " + name for name in names]
    header += [b"element face 1", b"property list uchar uint vertex_indices", b"end_header\n"]
    rows = np.column_stack([np.eye(3), np.tile(np.arange(len(names)), (3, 1))]).astype("<f4")
    return b"\n".join(header) + rows.tobytes() + struct.pack("<B3I", 3, 0, 1, 2)


@pytest.mark.parametrize(
    "names",
    [["頭", "à", "Å"], ["Bone L", "Bone R"], ["Bip01 L Thigh", "L"], ["Bone  L"], ["\xa0"]],
    ids=str,
)
def test_names_of_ply_are_utf_8_may_have_blanks_and_come_back(tmp_path, names):
    words = [name.encode() for name in names]
    (tmp_path / "a.ply").write_bytes(ply(words))
    asset = read_asset(tmp_path / "a.ply")
    assert [attribute.name for attribute in asset.attributes] == names
    write_asset(tmp_path / "b.ply", asset)
    header = (tmp_path / "b.ply").read_bytes().partition(b"end_header")[0]
    assert all(b"property float " + word + b"\n" in header for word in words)
    Correspondence(range(3), 3).save(tmp_path / "map.npz")
    write_asset(tmp_path / "scan.ply", Asset.of_mesh(Mesh(np.eye(3), [[0, 1, 2]])))
    argv = [
        "transfer",
        *(str(tmp_path / name) for name in ("map.npz", "a.ply", "scan.ply")),
        "--to",
        "target",
    ]
    assert main([*argv, "-o", str(tmp_path / "c.ply")]) == 0
    assert [attribute.name for attribute in read_asset(tmp_path / "c.ply").attributes] == names


def test_blanks_in_the_names_of_other_formats_are_lost_in_ply_and_that_is_told(tmp_path):
    asset = Asset.of_mesh(SPHERE, [Attribute("grey value", "point", "scalar", np.arange(N))])
    (left,) = write_asset(tmp_path / "a.ply", asset)
    assert left.name == "the blanks in the name grey value"
    assert read_asset(tmp_path / "a.ply").attributes[0].name == "grey_value"


def test_strips_of_triangles_of_ply(tmp_path):
    points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n"
    header = "ply\nformat ascii 1.0\nelement vertex 5\n" + "".join(f"property float {x}\n" for x in "xyz")
    header += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(f"{header}{points}8 0 1 2 3 -1 2 3 4\n")
    assert read_mesh(tmp_path / "a.ply").faces.tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4]]


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".vtp", ".vtk"])
def test_arrays_of_vtk_keep_names_types_and_fields_and_strips_are_triangles(tmp_path, suffix):
    pyvista = pytest.importorskip("pyvista")
    mesh = pyvista.Sphere(theta_resolution=6, phi_resolution=6).strip()
    mesh.point_data["RGB"] = np.full((mesh.n_points, 3), 7, np.uint8)
    mesh.point_data["with space"] = np.arange(mesh.n_points) + 2**40
    mesh.field_data["TimeValue"], mesh.field_data["told"] = [2.5], ["a text"]
    mesh.save(tmp_path / f"a{suffix}")
    asset = read_asset(tmp_path / f"a{suffix}")
    assert asset.mesh.area == pytest.approx(mesh.area)
    assert not check(asset.mesh).inconsistent_edges.size
    write_asset(tmp_path / f"b{suffix}", asset)
    again = pyvista.read(tmp_path / f"b{suffix}")
    assert {*mesh.point_data.keys()} == {*again.point_data.keys()}
    for name in mesh.point_data:
        assert again.point_data[name].dtype == mesh.point_data[name].dtype
        np.testing.assert_array_equal(again.point_data[name], mesh.point_data[name])
    assert again.field_data["TimeValue"].tolist() == [2.5]
    assert again.field_data["told"][0] == "a text"


def test_a_surface_of_workbench_has_two_arrays_and_values_go_beside_it(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    for name, structure in (("lh", "CortexLeft"), ("rh", "CortexRight")):
        gifti = nibabel.gifti
        meta = {"AnatomicalStructurePrimary": structure}
        points = gifti.GiftiDataArray(SPHERE.vertices.astype("f4"), 1008, meta=meta)
        faces = gifti.GiftiDataArray(SPHERE.faces.astype("i4"), 1009)
        gifti.GiftiImage(darrays=[points, faces]).to_filename(tmp_path / f"{name}.surf.gii")
    (tmp_path / "values.csv").write_text("part,depth\n" + "".join(f"{i % 3},{i / 7}\n" for i in range(N)))
    Correspondence(range(N), N).save(tmp_path / "map.npz")
    out = tmp_path / "out"
    out.mkdir()
    argv = ["transfer", *(str(tmp_path / name) for name in ("map.npz", "lh.surf.gii", "rh.surf.gii"))]
    argv += ["--to", "target", "--values", str(tmp_path / "values.csv")]
    assert main([*argv, "-o", str(out / "a.surf.gii")]) == 0
    assert main([*argv, "-o", str(out / "v.func.gii")]) == 0
    assert {path.name for path in out.iterdir()} == {"a.surf.gii", "a.func.gii", "a.label.gii", "v.func.gii"}
    assert len(nibabel.load(out / "a.surf.gii").darrays) == 2
    for name in ("a.func.gii", "a.label.gii", "v.func.gii"):
        assert nibabel.load(out / name).meta["AnatomicalStructurePrimary"] == "CortexRight"
    assert read_attributes(out / "a.label.gii")[0].values.tolist() == [i % 3 for i in range(N)]
    assert main([*argv, "-o", str(out / "a.surf.gii")]) == 1  # none of the files is replaced unasked


def keys_of(path):
    data = path.read_bytes()
    document = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    return [list(primitive["attributes"]) for mesh in document["meshes"] for primitive in mesh["primitives"]]


@pytest.mark.parametrize(
    ("first", "written"),
    [
        (["COLOR_0", "COLOR_1"], ["COLOR_0", "COLOR_1"]),
        (["COLOR_0"], ["COLOR_0"]),
        (["COLOR_1"], ["COLOR_1", "COLOR_0"]),  # which is not valid alone
    ],
)
def test_white_colours_of_one_mesh_stay_and_numbers_have_no_gap(tmp_path, first, written):
    octets = np.eye(3, dtype="<f4").tobytes() + np.ones((3, 3), "<f4").tobytes()
    octets += np.array([[0.5, 0, 0]] * 3, "<f4").tobytes()
    accessors = [{"bufferView": i, "componentType": 5126, "count": 3, "type": "VEC3"} for i in range(3)]
    views = [{"buffer": 0, "byteOffset": 36 * i, "byteLength": 36} for i in range(3)]
    accessors[0] |= {"min": [0, 0, 0], "max": [1, 1, 1]}
    coloured = {"POSITION": 0, **{key: 1 + int(key[-1]) for key in first}}
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"mesh": 1}],
        "meshes": [{"primitives": [{"attributes": keys}]} for keys in (coloured, {"POSITION": 0})],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(octets)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(octets), b"BIN\0") + octets
    )
    (tmp_path / "a.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    write_asset(tmp_path / "b.glb", read_asset(tmp_path / "a.glb"))
    assert keys_of(tmp_path / "b.glb") == [["POSITION", *written], ["POSITION"]]


def test_pictures_of_tiles_are_found_by_their_numbers(tmp_path):
    colours = {1001: (255, 0, 0), 1002: (0, 0, 255), 1011: (0, 255, 0)}
    for tile, colour in colours.items():
        Image.new("RGB", (2, 2), colour).save(tmp_path / f"skin.{tile}.png")
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd skin.<UDIM>.png\n")
    corners = ((0, 0), (1, 0), (0, 1), (2, 0))
    places = [f"vt {u + du} {v + dv}" for u, v in corners for du, dv in ((0.1, 0.1), (0.9, 0.1), (0.1, 0.9))]
    faces = [f"f 1/{3 * i + 1} 2/{3 * i + 2} 3/{3 * i + 3}" for i in range(4)]
    lines = ["mtllib a.mtl", "v 0 0 0", "v 1 0 0", "v 0 1 0", *places, "usemtl skin", *faces]
    (tmp_path / "a.obj").write_text("\n".join(lines) + "\n")
    asset = read_asset(tmp_path / "a.obj")
    looks = looks_of(asset)
    shown = [looks.looks[i].base.picture.name for i in looks.of_triangle]
    assert shown == [f"skin.{tile}.png" for tile in (1001, 1002, 1011, 1003)]
    assert unreadable_files(asset) == ("'skin.1003.png': there is no such file in the folder of the surface",)
    (tmp_path / "out").mkdir()
    write_asset(tmp_path / "out" / "b.obj", asset)
    again = looks_of(read_asset(tmp_path / "out" / "b.obj"))
    assert [again.looks[i].base.picture.data for i in again.of_triangle] == [
        looks.looks[i].base.picture.data for i in looks.of_triangle
    ]


SMALL = {
    "no points": Asset(np.zeros((0, 3)), Polygons([], [])),
    "one point": Asset(np.ones((1, 3)), Polygons([], [])),
    "no faces": Asset(np.eye(3), Polygons([], [])),
    "one face": Asset(np.eye(3), Polygons([0, 1, 2], [3])),
    "one place": Asset(np.zeros((3, 3)), Polygons([0, 1, 2], [3])),
}


@pytest.mark.parametrize(
    "suffix", [each for each in FORMATS if each not in (*SURFACES, ".vtk", ".vtp", ".vtu")]
)
@pytest.mark.parametrize("name", SMALL)
def test_the_smallest_surfaces_of_all_formats_are_checked_and_mended_or_refused(
    tmp_path, name, suffix, capsys
):
    path = tmp_path / f"a{suffix}"
    try:
        write_asset(path, SMALL[name])
    except ValueError:
        path.write_bytes(b"OFF\n0 0 0\n")  # what is no file of the format
    assert main(["check", str(tmp_path)]) in (0, 1)
    for weld in ([], ["--weld", "1e9"]):
        code = main(["repair", str(path), "-o", str(tmp_path / "b.ply"), "--force", *weld])
        assert code in (0, 1)
        if code == 0:
            assert read_mesh(tmp_path / "b.ply").n_vertices
    if name == "one face" and path.stat().st_size > 10:
        assert code == 1
        assert "--weld 1e+09 is in the units of the file" in capsys.readouterr().err


def test_a_book_of_close_pages_is_checked_in_time_that_grows_with_the_pages():
    """Points near a side are sought by pieces, which are near few pages."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    moved = [(0.01 * np.sin(i), 0.01 * np.cos(3 * i), 1e-5 * i) for i in range(300)]
    pages = [np.add(square, offset) for offset in moved]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    book = Mesh(np.concatenate(pages), np.concatenate([faces + 4 * i for i in range(300)]))
    assert len(check(book).component_vertices) == 300


def test_normals_and_colours_of_off_in_the_order_of_meshlab(tmp_path):
    rows = "0 0 0 186 172 30 255 {0}\n1 0 0 0 214 9 255 {0}\n0 1 0 7 8 9 255 {0}\n3 0 1 2\n"
    (tmp_path / "a.off").write_text("NCOFF\n3 1 0\n" + rows.format("1.9 -5.7 0.7"))
    normal, color = read_asset(tmp_path / "a.off").attributes
    assert color.values.tolist() == [[186, 172, 30, 255], [0, 214, 9, 255], [7, 8, 9, 255]]
    assert normal.values[0].tolist() == [1.9, -5.7, 0.7]


def stl(words):
    triangles = np.zeros(len(words), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = np.eye(3)
    triangles["attribute"] = words
    return b"COLOR=\x7f\x7f\x7f ".ljust(80) + len(words).to_bytes(4, "little") + triangles.tobytes()


@pytest.mark.parametrize(
    ("words", "colours"),
    [
        ([31 | 2**15, 31 << 10 | 2**15], [[255, 0, 0], [0, 0, 255]]),  # of MeshLab, all marked
        ([31, 31 << 10 | 2**15], [[255, 0, 0], [127] * 3]),
        ([2**15, 2**15], [[127] * 3] * 2),
    ],
)
def test_colours_of_stl_with_a_default_colour(tmp_path, words, colours):
    (tmp_path / "a.stl").write_bytes(stl(words))
    assert read_asset(tmp_path / "a.stl").attribute("color").values.tolist() == colours


def test_a_cloud_of_pcl_declares_no_faces(tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 1\n" + "".join(f"property float {x}\n" for x in "xyz")
    (tmp_path / "a.ply").write_text(f"{header}element face 0\nend_header\n1 2 3\n")
    assert read_asset(tmp_path / "a.ply").points.tolist() == [[1, 2, 3]]


def test_a_cloud_of_cloudcompare_names_its_columns_and_counts_its_rows(tmp_path):
    (tmp_path / "a.asc").write_text("//X Y Z Height\n2\n1 2 3 7.5\n4 5 6 8.5\n")
    asset = read_asset(tmp_path / "a.asc")
    assert asset.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert asset.attribute("Height").values.tolist() == [7.5, 8.5]


def test_new_colours_of_ply_are_bytes_and_those_of_its_file_stay(tmp_path):
    shares = np.column_stack([np.linspace(0, 1, N)] * 3)
    write_asset(tmp_path / "a.ply", Asset.of_mesh(SPHERE, [Attribute("color", "point", "colour", shares)]))
    (found,) = read_asset(tmp_path / "a.ply").attributes
    assert found.values.dtype == np.uint8
    assert np.abs(found.fractions - shares).max() < 0.5001 / 255
    (tmp_path / "b.ply").write_bytes(ply([b"red", b"green", b"blue"]))
    asset = read_asset(tmp_path / "b.ply")
    write_asset(tmp_path / "c.ply", asset)
    assert read_asset(tmp_path / "c.ply").attributes[0].values.dtype == np.float32


def test_normals_and_colours_of_gltf_are_valid(tmp_path):
    normals = 3.0 * SPHERE.vertices
    normals[:2] = [0, 0, 0], [np.nan] * 3
    given = [
        Attribute("normal", "point", "normal", normals),
        Attribute("color", "point", "colour", np.full((N, 3), 1.0005)),
    ]
    write_asset(tmp_path / "a.glb", Asset.of_mesh(SPHERE, given))
    asset = read_asset(tmp_path / "a.glb")
    found = asset.attribute("normal").values
    assert np.abs(np.linalg.norm(found, axis=1) - 1).max() < 1e-6
    assert np.abs(found[2:] - SPHERE.vertices[2:]).max() < 1e-6
    assert asset.attribute("color").fractions.max() <= 1


def test_workbench_opens_no_metric_file_with_vectors_or_colours(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    scalar = Attribute("depth", "point", "scalar", np.arange(N) / 7)
    colour = Attribute("color", "point", "colour", np.zeros((N, 3), np.uint8))
    vector = Attribute("flow", "point", "vector", SPHERE.vertices)
    assert write_attributes(tmp_path / "a.func.gii", [scalar, colour, vector]) == (colour, vector)
    assert write_attributes(tmp_path / "a.rgba.gii", [colour, vector, colour]) == (vector, colour)
    assert len(nibabel.load(tmp_path / "a.func.gii").darrays) == 1


def test_arrays_of_gifti_in_another_file_are_refused_with_the_remedy(tmp_path):
    pytest.importorskip("nibabel")
    array = '<DataArray Encoding="ExternalFileBinary" ExternalFileName="a.data"><Data/></DataArray>'
    (tmp_path / "a.surf.gii").write_text(f'<GIFTI Version="1.0" NumberOfDataArrays="1">{array}</GIFTI>')
    with pytest.raises(FormatError, match=r"a\.surf\.gii: its arrays are in another file.*-gifti-convert"):
        read_asset(tmp_path / "a.surf.gii")
