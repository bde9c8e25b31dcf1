"""Shells with two sides close together, whose correspondence is exact: a capsule with windows, and a branching tube."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from skimage.measure import marching_cubes

from isomatch import Correspondence, Mesh
from isomatch.datasets import closest_points

THICKNESS = 0.07  # of walls; capsule and tube are about 1 long
WINDOWS = np.array([[1.0, 0.2, 0.1], [-0.4, 1.0, 0.5], [-0.5, -0.8, -0.4], [0.3, -0.3, 1.0]])  # directions
BRANCHES = np.array(
    [
        [[0.0, 0, -0.5], [0, 0, 0]],
        [[0, 0, 0], [0.3, 0.1, 0.45]],
        [[0, 0, 0], [-0.35, 0.05, 0.35]],
        [[0, 0, 0], [0, -0.4, 0.2]],
    ]
)
DISTURBED = 0.012  # of the images of a map, in √area of the target
DRIFT = 0.015  # the same, but smooth over the surface


@dataclass(frozen=True, eq=False)
class Shell:
    """A shell, and the same at rest, where all shells of one kind are on one surface."""

    mesh: Mesh
    rest: Mesh

    def truth(self, target: Shell) -> np.ndarray:
        """Where each vertex (n, 3) belongs on another shell of the kind."""
        return closest_points(self.rest.vertices, target.rest).points(target.mesh)

    def disturbed_map(self, target: Shell, seed: int = 0) -> Correspondence:
        """The nearest vertices to places near the true ones: often on the other side of the wall."""
        rng = np.random.default_rng(seed)
        x, unit = self.rest.vertices, np.sqrt(target.mesh.area)
        drift = np.sin(x @ rng.normal(scale=4.0, size=(3, 3)) + rng.uniform(0, 6, 3))
        noise = DISTURBED * rng.normal(size=x.shape) + DRIFT * drift / np.sqrt(1.5)
        nearest = cKDTree(target.mesh.vertices).query(self.truth(target) + unit * noise)[1]
        return Correspondence(nearest, target.mesh.n_vertices)


@cache
def shell(kind: str, step: float, pose: int) -> Shell:
    """A "capsule" or a "tube", by marching cubes on a grid that depends on the pose, bent, twisted and tapered."""
    rng = np.random.default_rng(pose)
    turn = Rotation.random(random_state=pose).as_matrix()
    axis = np.arange(-0.9, 0.9, step) + step * rng.uniform()
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    values = FIELDS[kind](grid.reshape(-1, 3) @ turn).reshape(grid.shape[:3])
    vertices, faces, _, _ = marching_cubes(values, 0.0, allow_degenerate=False)
    vertices = (axis[0] + step * vertices.astype(np.float64)) @ turn
    rest = Mesh(vertices, faces)
    rest = Mesh(vertices, faces[:, ::-1] if rest.volume < 0 else faces)
    return Shell(rest.moved(_posed(vertices, rng)), rest)


def _posed(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    x, y, z = (points * rng.uniform(0.9, 1.1, 3)).T
    twist, taper, bend = rng.uniform(-0.6, 0.6), rng.uniform(-0.2, 0.2), rng.uniform(0.2, 0.6)
    x, y = np.cos(twist * z) * x - np.sin(twist * z) * y, np.sin(twist * z) * x + np.cos(twist * z) * y
    x, y = x * (1 + taper * z), y * (1 + taper * z)
    return np.column_stack(
        [1 / bend - (1 / bend - x) * np.cos(bend * z), y, (1 / bend - x) * np.sin(bend * z)]
    )


def _to_segment(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)


def _capsule(points: np.ndarray) -> np.ndarray:
    wall = np.abs(_to_segment(points, np.array([0, 0, -0.3]), np.array([0, 0, 0.3])) - 0.25) - THICKNESS / 2
    windows = np.min([_to_segment(points, np.zeros(3), direction) for direction in WINDOWS], axis=0)
    return np.maximum(wall, 0.09 - windows)


def _tube(points: np.ndarray) -> np.ndarray:
    apart = np.array([_to_segment(points, *branch) for branch in BRANCHES]) - 0.13
    wall = np.abs(-0.03 * np.log(np.exp(-apart / 0.03).sum(axis=0))) - THICKNESS / 2
    ends = [
        (points - branch[k]) @ (branch[k] - branch[1 - k]) / np.linalg.norm(branch[1] - branch[0])
        for branch, k in zip(BRANCHES, (0, 1, 1, 1))
    ]
    return np.maximum(wall, np.max(ends, axis=0))


FIELDS = {"capsule": _capsule, "tube": _tube}
