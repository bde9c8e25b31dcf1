"""A small surface that carries one attribute of every kind."""

import numpy as np

from isomatch import Asset
from isomatch.io import Attribute, Polygons, png_of, with_texture

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 2, 0], [2, 2, 0], [3, 1, 1]])
POLYGONS = Polygons([0, 1, 2, 3, 3, 2, 4, 2, 5, 4, 1, 6, 5, 4, 2], [4, 3, 3, 5], POINTS)
_random = np.random.default_rng(0)
WEIGHTS = np.zeros((7, 6))
WEIGHTS[:, :3] = _random.dirichlet([1, 1, 1], 7)
WEIGHTS = _random.permuted(WEIGHTS, axis=1)
JOINTS = {i: f"bone {i}" for i in range(6)}
BY_CORNER = _random.random((15, 2)).astype(np.float32)

ATTRIBUTES = {
    "colour": Attribute("color", "point", "colour", _random.integers(0, 256, (7, 3)).astype(np.uint8)),
    "label": Attribute(
        "region", "point", "label", [0, 1, 2, 0, 1, 2, 2], names={0: "head", 1: "trunk", 2: "tail"}
    ),
    "scalar": Attribute("thickness", "point", "scalar", _random.random(7).astype(np.float32)),
    "vector": Attribute("flow", "point", "vector", _random.random((7, 3)).astype(np.float32)),
    "normal": Attribute("normal", "point", "normal", np.tile(np.float32([0, 0.6, 0.8]), (7, 1))),
    "uv": Attribute("uv", "corner", "uv", BY_CORNER),
    "weights": Attribute("weights", "point", "weights", WEIGHTS, names=JOINTS),
    "face label": Attribute("part", "face", "label", [5, 5, 6, 7]),
}


def whole():
    """The surface with all of them."""
    return Asset(POINTS, POLYGONS, tuple(ATTRIBUTES.values()))


TEXTURE = np.zeros((4, 8, 4), np.uint8)  # no two of its rows and columns are the same
TEXTURE[..., 0], TEXTURE[..., 1], TEXTURE[..., 3] = np.arange(4)[:, None] * 60, np.arange(8) * 30, 255


def textured():
    """The surface with a picture that its texture coordinates refer to."""
    return with_texture(whole(), png_of(TEXTURE))
