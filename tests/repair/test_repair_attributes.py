"""What a file carries goes through a repair: each value is where its point, corner or face went."""

import json

import numpy as np
import pytest

from isomatch import Asset, Correspondence, Mesh, carry_attributes, read_asset, write_asset
from isomatch.cli import main
from isomatch.io import Attribute, Layer, Look, Looks, Part, Polygons, looks_of, png_of, with_texture
from isomatch.io.formats.gltf_carried import with_materials
from isomatch.repair import check, repair
from shapes import flat_grid, icosphere

SOUND = icosphere(2)


def damaged(mesh=SOUND):
    """A mesh with a point twice, one alone, one of nan, and faces repeated, degenerate, out of range and rewound."""
    twice, of_nan = mesh.n_vertices, mesh.n_vertices + 2
    points = np.vstack([mesh.vertices, mesh.vertices[5], [9, 9, 9], [np.nan] * 3])
    faces = mesh.faces.copy()
    torn = np.flatnonzero((faces == 5).any(axis=1))[-1]
    faces[torn][faces[torn] == 5] = twice
    faces[3] = faces[3, ::-1]
    more = [[2, 2, 9], faces[10][[1, 2, 0]], [0, 1, of_nan], [0, 1, 999]]
    return Mesh(points, np.vstack([faces, more]))


def painted(mesh):
    """Values of every kind that say which point, corner or face they are of."""
    n, m = mesh.n_vertices, mesh.n_faces
    rng = np.random.default_rng(0)
    return (
        Attribute("color", "point", "colour", rng.integers(0, 256, (n, 3)).astype(np.uint8)),
        Attribute("region", "point", "label", np.arange(n)),
        Attribute("depth", "point", "scalar", rng.random(n)),
        Attribute("flow", "point", "vector", rng.random((n, 3))),
        Attribute("weights", "point", "weights", rng.random((n, 2)), rng.integers(0, 5, (n, 2)), {4: "tail"}),
        Attribute("uv", "corner", "uv", rng.random((3 * m, 2))),
        Attribute("part", "face", "label", np.arange(m)),
        Attribute("pressure", "face", "scalar", rng.random(m)),
    )


def test_every_value_follows_its_index():
    bad = damaged()
    before = Asset.of_mesh(bad, painted(bad))
    mended = repair(before)
    after = mended.asset
    assert check(after.mesh).ok
    np.testing.assert_array_equal(mended.mesh.faces, after.polygons.triangles)
    np.testing.assert_array_equal(mended.polygon_index, mended.face_index)
    for attribute in before.attributes:
        found = after.attribute(attribute.name)
        assert (found.domain, found.kind, found.values.dtype) == (
            attribute.domain,
            attribute.kind,
            attribute.values.dtype,
        )
        if attribute.domain != "corner":
            index = mended.vertex_index if attribute.domain == "point" else mended.face_index
            np.testing.assert_array_equal(found.values, attribute.values[index])
            if attribute.joints is not None:
                np.testing.assert_array_equal(found.joints, attribute.joints[index])
    # a corner keeps its value where it goes, also in a face that is turned over
    given = before.attribute("uv").values.reshape(-1, 3, 2)[mended.face_index]
    carried = after.attribute("uv").values.reshape(-1, 3, 2)
    was = mended.new_index[bad.faces[mended.face_index]]
    for old_face, new_face, old, new in zip(was, mended.mesh.faces, given, carried):
        for vertex in new_face:
            np.testing.assert_array_equal(new[new_face == vertex], old[old_face == vertex])
    assert (was != mended.mesh.faces).any()


def test_the_first_value_wins_and_the_others_are_told():
    bad = damaged()
    values = np.zeros(bad.n_vertices)
    values[SOUND.n_vertices] = 7.0  # of the point that is welded onto point 5
    same, other = (
        Attribute("same", "point", "scalar", np.zeros(bad.n_vertices)),
        Attribute("other", "point", "scalar", values),
    )
    blank = Attribute("blank", "point", "scalar", np.full(bad.n_vertices, np.nan))
    mended = repair(Asset.of_mesh(bad, [same, other, blank]))
    assert [change for change in mended.changes if "kept" in change] == [
        "kept the first value of other at 1 welded vertex where it differs"
    ]
    assert mended.asset.attribute("other").values[5] == 0


def test_a_seam_of_the_texture_stays():
    """Points split along a seam are one afterwards, and their corners keep the texture coordinates of both sides."""
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]]
    )
    faces = [[0, 1, 2], [0, 2, 3], [4, 6, 7], [4, 7, 5]]
    uv = np.array([[0, 0], [0.5, 0], [0.5, 1], [0, 1], [0.9, 0], [0.9, 1], [0.6, 0], [0.6, 1]])
    mended = repair(Asset.of_mesh(Mesh(points, faces), [Attribute("uv", "point", "uv", uv)]))
    assert len(mended.asset.points) == 6
    found = mended.asset.attribute("uv", "corner")
    np.testing.assert_array_equal(found.values, uv[np.ravel(faces)])
    assert "kept uv at corners, as it differs at 2 welded vertices" in mended.changes


def test_quads_stay_quads_unless_they_lose_a_triangle():
    points = [[x, y, 0.0] for y in range(3) for x in range(3)]
    corners = [0, 1, 4, 3, 1, 4, 5, 2, 3, 4, 4, 6, 4, 5, 8, 7]  # turned over; one point twice
    part = Attribute("part", "face", "label", [10, 11, 12, 13])
    corner = Attribute("uv", "corner", "uv", np.arange(32.0).reshape(16, 2))
    mended = repair(Asset(points, Polygons(corners, [4, 4, 4, 4]), (part, corner)))
    after = mended.asset
    assert after.polygons.sizes.tolist() == [4, 4, 3, 4]
    assert after.polygons.corners.tolist() == [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 6, 4, 5, 8, 7]
    assert after.attribute("part").values.tolist() == [10, 11, 12, 13]
    rows = [0, 1, 2, 3, 4, 7, 6, 5, 8, 10, 11, 12, 13, 14, 15]
    np.testing.assert_array_equal(after.attribute("uv").values, corner.values[rows])
    assert repair(after).changes == ()


def test_normals_of_faces_turned_over_are_turned_too():
    inward = Mesh(SOUND.vertices, SOUND.faces[:, ::-1])
    given = Attribute("normal", "point", "normal", inward.vertex_normals)
    right = Attribute("normal", "point", "normal", SOUND.vertex_normals)
    for normal in (given, right):
        found = repair(Asset.of_mesh(inward, [normal])).asset.attribute("normal").values
        np.testing.assert_allclose(found, SOUND.vertex_normals, atol=1e-12)


def test_meshes_of_other_libraries_keep_their_arrays():
    trimesh = pytest.importorskip("trimesh")
    bad = damaged()
    colors = np.random.default_rng(0).integers(0, 256, (bad.n_vertices, 4)).astype(np.uint8)
    given = trimesh.Trimesh(bad.vertices, bad.faces[:-1], vertex_colors=colors, process=False)
    mended = repair(given)
    found = mended.asset.attribute("color").values
    np.testing.assert_array_equal(found, colors[mended.vertex_index])


def test_a_sound_asset_is_the_same_object():
    asset = Asset.of_mesh(SOUND, painted(SOUND))
    assert repair(asset).asset is asset
    assert repair(SOUND).asset is None


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".vtp", ".vtu", ".gii"])
def test_files_keep_what_their_format_holds(tmp_path, suffix, capsys):
    """Through the command: the same as the asset repaired in memory."""
    bad = damaged()
    bad = bad if suffix in (".ply", ".vtp") else Mesh(np.nan_to_num(bad.vertices, nan=8.0), bad.faces[:-2])
    names = ("color", "region", "depth", "part")
    values = tuple(a for a in painted(bad) if a.name in names)
    write_asset(tmp_path / f"a{suffix}", Asset.of_mesh(bad, values))
    given = read_asset(tmp_path / f"a{suffix}", sound=False)
    assert main(["repair", str(tmp_path / f"a{suffix}"), "-o", str(tmp_path / f"b{suffix}")]) == 0
    assert "no place" not in capsys.readouterr().out
    found = read_asset(tmp_path / f"b{suffix}")
    index = np.load(tmp_path / "b.index.npz")
    assert [(a.name, a.kind) for a in found.attributes] == [(a.name, a.kind) for a in given.attributes]
    for before, after in zip(given.attributes, found.attributes):
        rows = index["vertex_index" if before.domain == "point" else "polygon_index"]
        np.testing.assert_array_equal(after.values, before.values[rows])
    assert check(found.mesh).ok


def test_texture_coordinates_of_a_file_with_wild_faces(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nusemtl a\n"
    text += "f 1/1 2/2 3/3\nusemtl b\nf 4/2 5/4 3/3\nf 1/1 2/2 99/3\nl 4 5\nl 1 99\n"
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + text)
    mended = repair(tmp_path / "a.obj")
    assert write_asset(tmp_path / "b.obj", mended.asset) == ()
    lines = (tmp_path / "b.obj").read_text().splitlines()
    assert [line for line in lines if line[0] in "fl"] == ["f 1/1 2/2 3/3", "f 2/2 4/4 3/3", "l 2 4"]
    assert [line for line in lines if line.startswith(("usemtl", "mtllib"))] == [
        "mtllib a.mtl", "usemtl a", "usemtl b"
    ]  # fmt: skip


def test_attributes_that_cannot_be_read_do_not_keep_the_mesh_from_being_mended(tmp_path, capsys):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nvt 0 0\nf 1/1 2/7 3/1\n")
    assert main(["repair", str(tmp_path / "a.obj"), "-o", str(tmp_path / "b.obj")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("left out all but points and faces, as ")
    assert "expected indices of the 1 vt lines, found '1/1 2/7 3/1'" in lines[0]
    assert lines[1] == "removed 1 vertex that no face used"
    assert len(read_asset(tmp_path / "b.obj").points) == 3


PLY = """ply
format ascii 1.0
comment TextureFile skin.png
element vertex 5
property float x
property float y
property float z
property list uchar int bones
element face 2
property list uchar int vertex_indices
property list uchar int tags
element edge 3
property int vertex1
property int vertex2
property uchar crease
end_header
9 9 9 1 4
0 0 0 0
1 0 0 2 1 2
0 1 0 1 3
1 0 0 1 9
3 1 2 3 1 5
3 1 4 3 2 6 7
1 2 10
0 3 20
3 4 30
"""


def test_elements_of_ply_files_that_number_points(tmp_path):
    """The second face is the first one after the weld; edges follow, except the edge of a removed point."""
    (tmp_path / "a.ply").write_text(PLY)
    write_asset(tmp_path / "b.ply", repair(tmp_path / "a.ply").asset)
    header, _, body = (tmp_path / "b.ply").read_text().partition("end_header\n")
    assert body.splitlines() == [
        "0 0 0 0",
        "1 0 0 2 1 2",
        "0 1 0 1 3",
        "3 0 1 2 1 5",
        "0 1 10",
        "2 1 30",
    ]
    assert "comment TextureFile skin.png" in header


def skinned(tmp_path):
    """A textured, skinned cylinder, split along a seam, with a morph target and a face of no area, below a moved node."""
    around, up = 8, 4
    flat = flat_grid(up, around + 1)
    u, v = flat.vertices[:, 0] / around, flat.vertices[:, 1] / (up - 1)
    angle = 2 * np.pi * (u % 1)
    points = np.column_stack([np.cos(angle), np.sin(angle), 2 * v])
    faces = np.vstack([flat.faces, [[3, 3, 4]]])
    asset = Asset.of_mesh(
        Mesh(points, faces),
        (
            Attribute("uv", "point", "uv", np.column_stack([u, v])),
            Attribute(
                "weights", "point", "weights", np.column_stack([1 - v, v]), names={0: "root", 1: "tip"}
            ),
            Attribute("depth", "point", "scalar", v),
        ),
    )
    picture = np.zeros((4, 64, 4), np.uint8)
    picture[..., 0], picture[..., 3] = 4 * np.arange(64), 255
    write_asset(tmp_path / "first.gltf", with_texture(asset, png_of(picture)))
    document = json.loads((tmp_path / "first.gltf").read_text())
    node = next(node for node in document["nodes"] if "mesh" in node)
    node["translation"], node["name"] = [5, 0, 0], "placed"
    primitive = document["meshes"][0]["primitives"][0]
    primitive["targets"] = [{"POSITION": primitive["attributes"]["POSITION"]}]
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    return tmp_path / "a.gltf"


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_gltf_file_keeps_its_scene(tmp_path, suffix):
    path, out = skinned(tmp_path), tmp_path / f"b{suffix}"
    assert main(["repair", str(path), "-o", str(out)]) == 0
    before, after = read_asset(path), read_asset(out)
    assert len(after.polygons) == len(before.polygons) - 1
    assert len(after.points) == len(before.points)  # split again along the seam, as glTF needs it
    assert len(after.mesh.vertices) == len(before.mesh.vertices)
    document, given = after.document.json, before.document.json
    for kept in ("skins", "materials", "images", "textures"):
        assert len(document[kept]) == len(given[kept])
    assert [node.get("name") for node in document["nodes"]] == [node.get("name") for node in given["nodes"]]
    assert next(node for node in document["nodes"] if "mesh" in node)["translation"] == [5, 0, 0]
    # at each corner of the surface there is the same picture, joint and number as before
    same = Correspondence(np.arange(before.mesh.n_vertices), after.mesh.n_vertices)
    np.testing.assert_allclose(before.mesh.vertices, after.mesh.vertices, atol=1e-6)
    bare = before.without_attributes("uv", "weights", "depth")
    carried = carry_attributes(same, bare, after).asset
    for name in ("weights", "depth"):
        one, other = (asset.attribute(name).plain for asset in (before, carried))
        np.testing.assert_allclose(one, other, atol=1e-6)
    sound = before.polygons.of_corner < len(before.polygons) - 1
    given_uv = before.attribute("uv").values[before.polygons.corners][sound]
    found_uv = after.attribute("uv").values[after.polygons.corners]
    np.testing.assert_allclose(found_uv, given_uv, atol=1e-6)


@pytest.mark.parametrize("suffix", ["", ".glb", ".ply"])
def test_looks_stay_on_their_triangles(tmp_path, suffix):
    """Those of a new document, of one with triangles in another order, and of one that still knows a PLY file."""
    square = flat_grid(4, 4)
    points, faces = np.vstack([[9, 9, 9], square.vertices]), square.faces + 1
    asset = Asset.of_mesh(Mesh(points, np.vstack([faces, faces[:1]])))
    if suffix:
        write_asset(tmp_path / f"a{suffix}", asset)
        asset = read_asset(tmp_path / f"a{suffix}")
    looks = tuple(Look(name, Layer((red, 0.0, 0.0, 1.0))) for name, red in (("dark", 0.25), ("light", 1.0)))
    mended = repair(with_materials(asset, Looks(np.arange(19) % 2, looks))).asset
    write_asset(tmp_path / "b.glb", mended)
    found = read_asset(tmp_path / "b.glb")
    assert len(found.points) == 16
    for found_asset in (mended, found):
        seen = looks_of(found_asset)
        light = np.array([look.name == "light" for look in seen.looks])[seen.of_triangle]
        triangles = found_asset.points[found_asset.polygons.triangles].tolist()
        before = square.vertices[square.faces].tolist()
        assert [bool(light[triangles.index(corners)]) for corners in before] == [False, True] * 9


def test_looks_of_which_nothing_is_left_go(tmp_path):
    asset = Asset.of_mesh(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 1]]))
    looks = Looks(np.arange(2), (Look("a", Layer()), Look("b", Layer())))
    write_asset(tmp_path / "a.glb", repair(with_materials(asset, looks)).asset)
    found = read_asset(tmp_path / "a.glb")
    assert len(found.polygons) == 1
    assert [len(mesh["primitives"]) for mesh in found.document.json["meshes"]] == [1]


def test_elements_of_ply_files_follow_below_looks(tmp_path):
    (tmp_path / "a.ply").write_text(PLY)
    asset = read_asset(tmp_path / "a.ply")
    write_asset(tmp_path / "b.ply", repair(asset).asset)
    painted = with_materials(asset, Looks(np.zeros(2, dtype=np.int64), (Look("a", Layer()),)))
    write_asset(tmp_path / "c.ply", repair(painted).asset)
    assert (tmp_path / "c.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


def test_parts_are_welded_where_the_output_has_none(tmp_path):
    square = {"attributes": {"POSITION": 0}, "indices": 1}
    path = tmp_path / "a.gltf"
    write_asset(path, Asset.of_mesh(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])))
    document = json.loads(path.read_text())
    document["meshes"].append({"primitives": [square]})
    document["nodes"].append({"mesh": 1, "scale": [-1, 1, 1]})
    document["scenes"][0]["nodes"].append(1)
    path.write_text(json.dumps(document))
    for name, n_points in (("b.ply", 4), ("b.glb", 6)):
        assert main(["repair", str(path), "-o", str(tmp_path / name), "--force"]) == 0
        found = read_asset(tmp_path / name)
        assert len(found.points) == n_points
        assert check(found.mesh).ok


def test_a_part_of_which_nothing_is_left_goes(tmp_path):
    """A mesh that a node shrinks to a point; those before and after it keep their numbers of points."""
    path = tmp_path / "a.gltf"
    write_asset(path, Asset.of_mesh(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])))
    document = json.loads(path.read_text())
    mesh = document["meshes"][0]
    document["meshes"] = [{**mesh, "name": name} for name in "abc"]
    document["nodes"] = [{"mesh": 0}, {"mesh": 1, "scale": [0, 0, 0]}, {"mesh": 2, "translation": [0, 0, 4]}]
    document["scenes"][0]["nodes"] = [0, 1, 2]
    path.write_text(json.dumps(document))
    mended = repair(path)
    write_asset(tmp_path / "b.glb", mended.asset)
    found = read_asset(tmp_path / "b.glb")
    for parts in (mended.asset.parts, found.parts):
        assert [(part.name, part.n_points, part.n_polygons) for part in parts] == [("a", 3, 1), ("c", 3, 1)]
    np.testing.assert_array_equal(found.mesh.vertices, mended.asset.mesh.vertices)
    assert [node.get("mesh") for node in found.document.json["nodes"]] == [0, None, 1]


def test_parts_stay_apart():
    """Two parts that touch are not welded, as each has its own points in the file."""
    points = np.vstack([np.eye(3), np.eye(3), [[5, 5, 5]]])
    parts = (Part("a", 3, 1), Part("b", 4, 1))
    label = Attribute("part", "point", "label", [1, 1, 1, 2, 2, 2, 2])
    mended = repair(Asset(points, Polygons([0, 1, 2, 3, 4, 5], [3, 3]), (label,), parts))
    assert [(part.n_points, part.n_polygons) for part in mended.asset.parts] == [(3, 1), (3, 1)]
    assert mended.asset.attribute("part").values.tolist() == [1, 1, 1, 2, 2, 2]
