"""What tells, before anything is matched, that two files hold one shape: numbers that no motion and no order changes."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from isomatch.collections.map_file import Record
from isomatch.surfaces import Mesh, PointCloud

N_RANKS = 64  # distances from the centroid that are compared, of the vertices in the order of these distances
SAME = 1e-5  # of the size: largest difference of these distances, in files of single precision
SYMMETRIC = 1e-6  # handedness: with less, a shape is its own mirror image, but for rounding

Likeness = Literal["copy", "mirror image"]


class Alike(NamedTuple):
    """A shape that is another one, but for a motion, the order of vertices and faces, and its size.

    Parameters
    ----------
    name, other : str
        The shape, and the one that comes before it.
    kind : {"copy", "mirror image"}
        Which of both it is of the other.
    factor : float
        How many times as large as the other it is.
    is_equal : bool
        Whether their vertices and faces are equal, also in their order.
    """

    name: str
    other: str
    kind: Likeness
    factor: float
    is_equal: bool


def likeness_of(surface: Mesh | PointCloud) -> Record:
    """Sum up where the vertices of a surface are, for the row of a shape.

    Returns
    -------
    dict
        ``spread``, the root mean square distance from the centroid; ``ranks``, distances from it divided by that, of
        vertices in this order; ``handedness``, the product of the skewnesses along the principal axes, whose sign turns
        in the mirror image. O(n log n) time.
    """
    used = np.isfinite(surface.vertices).all(axis=1)
    if isinstance(surface, Mesh):
        is_corner = np.zeros(surface.n_vertices, dtype=bool)
        is_corner[surface.faces[((surface.faces >= 0) & (surface.faces < len(is_corner))).all(axis=1)]] = True
        used &= is_corner
    points = np.unique(surface.vertices[used], axis=0)  # vertices at one position, as at seams, count once
    if len(points) < 2:
        return {}
    centred = points - points.mean(axis=0)
    distances = np.sort(np.linalg.norm(centred, axis=1))
    spread = float(np.sqrt((distances**2).mean()))
    ranks = np.round(np.linspace(0, len(points) - 1, N_RANKS)).astype(int)
    axes = np.linalg.svd(centred.T @ centred)[0]
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    along = centred @ axes / spread
    skewness = (along**3).mean(axis=0) / np.maximum((along**2).mean(axis=0), SAME**2) ** 1.5
    return {
        "n_points": len(points),
        "spread": spread,
        "ranks": np.round(distances[ranks] / spread, 8).tolist(),
        "handedness": float(skewness.prod()),
    }


def alike_shapes(shapes: dict[str, Record]) -> list[Alike]:
    """Find shapes that are one and the same, from their rows, each with the first that it is like.

    O(m²) time for m shapes with as many vertices.
    """
    groups: dict[int, list[str]] = {}
    for name, row in shapes.items():
        if row.get("ranks"):
            groups.setdefault(row["n_points"], []).append(name)
    found = []
    for names in groups.values():
        ranks = np.array([shapes[name]["ranks"] for name in names])
        for i, name in enumerate(names[1:], 1):
            near = np.flatnonzero(np.abs(ranks[:i] - ranks[i]).max(axis=1) <= SAME)
            if len(near):
                found.append(_alike(shapes, name, names[near[0]]))
    return found


def _alike(shapes: dict[str, Record], name: str, other: str) -> Alike:
    one, two = shapes[name], shapes[other]
    hands = one["handedness"], two["handedness"]
    is_turned = abs(sum(hands)) < abs(hands[0] - hands[1]) > SYMMETRIC
    is_equal = one["hash"] == two["hash"]
    kind: Likeness = "mirror image" if is_turned else "copy"
    return Alike(name, other, kind, one["spread"] / two["spread"], is_equal)
