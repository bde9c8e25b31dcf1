"""glTF files that name what they should not, or claim more than they hold."""

import json
import re
import tracemalloc

import numpy as np
import pytest
from PIL import Image

from isomatch import FormatError, read_asset, write_asset
from isomatch._core.memory import room_for
from isomatch.io.formats._gltf_data import GltfData, pack
from later import some_later

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
    path.write_bytes(pack(triangle(images=[{"uri": uri}]), binary=False))
    write_asset(folder / "b.glb", read_asset(path))
    assert b"do not publish" not in (folder / "b.glb").read_bytes()
    document = json.loads(pack(triangle(), binary=False))
    document["buffers"] = [{"uri": uri, "byteLength": 4}]
    path.write_text(json.dumps(document))
    with pytest.raises(FormatError, match="outside of its folder"):
        read_asset(path)


@pytest.mark.parametrize("kind", ["webp", "png", "tga", "ktx2"])
def test_images_beside_it_are_kept_as_what_they_are(folder, kind):
    path = folder / f"a b.{kind}"
    if kind == "ktx2":
        path.write_bytes(b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(68))
    else:
        Image.new("RGB", (2, 2)).save(path)
    (folder / "a.gltf").write_bytes(pack(triangle(images=[{"uri": f"a%20b.{kind}"}] * 2), binary=False))
    document = read_asset(folder / "a.gltf").document
    assert document.blob.count(path.read_bytes()) == 1
    for image in document.json["images"]:
        assert image["mimeType"].startswith("image/")
        assert "bufferView" in image


@pytest.mark.parametrize("name", ["notes.txt", "notes.png", "notes.tga", "a.gltf", "a.obj"])
def test_a_file_beside_it_that_is_no_picture_is_not_copied(folder, name):
    (folder / "notes.txt").write_bytes(b"do not publish")
    if name.startswith("notes"):
        (folder / name).write_bytes(b"do not publish")
    (folder / "a.gltf").write_bytes(pack(triangle(images=[{"uri": name}]), binary=False))
    (folder / "a.obj").write_text(
        f"mtllib a.mtl\nmtllib {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
    )
    (folder / "a.mtl").write_text(f"newmtl a\nmap_Kd {name}\n")
    out = folder / "out"
    out.mkdir()
    write_asset(out / "b.glb", read_asset(folder / "a.gltf"))
    write_asset(out / "c.obj", read_asset(folder / "a.obj"))
    write_asset(out / "d.glb", read_asset(folder / "a.obj"))
    for path in out.iterdir():
        assert b"do not publish" not in path.read_bytes()
    assert read_asset(folder / "a.gltf").document.json["images"] == [{"uri": name}]


MUCH = 20_000
CLAIMS = {
    "a buffer again and again": lambda path: {
        "buffers": [{"byteLength": i, "uri": path.name} for i in range(MUCH)]
    },
    "an image again and again": lambda path: {"images": [{"uri": "a.png"}] * MUCH},
    "itself as images": lambda path: {"images": [{"uri": path.name}] * MUCH},
    "points that it does not hold": lambda path: {
        "accessors": [{"componentType": 5126, "count": 5_000_000, "type": "VEC3"}]
    },
    "instances": lambda path: {"nodes": [{"mesh": 0}] * 5 * MUCH},
    "instances of a mesh of many parts": lambda path: {
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * 1000}], "nodes": [{"mesh": 0}] * 1000
    },
    "primitives": lambda path: {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * 5 * MUCH}]},
    "objects": lambda path: {"extras": [{}] * 50 * MUCH},
}  # fmt: skip


@pytest.mark.parametrize("what", some_later(CLAIMS, lambda what: what == "itself as images"))
def test_memory_is_bounded_by_the_file(folder, what):
    """Twenty times the file and what any file may take, whatever is claimed or repeated."""
    path = folder / "a.gltf"
    (folder / "a.png").write_bytes(b"\x89PNG")
    Image.effect_noise((400, 400), 80).save(folder / "a.png")
    document = json.loads(pack(triangle(), binary=False))
    more = CLAIMS[what](path)
    path.write_text(
        json.dumps({**document, **more, "buffers": document["buffers"] + more.get("buffers", [])})
    )
    size = path.stat().st_size
    tracemalloc.start()
    message = ""
    try:
        assert len(read_asset(path).points) == 3
    except FormatError as error:
        message = str(error)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert re.match(rf"({re.escape(str(path))}: .* claims or repeats more than .*)?\Z", message)
    assert peak < room_for(size) + 2**20


def test_every_node_of_the_scene_is_read_and_no_other(folder):
    nodes = [{"mesh": 0, "translation": [i, 0, 0]} for i in range(3)]
    gltf = triangle(scenes=[{"nodes": [2]}, {"nodes": [0, 1]}], scene=1, nodes=nodes)
    (folder / "a.glb").write_bytes(pack(gltf, binary=True))
    asset = read_asset(folder / "a.glb")
    assert asset.placed_points[::3, 0].tolist() == [0, 1]
    write_asset(folder / "b.glb", asset.moved(asset.mesh.vertices + UP))
    again = read_asset(folder / "b.glb")
    assert np.allclose(again.placed_points, asset.placed_points + UP)
