"""How the surface turns at each vertex, and grows, from the one that gives to the one that receives."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import nearest_rotation
from isomatch.transfer.bridge import Bridge
from isomatch.values.arrays import FloatArray

SAME_SIZE = 1.1  # times larger: less is what bending and noise of the map do to surfaces of one size


def growth(bridge: Bridge) -> float:
    """How many times larger the receiver is: the median around its matched faces; 1 if they are of about one size."""
    faces = bridge.receiver.mesh.faces
    faces = faces[bridge.map.matched[faces].all(axis=1)]
    here, there = (
        np.linalg.norm(x[faces] - x[np.roll(faces, 1, axis=1)], axis=2).sum(axis=1)
        for x in (bridge.receiver.mesh.vertices, bridge.image_positions)
    )
    ratios = here[there > 0] / there[there > 0]
    found = float(np.median(ratios)) if len(ratios) else 1.0
    return 1.0 if 1 / SAME_SIZE < found < SAME_SIZE else found


def rotations(bridge: Bridge) -> FloatArray:
    """(n_vertices, 3, 3) the rotation from the giver to the receiver that fits best the edges and normals of the faces.

    All are reflections instead if most of the surface is a mirror image. It is the identity where no vertex around is
    matched.
    """
    mesh = bridge.receiver.mesh
    normals = bridge.map.pull_back(bridge.giver.mesh.vertex_normals)
    frames = []
    for x, upright in ((mesh.vertices, mesh.vertex_normals), (bridge.image_positions, normals)):
        a, b, c = (x[mesh.faces[:, k]] for k in range(3))
        size = np.linalg.norm(b - a, axis=1) + np.linalg.norm(c - a, axis=1)
        normal = upright[mesh.faces].mean(axis=1) * size[:, None]
        frames.append(np.stack([b - a, c - a, normal], axis=1))  # rows
    fit = np.nan_to_num(np.einsum("fri,frj->fij", *frames))
    summed = np.zeros((mesh.n_vertices, 3, 3))
    for k in range(3):
        np.add.at(summed, mesh.faces[:, k], fit)
    is_mirrored = bool(np.sign(np.linalg.det(summed)).sum() < 0)
    found = nearest_rotation(summed, mirrored=is_mirrored)
    found[(summed == 0).all(axis=(1, 2))] = np.eye(3)
    return found
