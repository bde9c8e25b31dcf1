"""Heads of animals as functions on the sphere: proportions and triangles differ, the truth is exact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, KDTree
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import SettingError
from isomatch.decimation import decimate
from isomatch.io import Asset, Attribute, png_of, with_skeleton, with_texture
from isomatch.landmarks import Landmarks
from isomatch.surfaces import Mesh

Species = Literal["cat", "lion"]  # keys of `PROPORTIONS`

# A feature of a head is a bump: its direction from the centre, its standard deviation on the unit sphere, and
# the displacement of its top, in the unit of SKULL; chosen. A feature with x > 0 is also mirrored to the
# right side. x points to the left, y up, z forward.
FEATURES = {
    "muzzle": ((0.0, -0.25, 1.0), 0.42, (0.0, -0.12, 0.42)),
    "nose": ((0.0, -0.05, 1.0), 0.13, (0.0, 0.03, 0.2)),
    "chin": ((0.0, -0.62, 0.8), 0.2, (0.0, -0.12, 0.12)),
    "cheek": ((0.75, -0.35, 0.55), 0.25, (0.14, -0.05, 0.05)),
    "brow": ((0.4, 0.45, 0.8), 0.16, (0.02, 0.06, 0.1)),
    "socket": ((0.42, 0.16, 0.9), 0.15, (0.0, 0.0, -0.16)),
    "eye": ((0.42, 0.16, 0.9), 0.07, (0.03, 0.0, 0.11)),
    "ear": ((0.62, 0.78, -0.05), 0.17, (0.3, 0.75, -0.05)),
    "neck": ((0.0, -0.85, -0.55), 0.5, (0.0, -0.65, -0.5)),
}
# Features are given on the left side of the head. These factors of x, y and z keep them there, or mirror them to
# the right side.
LEFT, RIGHT = np.array([1, 1, 1]), np.array([-1, 1, 1])
# half the width (x), height (y) and length (z) of the skull, an ellipsoid; its half length is the unit of length
SKULL = np.array([0.85, 0.9, 1.0])
# For each species: factors for the displacements of FEATURES, in order, and for the axes of SKULL; chosen.
PROPORTIONS: dict[str, tuple[tuple[float, ...], tuple[float, float, float]]] = {
    "cat": ((0.6, 0.7, 0.7, 1.0, 0.8, 1.0, 1.1, 1.0, 0.8), (1.05, 1.0, 0.9)),
    "lion": ((1.4, 1.2, 1.6, 0.7, 1.3, 0.9, 0.8, 0.45, 1.3), (0.95, 0.95, 1.1)),
}
# The factors of an individual for FEATURES differ from those of its species by at most this share, the factors
# for SKULL by at most half this share; chosen.
VARIATION = 0.2
# line of the mouth on the unit sphere, y = MOUTH[0] + MOUTH[1] x², then width and depth of its groove; chosen
MOUTH = (-0.46, 0.35, 0.05, 0.1)
# Directions from the head's centre: left corner of the mouth, left hinge and middle of the jaw; chosen.
CORNER, JAW_HINGE, JAW_MIDDLE = np.array([[0.33, -0.42, 0.84], [0.8, -0.3, 0.2], [0.0, -0.7, 0.75]])
JAW_TURN = 0.35  # radians by which the jaw turns when the mouth opens; chosen
LIP_HEIGHT = 0.06  # height below the line of the mouth in which skin moves less than the jaw; chosen
SMILE = np.array([0.1, 0.13, -0.05])  # displacement of the left corner of the mouth in a smile; chosen
N_FINE = 12_000  # number of vertices of a head before decimation; chosen
LANDMARKS = {  # directions of the landmarks from the head's centre
    "nose": FEATURES["nose"][0],
    "chin": FEATURES["chin"][0],
    **{
        f"{side} {name}": place * signs
        for name, place in (("eye", FEATURES["eye"][0]), ("ear", FEATURES["ear"][0]), ("mouth", CORNER))
        for side, signs in (("left", LEFT), ("right", RIGHT))
    },
}
# red, green and blue, from 0 to 1, of the stripes of a picture
DARK_STRIPE, LIGHT_STRIPE = (0.25, 0.16, 0.1), (0.93, 0.62, 0.25)
N_TEXELS = 512  # width and height of the picture of the stripes, in pixels; chosen
STRIPE_PHASE = 26.0  # radians of the phase of stripes per unit of z on the sphere; chosen: about 8 stripes
# side of the square for faces at the pole of the neck, in a corner of the picture, over its width; chosen
POLE_SQUARE_SIDE = 0.14


@dataclass(frozen=True, eq=False)
class AnimalHead:
    """The head of an animal."""

    mesh: Mesh  # closed, of genus 0, with n vertices; y points up and z forward
    directions: FloatArray  # unit vectors (n, 3): where each vertex lies on the sphere that all heads share

    @property
    def keys(self) -> dict[str, FloatArray]:
        """Displacements (n, 3) by name: the jaw opens, the mouth smiles; exactly 0 elsewhere."""
        turn = Rotation.from_euler("x", JAW_TURN).as_matrix()
        opened = (self.mesh.vertices - self._hinge) @ (turn.T - np.eye(3))
        smile = sum(
            _bump(self.directions, CORNER * side, 0.35)[:, None] * (SMILE * side) for side in (LEFT, RIGHT)
        )
        return {"jaw_open": self._jaw[:, None] * opened, "smile": np.asarray(smile)}

    @property
    def landmarks(self) -> Landmarks:
        """Landmarks at vertices: nose, chin, eyes, tips of the ears and corners of the mouth."""
        return Landmarks(np.array([self._at(place) for place in LANDMARKS.values()]), list(LANDMARKS))

    def rigged(self, *, keys: bool = True) -> Asset:
        """Return the head with texture coordinates, joints, weights, and perhaps stripes and keys."""
        throat = FEATURES["neck"][0]
        neck = _bump(self.directions, throat, 0.9)
        weights = np.stack([neck, (1 - neck) * (1 - self._jaw), (1 - neck) * self._jaw], axis=1)
        places = {"neck": 0.8 * self._at(throat), "head": np.zeros(3), "jaw": self._hinge}
        data = [
            Attribute("uv", "corner", "uv", _flattened(self.directions, self.mesh.faces).reshape(-1, 2)),
            Attribute("weights", "point", "weights", weights, names=dict(enumerate(places))),
        ]
        if keys:
            data += [Attribute(name, "point", "key", moves) for name, moves in self.keys.items()]
        asset = Asset.of_mesh(self.mesh, data)
        asset = with_texture(asset, _stripes()) if keys else asset
        return with_skeleton(asset, places, {"head": "neck", "jaw": "head"})

    def turned(self, seed: int) -> AnimalHead:
        """Return the same head in millimetres, in a random pose and up to a quarter larger."""
        rng = np.random.default_rng(seed)
        turn = rng.uniform(100, 125) * Rotation.random(random_state=rng).as_matrix()
        return AnimalHead(self.mesh.moved(self.mesh.vertices @ turn), self.directions)

    @cached_property
    def _jaw(self) -> FloatArray:
        """(n,) how far each vertex moves with the jaw."""
        below = np.clip(-_over_mouth(self.directions) / LIP_HEIGHT, 0, 1)
        return np.asarray(np.sqrt(_bump(self.directions, JAW_MIDDLE, 0.85)) * below**2 * (3 - 2 * below))

    @property
    def _hinge(self) -> FloatArray:
        """A point of the axis of the jaw, which is parallel to x."""
        return np.asarray(self._at(JAW_HINGE) * [0, 1, 1])

    def _at(self, direction: ArrayLike) -> FloatArray:
        """Position of the vertex nearest to a direction."""
        return np.asarray(self.mesh.vertices[(self.directions @ np.asarray(direction)).argmax()])


def animal_head(
    species: Species = "cat", n_vertices: int = 3000, *, individual: int = 0, triangulation: int = 0
) -> AnimalHead:
    """Make the head of an animal, about two units wide; numpy and scipy suffice.

    It has at most 12,000 vertices. ``individual`` is the seed of the proportions, where 0 is the mean of
    the species, and ``triangulation`` the seed of the triangles. `SettingError` for an unknown species.

    Examples
    --------
    >>> cat, lion = animal_head("cat", 500), animal_head("lion", 600, triangulation=1)
    >>> cat.mesh, sorted(cat.keys)
    (Mesh(500 vertices, 996 faces), ['jaw_open', 'smile'])
    """
    if species not in PROPORTIONS:
        raise SettingError(f"unknown species {species!r}; choose from {', '.join(get_args(Species))}")
    directions = _spread(N_FINE, triangulation)
    positions = _positions(directions, species, individual)
    faces = ConvexHull(directions).simplices.astype(np.int64)
    a, b, c = (directions[faces[:, k]] for k in range(3))
    inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), a) < 0
    faces[inwards] = faces[inwards, ::-1]
    mesh = decimate(Mesh(positions, faces), n_vertices, in_place=True).mesh
    return AnimalHead(mesh, directions[KDTree(positions).query(mesh.vertices)[1]])


def _positions(directions: FloatArray, species: Species, individual: int) -> FloatArray:
    """Positions (n, 3) of the surface in some directions."""
    factors, stretch = map(np.array, PROPORTIONS[species])
    if individual:
        rng = np.random.default_rng(individual)
        factors = factors * rng.uniform(1 - VARIATION, 1 + VARIATION, len(factors))
        stretch = stretch * rng.uniform(1 - VARIATION / 2, 1 + VARIATION / 2, 3)
    positions = directions * SKULL * stretch
    for factor, (place, width, offset) in zip(factors, FEATURES.values()):
        for side in (LEFT, RIGHT)[: 1 + (place[0] > 0)]:
            middle = np.multiply(place, side) / np.linalg.norm(place)
            weight = np.exp(-((directions - middle) ** 2).sum(axis=1) / (2 * width**2))
            positions = positions + factor * weight[:, None] * np.multiply(offset, side)
    groove = np.exp(-((_over_mouth(directions) / MOUTH[2]) ** 2) - (directions[:, 0] / 0.38) ** 4)
    return np.asarray(positions - MOUTH[3] * (groove * (directions[:, 2] > 0))[:, None] * directions)


def _over_mouth(directions: FloatArray) -> FloatArray:
    """(n,) height above the line of the mouth."""
    return np.asarray(directions[:, 1] - MOUTH[0] - MOUTH[1] * directions[:, 0] ** 2)


def _bump(directions: FloatArray, middle: ArrayLike, radius: float) -> FloatArray:
    """(n,) weights that are 1 at a direction and exactly 0 beyond a radius."""
    square = ((directions - np.array(middle) / np.linalg.norm(middle)) ** 2).sum(axis=1) / radius**2
    return np.asarray(np.clip(1 - square, 0, None) ** 2)


def _spread(n: int, seed: int) -> FloatArray:
    """Spread n directions evenly, on a spiral by the golden ratio whose axis is random."""
    i = np.arange(n) + 0.5
    height, angle = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    ring = np.sqrt(1 - height**2)
    spiral = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    return np.asarray(spiral @ Rotation.random(random_state=seed).as_matrix())


def _flattened(directions: FloatArray, faces: IntArray) -> FloatArray:
    """Texture coordinates (m, 3, 2) of corners: the sphere as a disc around the forehead, whose rim is the neck.

    Faces at the pole of the neck would lie across the whole disc, so they have a place in a corner of the picture.
    """
    # In an azimuthal equidistant projection, the distance from the middle is the angle from an axis, here
    # opposite to the neck.
    x, y, z = (directions @ _axes()).T
    radius = np.arccos(np.clip(z, -1, 1)) / np.pi
    ring = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
    corners = (0.5 + 0.5 * radius[:, None] * np.stack([x, y], axis=1) / ring[:, None])[faces]
    (a, b), (c, d) = (corners[:, i].T - corners[:, 0].T for i in (1, 2))
    at_pole = a * d <= b * c
    seen_from_neck = np.stack([-x, y], axis=1)[faces[at_pole]]
    half_side = 0.5 * POLE_SQUARE_SIDE
    corners[at_pole] = half_side * (1 + seen_from_neck / np.abs(seen_from_neck).max(initial=0.1))
    return np.asarray(corners)


def _axes() -> FloatArray:
    """(3, 3) columns: left, up and the direction opposite to the neck."""
    up = -np.array(FEATURES["neck"][0]) / np.linalg.norm(FEATURES["neck"][0])
    left = np.array([1.0, 0.0, 0.0])
    return np.asarray(np.stack([left, np.cross(up, left), up], axis=1))


def _stripes() -> bytes:
    """Make a picture of stripes around the head, for these texture coordinates."""
    u = (np.arange(N_TEXELS) + 0.5) / N_TEXELS * 2 - 1
    x, y = np.meshgrid(u, -u)
    radius = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
    angle = np.pi * np.minimum(radius, 1)
    flat = np.stack([np.sin(angle) * x / radius, np.sin(angle) * y / radius, np.cos(angle)], axis=-1)
    direction = flat @ _axes().T
    dark = np.sin(STRIPE_PHASE * direction[..., 2] + 3 * direction[..., 0] ** 2) > 0.2
    return png_of(np.where(dark[..., None], DARK_STRIPE, LIGHT_STRIPE))
