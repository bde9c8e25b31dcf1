"""The meshes of a file that has several, and where it puts them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from isomatch.values.arrays import AnyArray, FloatArray, IntArray


@dataclass(frozen=True)
class Part:
    """One of several meshes in a file, whose points and polygons follow those of the parts before.

    Parameters
    ----------
    name : str
        Its name in the file.
    n_points, n_polygons : int
        Numbers of points and polygons of this part.
    transform : (4, 4) nested tuple of float, optional
        Where the file puts it: a matrix that is multiplied by columns x, y, z, 1.
    """

    name: str
    n_points: int
    n_polygons: int
    transform: tuple[tuple[float, ...], ...] | None = None


Parts = tuple[Part, ...]


def placed(points: FloatArray, parts: Parts) -> FloatArray:
    """Return points where the transforms of the parts put them."""
    found = np.array(points)
    for rows, matrix in _transformed(parts):
        found[rows] = product(points[rows], matrix[:3, :3].T) + matrix[:3, 3]
    return found


def unplaced(positions: FloatArray, parts: Parts) -> FloatArray:
    """Return the points that are put at these positions."""
    found = np.array(positions)
    for rows, matrix in _transformed(parts):
        back = np.linalg.pinv(matrix)
        found[rows] = positions[rows] @ back[:3, :3].T + back[:3, 3]
    return found


def turned(
    values: AnyArray, part_of: IntArray, parts: Parts, *, tangents: bool, back: bool, unit: bool = True
) -> AnyArray:
    """Turn normals or tangents as the transforms of their parts do, or ``back``; their length becomes 1 if ``unit``."""
    found = np.array(values)
    for i, part in enumerate(parts):
        if part.transform is not None:
            matrix = np.array(part.transform)[:3, :3]
            along, across = matrix.T, np.linalg.pinv(matrix)
            if back:
                along, across = across.T, along.T
            vectors = product(found[part_of == i, :3], along if tangents else across)
            length = np.linalg.norm(vectors, axis=1, keepdims=True) if unit else np.ones((1, 1))
            found[part_of == i, :3] = vectors / np.where(length > 0, length, 1)
    return found


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a @ b, rounded alike on every machine, so that hashes of what is placed are the same."""
    total: FloatArray = a[:, :1] * b[0]
    for i in range(1, len(b)):
        total = total + a[:, i, None] * b[i]
    return total


def _transformed(parts: Parts) -> Iterator[tuple[slice, FloatArray]]:
    """Rows of the points of each part that has a transform, and its matrix."""
    start = 0
    for part in parts:
        if part.transform is not None:
            yield slice(start, start + part.n_points), np.array(part.transform)
        start += part.n_points
