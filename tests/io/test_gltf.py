"""glTF: the document is kept, what is carried is added to it, and another reader opens the result."""

import json

import numpy as np
import pytest
import trimesh
from made import whole

from isomatch import FormatError, read_asset, read_mesh, write_asset
from isomatch.io import Attribute, asset_from
from isomatch.io.formats._gltf_data import GltfData, pack, unpack
from isomatch.io.materials import png_of

QUARTER_TURN = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]


def scene():
    """Two meshes, one below a turned and moved node, one with a skin, in one document with more than we know."""
    gltf = GltfData({"asset": {"version": "2.0", "generator": "by hand"}}, bytearray())
    square = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    position = gltf.add_array(square, min=[0, 0, 0], max=[1, 1, 0])
    uv = gltf.add_array(np.uint16([[0, 0], [65535, 0], [65535, 65535], [0, 65535]]), normalized=True)
    strip = gltf.add_array(np.uint8([0, 1, 3, 2]), target=34963)
    faces = gltf.add_array(np.uint16([0, 1, 2, 0, 2, 3]), target=34963)
    joints = gltf.add_array(np.uint8([[1, 0, 0, 0]] * 4))
    weights = gltf.add_array(np.float32([[1, 0, 0, 0], [0.5, 0.5, 0, 0]] * 2))
    lifted = gltf.add_array(square + np.float32([0, 0, 1]))
    picture = gltf.add_bytes(b"\x89PNG not really")
    gltf.json |= {
        "scene": 0,
        "scenes": [{"nodes": [0, 2, 3]}],
        "nodes": [
            {"children": [1], "translation": [5, 0, 0]},
            {"name": "turned", "mesh": 0, "rotation": QUARTER_TURN, "scale": [2, 2, 2], "extras": {"a": 1}},
            {"mesh": 1, "skin": 0, "weights": [0.25]},
            {"name": "root", "children": [4]},
            {"name": "tip"},
        ],
        "meshes": [
            {
                "name": "strip",
                "primitives": [
                    {"attributes": {"POSITION": position, "TEXCOORD_0": uv}, "indices": strip, "mode": 5}
                ],
            },
            {
                "name": "body",
                "primitives": [
                    {
                        "attributes": {"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights},
                        "indices": faces,
                        "material": 0,
                        "targets": [{"POSITION": lifted}],
                    }
                ],
            },
        ],
        "skins": [{"joints": [4, 3]}],
        "materials": [{"name": "skin", "extensions": {"KHR_materials_unlit": {}}}],
        "extensionsUsed": ["KHR_materials_unlit"],
        "images": [{"bufferView": picture, "mimeType": "image/png"}],
        "animations": [],
    }
    return gltf


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "scene.glb"
    path.write_bytes(pack(scene(), binary=True))
    return path


def test_meshes_are_put_where_their_nodes_are(path):
    asset = read_asset(path)
    assert [(part.name, part.n_points, part.n_polygons) for part in asset.parts] == [
        ("strip", 4, 2),
        ("body", 4, 2),
    ]
    expected = [[5, 0, 0], [5, 2, 0], [3, 2, 0], [3, 0, 0], [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    np.testing.assert_allclose(asset.placed_points, expected, atol=1e-12)
    np.testing.assert_allclose(read_mesh(path).vertices, expected, atol=1e-12)
    assert asset.polygons.triangles.tolist()[:2] == [[0, 1, 3], [3, 1, 2]]
    normals = read_mesh(path).face_cross
    assert (normals[:, 2] > 0).all()


def test_attributes_of_some_parts_only(path):
    asset = read_asset(path)
    np.testing.assert_array_equal(asset.attribute("uv").values[:4], [[0, 1], [1, 1], [1, 0], [0, 0]])
    assert np.isnan(asset.attribute("uv").values[4:]).all()
    weights = asset.attribute("weights")
    assert dict(weights.names) == {0: "tip", 1: "root"}
    np.testing.assert_array_equal(weights.dense_weights[4:6], [[0, 1], [0.5, 0.5]])


def test_a_file_written_again_is_the_same(path, tmp_path):
    """But for its arrays, which are written anew; after that it neither grows nor changes."""
    once, twice = tmp_path / "once.glb", tmp_path / "twice.glb"
    assert write_asset(once, read_asset(path)) == ()
    assert write_asset(twice, read_asset(once)) == ()
    assert once.read_bytes() == twice.read_bytes()
    before, after = read_asset(path), read_asset(once)
    np.testing.assert_array_equal(after.points, before.points)
    assert [(a.name, a.kind) for a in after.attributes] == [(a.name, a.kind) for a in before.attributes]
    for one, other in zip(before.attributes, after.attributes):
        np.testing.assert_allclose(one.plain, other.plain, atol=1e-7)


def test_what_is_carried_is_added_and_the_rest_stays(path, tmp_path):
    asset = read_asset(path)
    region = Attribute("region", "point", "label", np.arange(8) % 3, names={0: "a", 2: "c"})
    color = Attribute("color", "point", "colour", np.full((8, 3), 200, np.uint8))
    write_asset(tmp_path / "more.glb", asset.with_attributes(region, color))
    before, after = (unpack(file.read_bytes(), "x").json for file in (path, tmp_path / "more.glb"))
    for key in ("nodes", "skins", "materials", "images", "scenes", "asset", "extensionsUsed", "animations"):
        assert after[key] == before[key]
    old, new = before["meshes"][1]["primitives"][0], after["meshes"][1]["primitives"][0]
    assert new["material"] == old["material"]
    assert new["attributes"].keys() - old["attributes"].keys() == {"_REGION", "COLOR_0"}
    found = read_asset(tmp_path / "more.glb").attribute("region")
    assert found.values.tolist() == region.values.tolist()
    assert dict(found.names) == region.names


def test_weights_keep_the_skin_of_the_same_joints(path, tmp_path):
    asset = read_asset(path)
    dense = np.random.default_rng(0).dirichlet([1, 1], 8)
    carried = Attribute("weights", "point", "weights", dense, names={0: "root", 1: "tip"})
    write_asset(tmp_path / "w.glb", asset.with_attributes(carried))
    found = read_asset(tmp_path / "w.glb").attribute("weights")
    assert [found.names[i] for i in range(2)] == ["tip", "root"]
    np.testing.assert_allclose(found.dense_weights[4:, [1, 0]], dense[4:], atol=1e-6)
    document = unpack((tmp_path / "w.glb").read_bytes(), "x").json
    assert document["nodes"][2]["skin"] == 0


def test_weights_of_more_joints_than_a_point_can_have(tmp_path):
    dense = np.tile([0.4, 0.1, 0.2, 0.05, 0.15, 0.1], (7, 1))
    asset = whole().with_attributes(Attribute("weights", "point", "weights", dense))
    write_asset(tmp_path / "w.glb", asset.without_attributes("uv"))
    found = read_asset(tmp_path / "w.glb").attribute("weights")
    np.testing.assert_allclose(found.values.sum(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(found.dense_weights[0, [0, 2]], np.array([0.4, 0.2]) / 0.85, atol=1e-6)


def test_a_seam_splits_points_morphs_and_all(path, tmp_path):
    asset = read_asset(path)
    uv = Attribute("uv", "corner", "uv", np.random.default_rng(1).random((12, 2)).astype(np.float32))
    write_asset(tmp_path / "seam.glb", asset.without_attributes("uv").with_attributes(uv))
    found = read_asset(tmp_path / "seam.glb")
    assert len(found.points) == 12
    assert found.mesh.n_vertices == asset.mesh.n_vertices
    carried = found.attribute("uv").values[found.polygons.corners]
    np.testing.assert_allclose(carried, uv.values, atol=1e-7)  # turned over and back
    gltf = unpack((tmp_path / "seam.glb").read_bytes(), "x")
    primitive = gltf.json["meshes"][1]["primitives"][0]
    morph, rest = (
        gltf.array(keys["POSITION"]) for keys in (primitive["targets"][0], primitive["attributes"])
    )
    np.testing.assert_array_equal(morph, rest + np.array([0, 0, 1]))


def test_trimesh_opens_what_is_written(path, tmp_path):
    write_asset(
        tmp_path / "a.glb", read_asset(path).with_attributes(Attribute("x", "point", "scalar", np.ones(8)))
    )
    write_asset(tmp_path / "b.glb", whole())
    opened = trimesh.load_scene(tmp_path / "a.glb")
    np.testing.assert_allclose(opened.bounds, [[0, 0, 0], [5, 2, 0]], atol=1e-6)
    (one,) = trimesh.load_scene(tmp_path / "b.glb").geometry.values()
    assert (len(one.vertices), len(one.faces)) == (15, 7)
    region = asset_from(one).attribute("_REGION")
    np.testing.assert_array_equal(region.values, read_asset(tmp_path / "b.glb").attribute("region").values)


def test_buffers_and_images_in_files_of_their_own(path, tmp_path):
    gltf = scene()
    (tmp_path / "data.bin").write_bytes(bytes(gltf.blob))
    picture = png_of(np.zeros((2, 2, 3)))
    (tmp_path / "skin one.png").write_bytes(picture)
    document = gltf.json | {
        "buffers": [{"uri": "data.bin", "byteLength": len(gltf.blob)}],
        "images": [{"uri": "skin%20one.png"}],
    }
    (tmp_path / "scene.gltf").write_text(json.dumps(document))
    asset = read_asset(tmp_path / "scene.gltf")
    np.testing.assert_array_equal(asset.placed_points, read_asset(path).placed_points)
    (tmp_path / "elsewhere").mkdir()
    write_asset(tmp_path / "elsewhere" / "scene.glb", asset)
    found = unpack((tmp_path / "elsewhere" / "scene.glb").read_bytes(), "x")
    view = found.json["bufferViews"][found.json["images"][0]["bufferView"]]
    assert found.blob[view["byteOffset"] :][: view["byteLength"]] == picture


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j.update(extensionsRequired=["KHR_draco_mesh_compression"]), "is compressed by KHR_draco"),
        (lambda j: j["accessors"][0].update(count=10**9), "claims or repeats"),
        (lambda j: j["accessors"][0].update(bufferView=99), "found damaged contents"),
        (lambda j: j["accessors"][0].update(type="MAT9"), "found damaged contents"),
        (lambda j: j["nodes"].append({"children": [0], "matrix": [1]}), "found damaged contents"),
        (lambda j: j["accessors"][3].update(bufferView=1), "a triangle refers to point"),
        (lambda j: j.update(meshes=5), "found damaged contents"),
        (lambda j: j["bufferViews"][0].update(buffer=3), "found damaged contents"),
        (lambda j: j["buffers"][0].update(byteLength=-1), "expected a buffer of -1 bytes"),
        (
            lambda j: j["meshes"][0]["primitives"][0]["attributes"].update(POSITION=77),
            "found damaged contents",
        ),
        (lambda j: j.update(scene=4), "found damaged contents"),
    ],
)
def test_damage_is_named_with_the_file(tmp_path, change, message):
    document = json.loads(pack(scene(), binary=False))
    change(document)
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(FormatError, match=rf"a\.gltf: .*{message}"):
        read_asset(tmp_path / "a.gltf")


def test_sparse_values(tmp_path):
    gltf = GltfData({"asset": {"version": "2.0"}}, bytearray())
    position = gltf.add_array(np.zeros((3, 3), np.float32))
    indices = gltf.add_bytes(np.uint8([1, 2]).tobytes())
    values = gltf.add_bytes(np.float32([[1, 0, 0], [0, 1, 0]]).tobytes())
    gltf.json["accessors"][position]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values},
    }
    gltf.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}}]}]
    (tmp_path / "a.glb").write_bytes(pack(gltf, binary=True))
    asset = read_asset(tmp_path / "a.glb")
    assert asset.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert asset.polygons.triangles.tolist() == [[0, 1, 2]]
