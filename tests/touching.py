"""Bodies with hands that touch their thighs and are fused with them, and smooth shapes with handles of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation
from skimage.measure import marching_cubes

from isomatch import Mesh
from isomatch.decimation import decimate
from isomatch_lab.procedural.implicit import BLEND, Skin

TRUNK = [
    ([[0, 0, 0], [0, 0, 0.25], [0, 0, 0.5]], [0.13, 0.11, 0.14]),
    ([[0, 0, 0.5], [0, 0, 0.72], [0, 0.12, 0.7]], [0.07, 0.1, 0.03]),
]
LEG = [[0.1, 0, 0], [0.14, 0.03, -0.34], [0.14, 0, -0.66], [0.14, 0.16, -0.68]], [0.1, 0.08, 0.05, 0.04]
ARM = {
    "out": [[0.15, 0, 0.46], [0.44, -0.06, 0.42], [0.68, 0.13, 0.39]],
    "on thigh": [[0.15, 0, 0.46], [0.4, -0.08, 0.28], [0.22, 0.05, 0.06]],
}
THICKNESS = {"right": [0.06, 0.05, 0.05], "left": [0.05, 0.04, 0.04]}
N_VERTICES, STEP = 1500, 0.027  # of every mesh; of the grids
MIRROR = np.array([-1, 1, 1])


@dataclass(frozen=True, eq=False)
class Posed:
    """The skin of a body, and its bones, in one order in every pose."""

    mesh: Mesh
    cones: np.ndarray


@cache
def body(right: str = "out", left: str = "out", triangulation: int = 0) -> Posed:
    """A body with arms that are "out" or "on thigh"; where a hand is fused with its thigh, the cut path is sharp."""
    trunk = np.concatenate([_chain(*part) for part in TRUNK])
    nodes, radii = np.array(LEG[0]), LEG[1]
    limbs = [_chain(nodes, radii), _chain(MIRROR * nodes, radii)]
    limbs += [
        _chain(np.array(ARM[right]), THICKNESS["right"]),
        _chain(MIRROR * ARM[left], THICKNESS["left"]),
    ]
    # every limb blends with the trunk, but with no other limb
    skins = [_skin(np.concatenate([trunk, limb])) for limb in limbs]
    mesh = _surface(
        lambda points: np.min([skin.field(points)[:, 0] for skin in skins], axis=0), triangulation
    )
    return Posed(mesh, np.concatenate([trunk, *limbs]))


def carried(points: np.ndarray, source: Posed, target: Posed) -> np.ndarray:
    """Points (n, 3) of the skin of one body, moved as their nearest bone moves to the pose of another."""
    nearest = np.argmin([_skin(cone[None]).field(points)[:, 0] for cone in source.cones], axis=0)
    moved = np.empty_like(points)
    for i, (old, new) in enumerate(zip(source.cones, target.cones)):
        turn, _ = Rotation.align_vectors([new[3:6] - new[:3]], [old[3:6] - old[:3]])
        moved[nearest == i] = new[:3] + turn.apply(points[nearest == i] - old[:3])
    return moved


def without(mesh, at, radius):
    """The mesh with a hole around a point."""
    near = np.linalg.norm(mesh.vertices - at, axis=1) < radius
    faces = mesh.faces[~near[mesh.faces].any(axis=1)]
    used, compact = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], compact.reshape(faces.shape))


def ring(bumps: int = 0, triangulation: int = 0) -> Mesh:
    """A smooth torus with some bumps."""
    turn = 2 * np.pi * np.arange(bumps) ** 1.3 / max(bumps, 1)
    out = np.column_stack([0.7 * np.cos(turn), 0.6 * np.sin(turn), 0.2 * np.cos(3 * turn)])
    circle = 0.5 * _circle(24)
    return _smooth([_loop(circle, 0.18), *(_ball(at, 0.12) for at in out)], triangulation)


def double_ring() -> Mesh:
    """A smooth double torus."""
    circle = 0.4 * _circle(20)
    return _smooth([_loop(np.add(circle, [x, 0, 0]), 0.12) for x in (-0.42, 0.42)])


def pelvis() -> Mesh:
    """A ring, narrow in front and wide behind, with two wings and a short stem: one handle that is meant."""
    circle = _circle(24) * [0.45, 0.35, 0] + [0, 0, 0.12] * np.abs(_circle(24)[:, :1])
    thick = 0.07 + 0.06 * (_circle(24)[:, 1] < 0)
    wing = np.array([[0.4, -0.1, 0.1], [0.55, -0.2, 0.4], [0.4, -0.35, 0.6]])
    wings = [_chain(sign * wing, [0.09, 0.12, 0.08]) for sign in (np.ones(3), MIRROR)]
    return _smooth([_loop(circle, thick), *wings, _chain([[0, -0.35, 0.05], [0, -0.5, -0.3]], [0.12, 0.05])])


def cup(triangulation: int = 0) -> Mesh:
    """A cup with a handle that blends with its wall."""
    wall = [_loop(_circle(12) * 0.35 + [-0.3, 0, z], 0.03) for z in np.linspace(-0.3, 0.4, 6)]
    bottom = [_loop(_circle(12) * r + [-0.3, 0, -0.3], 0.03) for r in (0.1, 0.22)]
    handle = [[0.05, 0, 0.3], [0.35, 0, 0.35], [0.6, 0, 0.1], [0.35, 0, -0.25], [0.05, 0, -0.2]]
    return _smooth([*wall, *bottom, _chain(handle, [0.05, 0.04, 0.04, 0.04, 0.05])], triangulation)


def basket() -> Mesh:
    """A ball with a handle that is attached with a sharp crease at both ends."""
    ball = _skin(_ball(np.array([0, 0, -0.4]), 0.45))
    handle = [[-0.3, 0, -0.3], [-0.4, 0, 0.2], [0, 0, 0.6], [0.4, 0, 0.2], [0.3, 0, -0.3]]
    bar = _skin(_chain(handle, [0.1] * 5))
    return _surface(lambda points: np.minimum(ball.field(points)[:, 0], bar.field(points)[:, 0]), 0)


def pressed_fork(gap: float = 0.1) -> Mesh:
    """A fork with two prongs, on a base; with the default gap they touch along their whole length, and are fused."""
    base = [
        _chain([[-gap, 0, -0.6], [gap, 0, -0.6]], [0.14, 0.14]),
        _chain([[0, 0, -0.6], [0, -0.35, -0.8]], [0.12, 0.08]),
    ]
    prongs = [
        _chain([[-gap, 0, -0.6], [-gap, 0, 0.5]], [0.14, 0.1]),
        _chain([[gap, 0, -0.6], [gap, 0, 0.3]], [0.14, 0.12]),
    ]
    skins = [_skin(np.concatenate([*base, prong])) for prong in prongs]
    return _surface(lambda points: np.min([skin.field(points)[:, 0] for skin in skins], axis=0), 0)


def _smooth(cones: list[np.ndarray], triangulation: int = 0) -> Mesh:
    skin = _skin(np.concatenate(cones), blend=0.05)
    return _surface(lambda points: skin.field(points)[:, 0], triangulation)


def _surface(field: Callable, triangulation: int) -> Mesh:
    """The zero set of a field of (n, 3) points in the unit ball, on a grid that the triangulation turns."""
    turn, axis = Rotation.random(random_state=triangulation), np.arange(-1, 1, STEP)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    values = field(turn.apply(points.reshape(-1, 3))).reshape(points.shape[:3])
    vertices, faces, _, _ = marching_cubes(values.astype(np.float32), 0.0, gradient_direction="descent")
    return decimate(Mesh(turn.apply(vertices * STEP - 1), faces.astype(np.int64)), N_VERTICES).mesh


def _skin(cones: np.ndarray, blend: float = BLEND) -> Skin:
    return Skin(cones, np.zeros(len(cones), dtype=np.int64), blend)


def _chain(nodes: object, radii: object) -> np.ndarray:
    nodes, radii = np.array(nodes, dtype=float), np.array(radii, dtype=float)
    return np.column_stack([nodes[:-1], nodes[1:], radii[:-1], radii[1:]])


def _loop(nodes: np.ndarray, radius: object) -> np.ndarray:
    radii = np.broadcast_to(radius, len(nodes))
    return _chain(np.vstack([nodes, nodes[:1]]), np.append(radii, radii[0]))


def _circle(n: int) -> np.ndarray:
    turn = 2 * np.pi * np.arange(n) / n
    return np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])


def _ball(at: np.ndarray, radius: float) -> np.ndarray:
    return _chain([at, np.add(at, [0, 0, 0.01])], [radius, radius])
