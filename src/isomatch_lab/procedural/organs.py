"""Procedural organs and open patches, shapes without limbs, whose correspondence is exact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import SettingError
from isomatch.datasets import Truth, closest_points
from isomatch.surfaces import Mesh
from isomatch_lab.procedural.implicit import Skin
from isomatch_lab.procedural.tessellation import tessellate

OrganSymmetry = Literal["none", "mirror", "turn"]  # symmetry of the rest surface

SIGNS: dict[OrganSymmetry, tuple[float, float, float]] = {
    "none": (1.0, 1.0, 1.0),
    "mirror": (-1.0, 1.0, 1.0),
    "turn": (-1.0, -1.0, 1.0),
}
"""Signs of the coordinates under the map of the rest surface onto itself: a mirror image, or half a turn about z."""

BLEND = 0.035  # width of the fillets between round cones; an organ is about 1 long; chosen
MAX_BEND = 0.6  # largest curvature of a bent axis, in radians per unit of length; chosen
MAX_TWIST = 0.5  # largest twist about x, in radians per unit of length; chosen
MAX_STRETCH = 0.05  # largest relative change of the extent along an axis; chosen


@dataclass(frozen=True, eq=False)
class Organ:
    """A bent shape with its rest shape.

    Parameters
    ----------
    mesh : Mesh
        The bent surface, n vertices: manifold and connected; closed, of genus 0, or cut open.
    rest : (n, 3) array
        Position of each vertex on the rest surface, which all organs of one kind, style and symmetry share.
    symmetry : {"none", "mirror", "turn"}
        Which map carries the rest surface onto itself; bending does not change it.
    """

    mesh: Mesh
    rest: FloatArray
    symmetry: OrganSymmetry


def organ(
    kind: str, n_vertices: int = 3000, *, style: int = 0, symmetry: OrganSymmetry = "none", pose: int = 0
) -> Organ:
    """Make an organ of about one unit in length.

    Parameters
    ----------
    kind : str
        "kidney", "hippocampus", "liver", "heart", "nodule", "face", "cortex" or "tube".
    n_vertices : int
        Number of vertices, met to 5 % by closed organs and to 15 % by open ones.
    style : int
        Seed of the proportions and of small bumps.
    symmetry : {"none", "mirror", "turn"}
        Symmetry that the rest surface is given: the union with its image.
    pose : int
        Seed of the triangulation, and of how the rest surface is bent, twisted and stretched.

    Returns
    -------
    Organ

    Raises
    ------
    MissingDependencyError
        Without scikit-image, which the extra ``creatures`` has.
    SettingError
        If there is no such kind.

    Notes
    -----
    Bending changes lengths by the thickness times the curvature. Of the edges, 90 % change by less than 20 %, edges of
    faces and cortical patches by less than 28 %; half of the edges of most shapes by less than 6 %. The boundary of an
    open shape follows the edges of its triangulation.

    Examples
    --------
    >>> source, target = organ("kidney", pose=1), organ("kidney", pose=2)
    >>> len(organ_truth(source, target).vertices) == source.mesh.n_vertices
    True
    """
    if kind not in PLANS:
        raise SettingError(f"unknown organ {kind!r}; choose from {', '.join(PLANS)}")
    rng = np.random.default_rng([crc32(kind.encode()), style])
    cones, opening = PLANS[kind](rng)
    cones[:, 6:] *= rng.uniform(0.9, 1.1, (len(cones), 1))
    cones[:, :6] += np.tile(rng.uniform(-0.025, 0.025, (len(cones), 3)), 2)
    if symmetry != "none":
        cones = np.concatenate([cones, cones * np.r_[SIGNS[symmetry], SIGNS[symmetry], 1, 1]])
    skin = Skin(cones, np.zeros(len(cones), dtype=np.int64), BLEND)
    rest = _cut_opening(tessellate(skin, n_vertices * (2 if len(opening) else 1), pose), opening)
    return Organ(Mesh(_bend(rest.vertices, symmetry, pose), rest.faces), rest.vertices, symmetry)


def organ_truth(source: Organ, target: Organ, *, symmetric: bool = False) -> Truth:
    """Find the true correspondence of two organs of one kind, style and symmetry; or the other true one."""
    points = source.rest * SIGNS[source.symmetry] if symmetric else source.rest
    return closest_points(points, Mesh(target.rest, target.mesh.faces))


def _cut_opening(mesh: Mesh, opening: FloatArray) -> Mesh:
    """Keep the largest component of the faces on the inner side of all planes (q, 4): normal and offset."""
    inside = np.all(mesh.vertices @ opening[:, :3].T < opening[:, 3], axis=1)
    kept = Mesh(mesh.vertices, mesh.faces[inside[mesh.faces].all(axis=1)])
    component = kept.components[kept.faces[:, 0]]
    faces = kept.faces[component == np.bincount(component).argmax()]
    used, compact = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], compact.reshape(faces.shape))


def _bend(points: FloatArray, symmetry: OrganSymmetry, pose: int) -> FloatArray:
    """Bend the axes x and y towards z and stretch, which keeps either symmetry; twist about x unless there is one."""
    rng = np.random.default_rng([pose, 1])
    points = points * (1 + rng.uniform(-MAX_STRETCH, MAX_STRETCH, 3))
    x, y, z = points.T
    twist = rng.uniform(-MAX_TWIST, MAX_TWIST) * (symmetry == "none")
    y, z = np.cos(twist * x) * y - np.sin(twist * x) * z, np.sin(twist * x) * y + np.cos(twist * x) * z
    along_x, along_y = rng.uniform(-MAX_BEND, MAX_BEND, 2) * [1.0, 0.5]
    x, z = _arc(x, z, along_x)
    y, z = _arc(y, z, along_y)
    return np.column_stack([x, y, z])


def _arc(s: FloatArray, height: FloatArray, curvature: float) -> tuple[FloatArray, FloatArray]:
    """Bend the axis of s to a circle; lengths at height 0 stay the same."""
    angle, radius = curvature * s, 1 / curvature
    return (radius - height) * np.sin(angle), radius - (radius - height) * np.cos(angle)


def _chain(nodes: ArrayLike, radii: ArrayLike) -> FloatArray:
    nodes, radii = np.array(nodes, dtype=float), np.array(radii, dtype=float)
    cones: FloatArray = np.column_stack([nodes[:-1], nodes[1:], radii[:-1], radii[1:]])
    return cones


def _bump(at: ArrayLike, radius: float) -> FloatArray:
    at = np.array(at, dtype=float)
    return _chain([at, 1.02 * at], [radius, radius])


def _kidney(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    angle = np.radians([-75, -40, 0, 40, 75])
    arc = np.column_stack([0.38 * np.sin(angle), 0 * angle, 0.38 * (np.cos(angle) - 0.8)])
    cones = [
        _chain(arc, [0.15, 0.2, 0.21, 0.2, 0.17]),
        _chain([[0, 0.02, -0.02], [0.04, 0.05, -0.14]], [0.09, 0.06]),
    ]
    return np.concatenate([*cones, _bump([0.33, 0.1, 0.1], 0.13), _bump([-0.2, -0.17, 0.1], 0.1)]), NO_CUTS


def _hippocampus(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    cones = [
        _chain(
            [[-0.55, 0, 0.2], [-0.35, 0.05, 0.02], [-0.05, 0.05, -0.05], [0.25, 0, 0], [0.4, -0.12, 0.08]],
            [0.06, 0.09, 0.11, 0.14, 0.13],
        ),
        _chain([[0.3, -0.05, 0.05], [0.3, -0.22, 0.08]], [0.12, 0.09]),
        *(_bump([0.3 + 0.08 * i, 0.1, 0.1 - 0.05 * i], 0.07) for i in range(3)),
    ]
    return np.concatenate(cones), NO_CUTS


def _liver(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    cones = [
        _chain([[0.22, 0, 0], [-0.15, 0.04, 0.06], [-0.42, 0.02, 0.08]], [0.26, 0.16, 0.08]),
        _chain([[0.22, 0, 0], [0.22, 0.06, -0.3]], [0.25, 0.12]),
        _chain([[0.1, 0.2, -0.1], [0.04, 0.25, -0.2]], [0.07, 0.06]),
        _chain([[-0.05, -0.12, 0.0], [-0.12, -0.14, -0.1]], [0.09, 0.08]),
    ]
    return np.concatenate(cones), NO_CUTS


def _heart(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    cones = [
        _chain([[0.12, 0, 0.1], [0.03, 0.05, -0.35]], [0.2, 0.09]),
        _chain([[-0.13, 0.05, 0.08], [-0.02, 0.1, -0.2]], [0.17, 0.1]),
        _chain([[0, 0, 0.2], [-0.02, 0, 0.36], [0.1, -0.06, 0.42]], [0.1, 0.08, 0.075]),
        _bump([-0.2, -0.1, 0.2], 0.13),
        _bump([0.18, -0.14, 0.2], 0.12),
    ]
    return np.concatenate(cones), NO_CUTS


def _nodule(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Make a lump with six bumps in random directions."""
    bumps = [_bump(_direction(rng) * [0.34, 0.28, 0.24], rng.uniform(0.07, 0.14)) for _ in range(6)]
    return np.concatenate([_chain([[-0.12, 0, 0], [0.12, 0, 0]], [0.24, 0.26]), *bumps]), NO_CUTS


def _face(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Make a face that looks to z; y points up."""
    cones = [
        _chain([[0, 0.15, 0], [0, -0.22, 0.03]], [0.37, 0.27]),
        _chain([[0, 0.12, 0.36], [0.01, -0.05, 0.46]], [0.04, 0.065]),
        _chain([[0, -0.34, 0.24], [0.02, -0.36, 0.26]], [0.09, 0.09]),
        _chain([[-0.08, -0.2, 0.29], [0.09, -0.2, 0.28]], [0.05, 0.05]),
        *(_chain([[side * 0.06, 0.21, 0.35], [side * 0.2, 0.22, 0.28]], [0.05, 0.045]) for side in (-1, 1)),
        *(_bump([side * 0.14, 0.09, 0.31], 0.07) for side in (-1, 1)),
        *(_bump([side * 0.2, -0.05, 0.22], 0.08) for side in (-1, 1)),
        _bump([0.22, -0.12, 0.22], 0.06),
    ]
    return np.concatenate(cones), np.array([[0, 0, -1, -0.04]])


def _cortex(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Make a dome with four winding ridges."""
    cones = [_chain([[-0.12, 0, 0], [0.12, 0, 0]], [0.4, 0.4])]
    for start in np.linspace(0, 2 * np.pi, 4, endpoint=False) + rng.uniform(0, 0.8, 4):
        polar = np.linspace(0.25, 1.2, 5)
        turn = start + np.cumsum(rng.uniform(-0.5, 0.5, 5))
        ridge = np.column_stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)])
        cones.append(_chain(ridge * [0.55, 0.43, 0.43], rng.uniform(0.045, 0.07, 5)))
    return np.concatenate(cones), np.array([[0, 0, -1, -0.06]])


def _tube(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Make a vessel with five bulges, open at both ends."""
    cones = [_chain([[-0.7, 0, 0], [0, 0.03, 0.03], [0.7, 0, 0]], [0.17, 0.15, 0.19])]
    for _ in range(5):
        angle, radius = rng.uniform(0, 2 * np.pi), rng.uniform(0.07, 0.12)
        cones.append(_bump([rng.uniform(-0.4, 0.4), 0.14 * np.cos(angle), 0.14 * np.sin(angle)], radius))
    return np.concatenate(cones), np.array([[1, 0, 0, 0.5], [-1, 0, 0, 0.5]])


def _direction(rng: np.random.Generator) -> FloatArray:
    normal = rng.standard_normal(3)
    unit: FloatArray = normal / np.linalg.norm(normal)
    return unit


NO_CUTS = np.zeros((0, 4))  # planes of an organ that is not cut open

PLANS: dict[str, Callable[[np.random.Generator], tuple[FloatArray, FloatArray]]] = {
    "kidney": _kidney,
    "hippocampus": _hippocampus,
    "liver": _liver,
    "heart": _heart,
    "nodule": _nodule,
    "face": _face,
    "cortex": _cortex,
    "tube": _tube,
}
"""Cones of a kind at rest, and the planes at which it is cut open."""
