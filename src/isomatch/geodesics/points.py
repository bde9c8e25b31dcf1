"""Points of a surface as a user names them: vertices, or points in faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MeshError, some
from isomatch.surfaces import PrecisePoints
from isomatch.values.arrays import AnyArray, IntArray

SUM = 1e-6  # by which the weights of a point may differ from 1 together


def points_of(given: ArrayLike | PrecisePoints, n_vertices: int) -> PrecisePoints:
    """Take vertices as points of the surface, and check those in faces.

    Parameters
    ----------
    given : int, (m,) array_like of int, or PrecisePoints
    n_vertices : int
        Number of vertices of the surface.

    Returns
    -------
    PrecisePoints

    Raises
    ------
    MeshError
        If a vertex is out of range or no integer, or weights are negative or do not add up to 1.

    Examples
    --------
    >>> points_of([4, 7], 9).corners.tolist()
    [[4, 4, 4], [7, 7, 7]]
    """
    if not isinstance(given, PrecisePoints):
        return PrecisePoints.at_vertices(vertices_of(given, n_vertices))
    corners, weights = np.asarray(given.corners), np.asarray(given.barycentric, dtype=np.float64)
    if (
        corners.ndim != 2
        or corners.shape[1] != 3
        or weights.shape != corners.shape
        or corners.dtype.kind not in "iu"
    ):
        raise MeshError(
            f"points have corners of shape {corners.shape} and type {corners.dtype}, and weights of shape "
            f"{weights.shape}; expected (m, 3) vertices and (m, 3) numbers"
        )
    _require_in_range(corners.ravel(), n_vertices)
    good = (weights >= 0).all(axis=1) & (np.abs(weights.sum(axis=1) - 1) <= SUM)
    if not good.all():
        i = int(np.argmin(good))
        raise MeshError(
            f"point {i} has weights {', '.join(f'{weight:g}' for weight in weights[i])}; expected three that are not "
            "negative and add up to 1"
        )
    return PrecisePoints(corners.astype(np.int64), weights)


def vertices_of(given: ArrayLike, n_vertices: int) -> IntArray:
    """Return (m,) indices of vertices; `MeshError` if they are none or out of range."""
    vertices = np.atleast_1d(np.asarray(given))
    if vertices.ndim != 1 or (vertices.size and vertices.dtype.kind not in "iu"):
        raise MeshError("points must be a one-dimensional array of vertex indices, or PrecisePoints")
    _require_in_range(vertices, n_vertices)
    return vertices.astype(np.int64)


def joined(*parts: PrecisePoints) -> PrecisePoints:
    """List the points of several lists."""
    return PrecisePoints(
        np.concatenate([part.corners for part in parts]), np.concatenate([part.barycentric for part in parts])
    )


def _require_in_range(vertices: AnyArray, n_vertices: int) -> None:
    bad = vertices[(vertices < 0) | (vertices >= n_vertices)]
    if len(bad):
        raise MeshError(f"vertices {some(bad)} are outside 0…{n_vertices - 1}, the vertices of the surface")
