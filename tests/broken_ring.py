"""A lumpy ring that is whole or broken: near in space, far apart along the surface."""

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from skimage.measure import marching_cubes

from isomatch import Mesh

EXTENT = 1.6


def ring(seed, broken=False, n=48, bent=0.0):
    """Make a ring by marching cubes: the mesh, turned and bent, and its vertices at rest (n, 3)."""
    thickest = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    axis = np.linspace(-EXTENT, EXTENT, n)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    around = np.arctan2(y, x)
    radius = 0.22 + 0.07 * np.cos(around - thickest) + 0.03 * np.cos(3 * around + 1)
    values = np.hypot(np.hypot(x / 1.2, y) - 1, z - 0.15 * np.cos(2 * around)) - radius
    if broken:
        cosine, sine = np.cos(thickest + 2), np.sin(thickest + 2)
        gap = np.maximum(np.abs(x * sine - y * cosine) - 0.05, -(x * cosine + y * sine))
        values = np.maximum(values, -gap)
    vertices, faces, _, _ = marching_cubes(values, 0.0)
    rest = axis[0] + (axis[1] - axis[0]) * vertices
    rng = np.random.default_rng(seed + 100)
    wave, toward = rng.normal(scale=1.2, size=(3, 3)), rng.normal(size=3)
    posed = rest + bent * np.sin(rest @ wave) * toward / np.linalg.norm(toward)
    turn = Rotation.random(random_state=seed).as_matrix()
    return Mesh(posed @ turn, faces), rest


def error_of(source, target, image):
    """Mean distance of the images (n,) from the vertices nearest at rest, in √area."""
    (_, rest), (mesh, there) = source, target
    missed = mesh.vertices[image] - mesh.vertices[cKDTree(there).query(rest)[1]]
    return float(np.linalg.norm(missed, axis=1).mean() / np.sqrt(mesh.area))
