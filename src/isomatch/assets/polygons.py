"""Polygons of different sizes, stored in one concatenated array, and their triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MeshError
from isomatch.values.arrays import IntArray, array_of
from isomatch.values.cached import cached_property


@dataclass(frozen=True, eq=False, repr=False)
class Polygons:
    """Triangles, quads and other polygons, in the order of a file.

    Parameters
    ----------
    corners : (c,) array_like of int
        Point of each corner, from 0, of all polygons one after another.
    sizes : (p,) array_like of int
        Number of corners of each polygon, at least 3.

    Raises
    ------
    MeshError
        If the sizes do not fit the corners.

    Examples
    --------
    >>> Polygons([0, 1, 2, 3, 3, 2, 4], [4, 3]).triangles.tolist()
    [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    """

    corners: IntArray
    sizes: IntArray

    def __init__(self, corners: ArrayLike, sizes: ArrayLike) -> None:
        for name, values in (("corners", corners), ("sizes", sizes)):
            array = array_of(values, name, MeshError)
            if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
                raise MeshError(
                    f"{name} have shape {array.shape} and type {array.dtype}, expected (k,) integers"
                )
            array = np.array(array, dtype=np.int64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if (self.sizes < 3).any() or self.sizes.sum() != len(self.corners):
            raise MeshError(
                f"sizes of polygons, at least {self.sizes.min(initial=3)} and together {self.sizes.sum()}, do not "
                f"fit {len(self.corners)} corners; give the number of corners of each, at least 3"
            )

    @classmethod
    def of_triangles(cls, faces: IntArray) -> Polygons:
        """Make polygons of (m, 3) triangles, or of (m, k) polygons of k corners each."""
        return cls(faces.ravel(), np.full(len(faces), faces.shape[1]))

    def __len__(self) -> int:
        return len(self.sizes)

    @cached_property
    def corner_of_triangle(self) -> IntArray:
        """(m, 3) the corners of the polygons that are those of each triangle; a polygon is a fan of triangles."""
        return triangulate(np.arange(len(self.corners)), self.sizes)

    @property
    def triangles(self) -> IntArray:
        """(m, 3) points of each triangle."""
        return triangulate(self.corners, self.sizes)

    @property
    def starts(self) -> IntArray:
        """(p,) the first corner of each polygon."""
        starts: IntArray = np.cumsum(self.sizes) - self.sizes
        return starts

    @property
    def of_triangle(self) -> IntArray:
        """(m,) the polygon that each triangle is a piece of."""
        return np.repeat(np.arange(len(self)), self.sizes - 2)

    @property
    def of_corner(self) -> IntArray:
        """(c,) the polygon of each corner."""
        return np.repeat(np.arange(len(self)), self.sizes)


def triangulate(corners: IntArray, counts: IntArray) -> IntArray:
    """Split each polygon into a fan around its first corner.

    Parameters
    ----------
    corners : (sum of counts,) array of int
        Vertex indices of all polygons, concatenated.
    counts : (p,) array of int
        Number of corners of each polygon, at least 3.

    Returns
    -------
    (sum of counts - 2, 3) array of int
        Triangles, in the order of the polygons.

    Examples
    --------
    >>> triangulate(np.array([0, 1, 2, 3, 7, 8, 9]), np.array([4, 3])).tolist()
    [[0, 1, 2], [0, 2, 3], [7, 8, 9]]
    """
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    starts = np.cumsum(counts) - counts
    second = spans(starts + 1, counts - 2)
    triangles = np.zeros((len(second), 3), dtype=corners.dtype)
    triangles[:, 0] = np.repeat(corners[starts], counts - 2)
    triangles[:, 1] = corners[second]
    second += 1
    triangles[:, 2] = corners[second]
    return triangles


def spans(starts: IntArray, counts: IntArray) -> IntArray:
    """Concatenate the ranges ``start, start + 1, …`` of the given lengths.

    Examples
    --------
    >>> spans(np.array([10, 20]), np.array([2, 3])).tolist()
    [10, 11, 20, 21, 22]
    """
    before = np.cumsum(counts) - counts
    ranges: IntArray = np.repeat(starts - before, counts) + np.arange(counts.sum(), dtype=np.int64)
    return ranges
