"""Polygons of different sizes, stored in one concatenated array, and their triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch.assets.ear_clipping import ear_clipped
from isomatch.assets.fans import triangulate
from isomatch.errors import MeshError
from isomatch.values.arrays import FloatArray, IntArray, array_of
from isomatch.values.cached import cached_property

_UNCUT = (np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, eq=False, repr=False)
class Polygons:
    """Triangles, quads and other polygons, in the order of a file.

    Parameters
    ----------
    corners : (c,) array_like of int
        Point of each corner, from 0, of all polygons one after another.
    sizes : (p,) array_like of int
        Number of corners of each polygon, at least 3.
    points : (n, 3) array of float, optional
        Positions for cutting the polygons that are not convex; an `Asset` gives its own. Without them all polygons are
        cut as if they were convex.

    Raises
    ------
    MeshError
        If the sizes do not fit the corners.

    Examples
    --------
    >>> Polygons([0, 1, 2, 3, 3, 2, 4], [4, 3]).triangles.tolist()
    [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    >>> arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]])
    >>> Polygons([0, 1, 2, 3], [4], arrow).triangles.tolist()
    [[0, 1, 3], [1, 2, 3]]
    """

    corners: IntArray
    sizes: IntArray
    points: FloatArray | None

    def __init__(self, corners: ArrayLike, sizes: ArrayLike, points: FloatArray | None = None) -> None:
        if points is not None:
            points = np.ascontiguousarray(points, dtype=np.float64).view()
            points.flags.writeable = False
        object.__setattr__(self, "points", points)
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
    def _cut(self) -> tuple[IntArray, IntArray, IntArray]:
        """What `ear_clipped` cuts otherwise than fans."""
        if self.points is None:
            return _UNCUT
        return ear_clipped(self.points, self.corners, self.sizes)

    @cached_property
    def corner_of_triangle(self) -> IntArray:
        """(m, 3) the corners of the polygons that are those of each triangle.

        A convex polygon is a fan around its first corner; of others, ears are clipped, see `uncut`.
        """
        return self._with_ears(np.arange(len(self.corners)))

    @property
    def uncut(self) -> IntArray:
        """Polygons that are fans though they are not convex, because their outline crosses itself or has no area."""
        return self._cut[2]

    @property
    def triangles(self) -> IntArray:
        """(m, 3) points of each triangle."""
        if (self.sizes == 3).all():
            return self.corners.reshape(-1, 3)
        return self._with_ears(self.corners)

    def _with_ears(self, corners: IntArray) -> IntArray:
        rows, ears, _ = self._cut
        triangles = triangulate(corners, self.sizes)
        if len(rows):
            triangles[rows] = corners[ears]
        return triangles

    def at(self, points: FloatArray) -> Polygons:
        """Return the same, cut as they lie at these points, unless they have points already."""
        if self.points is not None or (self.sizes == 3).all():
            return self
        return Polygons(self.corners, self.sizes, points)

    def between(self, corners: IntArray) -> Polygons:
        """Return the same with other numbers for the same corners, cut in the same way."""
        polygons = Polygons(corners, self.sizes, self.points)
        polygons.__dict__["_cut"] = self._cut  # as the points have the numbers of before
        return polygons

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
