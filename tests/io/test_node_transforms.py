"""What a node of a scene turns, stretches or mirrors is the same surface in every format and for every reader."""

import numpy as np
import pytest

from isomatch import Correspondence, carry_attributes, read_asset, read_mesh, write_asset
from isomatch.io import Attribute
from isomatch.io.formats._gltf_data import GltfData, pack

TETRAHEDRON = np.float32([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]])
FACES = np.uint16([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])  # outwards
SLOPE = np.array([6, 4, 3]) / np.sqrt(61)  # normal of the last face
STRETCHED = {"scale": [1, 2, 5], "rotation": [0.6, 0, 0, 0.8], "translation": [7, 8, 9]}
MIRRORED = {"scale": [-1, 2, 5], "translation": [7, 8, 9]}


def written(path, node, points=TETRAHEDRON, **properties):
    gltf = GltfData({"asset": {"version": "2.0"}}, bytearray())
    keys = {
        "POSITION": gltf.add_array(points, min=[0, 0, 0], max=[2, 3, 4], **properties),
        "NORMAL": gltf.add_array(np.tile(SLOPE.astype(np.float32), (4, 1))),
    }
    indices = gltf.add_array(FACES.ravel(), target=34963)
    gltf.json |= {
        "nodes": [{"mesh": 0, **node}],
        "meshes": [{"primitives": [{"attributes": keys, "indices": indices}]}],
    }
    path.write_bytes(pack(gltf, binary=True))
    return read_asset(path)


def volume(mesh):
    return np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6


def normal_of_last_face(mesh):
    return mesh.face_cross[-1] / np.linalg.norm(mesh.face_cross[-1])


@pytest.mark.long
@pytest.mark.parametrize(
    ("node", "suffix"),
    [
        *((MIRRORED, suffix) for suffix in (".ply", ".obj", ".off", ".stl", ".vtp", ".gii", ".pial", ".glb")),
        *((STRETCHED, suffix) for suffix in (".ply", ".glb")),
    ],
)
def test_every_format_has_the_surface_where_the_node_puts_it(tmp_path, node, suffix):
    asset = written(tmp_path / "a.glb", node)
    assert volume(asset.mesh) == pytest.approx(40)
    for name in (f"b{suffix}", f"c{suffix}"):  # of another format, and a new document of the same
        write_asset(tmp_path / name, asset)
        mesh = read_mesh(tmp_path / name)
        assert volume(mesh) == pytest.approx(40, rel=1e-5)
        assert np.allclose(mesh.vertices[mesh.faces], asset.mesh.vertices[asset.mesh.faces], rtol=1e-5)
        asset = asset.placed


@pytest.mark.parametrize("node", [STRETCHED, MIRRORED])
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb"])
def test_normals_stay_across_the_surface(tmp_path, node, suffix):
    asset = written(tmp_path / "a.glb", node)
    write_asset(tmp_path / f"b{suffix}", asset.placed)
    again = read_asset(tmp_path / f"b{suffix}")
    assert np.allclose(again.attribute("normal").values, normal_of_last_face(asset.mesh), atol=1e-5)


def test_normals_are_carried_between_nodes(tmp_path):
    giver, receiver = written(tmp_path / "a.glb", STRETCHED), written(tmp_path / "b.glb", MIRRORED)
    same = Correspondence([0, 1, 2, 3], n_target=4)
    for one, other in ((giver, giver), (receiver, receiver.placed), (receiver.placed, receiver)):
        carried = carry_attributes(same, one, other, "normal").asset
        expected = normal_of_last_face(one.mesh)
        assert np.allclose(carried.placed.attribute("normal").values, expected, atol=1e-5)


def test_a_split_mirrored_mesh_is_written_as_it_was_seen(tmp_path):
    asset = written(tmp_path / "a.glb", MIRRORED)
    uv = Attribute("uv", "corner", "uv", np.random.default_rng(0).random((12, 2)))
    write_asset(tmp_path / "b.glb", asset.with_attributes(uv))
    assert volume(read_mesh(tmp_path / "b.glb")) == pytest.approx(40)


def test_normalized_integers_are_fractions(tmp_path):
    points = (TETRAHEDRON / 4 * 32767).astype(np.int16)
    asset = written(tmp_path / "a.glb", {"scale": [4, 4, 4]}, points, normalized=True)
    assert np.allclose(asset.mesh.vertices, TETRAHEDRON, atol=1e-3)
