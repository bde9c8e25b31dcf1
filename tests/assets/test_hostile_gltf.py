"""glTF files that name what they should not, or claim more than they hold."""

import json

import numpy as np
import pytest

from isomatch import FormatError, read_asset, write_asset
from isomatch.assets.formats._gltf_data import GltfData, packed

TRIANGLE = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])

UP = np.array([0, 0, 1])


def triangle(**more):
    gltf = GltfData({"asset": {"version": "2.0"}}, bytearray())
    position = gltf.add_array(TRIANGLE, min=[0, 0, 0], max=[1, 1, 0])
    gltf.json |= {"meshes": [{"primitives": [{"attributes": {"POSITION": position}}]}], **more}
    return gltf


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "secret").write_bytes(b"do not publish")
    folder = tmp_path / "given"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path / "secret")
    return folder


@pytest.mark.parametrize("uri", ["../secret", "%2e%2e/secret", "{}/secret", "link", "x/../../secret"])
def test_files_outside_its_folder_are_not_copied(folder, uri):
    uri = uri.format(folder.parent)
    path = folder / "a.gltf"
    path.write_bytes(packed(triangle(images=[{"uri": uri}]), binary=False))
    write_asset(folder / "b.glb", read_asset(path))
    assert b"do not publish" not in (folder / "b.glb").read_bytes()
    document = json.loads(packed(triangle(), binary=False))
    document["buffers"] = [{"uri": uri, "byteLength": 4}]
    path.write_text(json.dumps(document))
    with pytest.raises(FormatError, match="outside of its folder"):
        read_asset(path)


def test_images_beside_it_are_kept_as_what_they_are(folder):
    (folder / "a b.webp").write_bytes(b"RIFF")
    gltf = triangle(images=[{"uri": "a%20b.webp"}])
    (folder / "a.gltf").write_bytes(packed(gltf, binary=False))
    image = read_asset(folder / "a.gltf").document.json["images"][0]
    assert image["mimeType"] == "image/webp"
    assert "bufferView" in image


def test_only_the_first_buffer_may_be_inside_a_glb(folder):
    data = packed(triangle(), binary=True).replace(b'"buffers":[', b'"buffers":[{"byteLength":4},', 1)
    size = int.from_bytes(data[12:16], "little")
    text = data[20 : 20 + size + 17].rstrip()
    binary = data[20 + size + 17 :]
    text += b" " * (-len(text) % 4)
    body = len(text).to_bytes(4, "little") + b"JSON" + text + binary
    (folder / "a.glb").write_bytes(data[:8] + (12 + len(body)).to_bytes(4, "little") + body)
    with pytest.raises(FormatError, match="cut short"):
        read_asset(folder / "a.glb")


@pytest.mark.parametrize("n", [10**7, 10**12])
def test_a_small_file_cannot_claim_much(folder, n):
    gltf = triangle()
    keys = gltf.json["meshes"][0]["primitives"][0]["attributes"]
    for i in range(20):
        keys[f"_{i}"] = gltf.append("accessors", {"componentType": 5126, "count": n, "type": "SCALAR"})
    (folder / "a.glb").write_bytes(packed(gltf, binary=True))
    with pytest.raises(FormatError, match="claims or repeats"):
        read_asset(folder / "a.glb")


def test_extras_of_other_programs_are_left_alone(folder):
    gltf = triangle()
    gltf.json["accessors"][0]["extras"] = {"kind": "temperature", "names": 3}
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["_T"] = 0
    (folder / "a.glb").write_bytes(packed(gltf, binary=True))
    assert [a.name for a in read_asset(folder / "a.glb").attributes] == ["t"]


def test_every_node_of_the_scene_is_read_and_no_other(folder):
    nodes = [{"mesh": 0, "translation": [i, 0, 0]} for i in range(3)]
    gltf = triangle(scenes=[{"nodes": [2]}, {"nodes": [0, 1]}], scene=1, nodes=nodes)
    (folder / "a.glb").write_bytes(packed(gltf, binary=True))
    asset = read_asset(folder / "a.glb")
    assert asset.placed_points[::3, 0].tolist() == [0, 1]
    write_asset(folder / "b.glb", asset.moved(asset.mesh.vertices + UP))
    again = read_asset(folder / "b.glb")
    assert np.allclose(again.placed_points, asset.placed_points + UP)
