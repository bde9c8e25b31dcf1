"""glTF files of a flat square, made by hand: what isomatch itself would not write."""

import io

import numpy as np
from PIL import Image

from isomatch import Correspondence, bake_texture, read_asset
from isomatch.io.formats._gltf_data import GltfData, pack
from shapes import flat_grid, map_to_nearest

RED, BLUE, WHITE, GREY = (255, 0, 0), (0, 0, 255), (255, 255, 255), (128, 128, 128)


def picture(columns=(RED, BLUE), kind="PNG", size=32):
    """A picture of upright stripes of equal widths, as a file."""
    pixels = np.repeat(np.uint8(columns), size, axis=0)[None].repeat(size * len(columns), axis=0)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, **({"lossless": True} if kind == "WEBP" else {}))
    return file.getvalue()


def onto(receiver, giver):
    """Precise map of a square to another one."""
    return map_to_nearest(receiver.mesh.vertices, giver.mesh)


class Square:
    """A file of a square of 4 × 4 quads, split into triangles; `json` may be changed before it is written."""

    def __init__(self, n=5, **values):
        mesh = flat_grid(n, n)
        self.points, self.faces = mesh.vertices * [4 / (n - 1), 4 / (n - 1), 1], mesh.faces
        self.gltf = GltfData(
            {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}, bytearray()
        )
        self.json = self.gltf.json
        self.json["nodes"] = [{"mesh": 0}]
        self.json["meshes"] = [{"primitives": [self.primitive(self.faces)]}]
        self.u, self.down = self.points[:, 0] / 4, 1 - self.points[:, 1] / 4
        for key, array in values.items():
            self.add(key, array)

    @property
    def first(self):
        return self.json["meshes"][0]["primitives"][0]

    def primitive(self, faces):
        points = np.float32(self.points)
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        indices = self.gltf.add_array(np.uint32(faces).ravel(), target=34963)
        return {"attributes": {"POSITION": self.gltf.add_array(points, **bounds)}, "indices": indices}

    def add(self, key, values):
        kind = np.uint8 if key.startswith("JOINTS") else np.float32
        self.first["attributes"][key] = self.gltf.add_array(np.asarray(values, kind))

    def lay(self, u=None, down=None, key="TEXCOORD_0"):
        """Add texture coordinates, by default those of the square as a whole; they begin at the upper left."""
        self.add(key, np.column_stack([self.u if u is None else u, self.down if down is None else down]))
        return self

    def image(self, data, kind="image/png"):
        entry = {"bufferView": self.gltf.add_bytes(data), "mimeType": kind}
        return self.gltf.append("images", entry)

    def paint(self, texture=None, image=None, sampler=None, name="baseColorTexture", **info):
        """Give the square a material of one picture."""
        texture = (
            {"source": self.image(picture()) if image is None else image} if texture is None else texture
        )
        if sampler:
            texture["sampler"] = self.gltf.append("samplers", sampler)
        info = {"index": self.gltf.append("textures", texture), **info}
        rough = {name: info} if name == "baseColorTexture" else {"baseColorFactor": [0, 0, 0, 1]}
        material = {"pbrMetallicRoughness": rough}
        if name != "baseColorTexture":
            material |= {name: info, "emissiveFactor": [1, 1, 1]}
        self.first["material"] = self.gltf.append("materials", material)
        return self

    def bones(self, names, places, weights):
        """Add a skin of joints in a chain, each moved from the one above, and the weights of points."""
        nodes = self.json["nodes"]
        start = len(nodes)
        for i, (name, place) in enumerate(zip(names, places)):
            below = {"children": [start + i + 1]} if i + 1 < len(names) else {}
            nodes.append({"name": name, "translation": place, **below})
        inverse = np.tile(np.eye(4), (len(names), 1, 1))
        inverse[:, :3, 3] = -np.cumsum(places, axis=0)
        joints = list(range(start, start + len(names)))
        skin = {"joints": joints, "inverseBindMatrices": self.gltf.add_matrices(inverse)}
        nodes[0]["skin"] = self.gltf.append("skins", skin)
        self.json["scenes"][0]["nodes"].append(start)
        padded = np.pad(weights, ((0, 0), (0, 4 - len(names))))
        self.add("WEIGHTS_0", padded)
        self.add("JOINTS_0", np.where(padded > 0, np.arange(4), 0))
        return self

    def write(self, path):
        path.write_bytes(pack(self.gltf, binary=path.suffix == ".glb"))
        return path


def shown(path):
    """The square of a file as it is seen, and what is told about it."""
    giver = read_asset(path)
    plain = read_asset(Square().lay().write(path.with_name("bare.glb")))
    baked = bake_texture(Correspondence(np.arange(25), n_target=25), plain, giver, 64)
    return baked.picture[..., :3], baked.notes


def assert_stripes(pixels, colours):
    """Near the borders of stripes, colours may blend."""
    for i, colour in enumerate(colours):
        width = 64 // len(colours)
        stripe = pixels[:, i * width + 3 : (i + 1) * width - 3].astype(int)
        assert np.abs(stripe - colour).max() <= 3, (i, colour)
