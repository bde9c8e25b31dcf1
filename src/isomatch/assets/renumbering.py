"""Points and polygons of an asset that are left, welded or turned over, and where each comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.assets.fans import spans
from isomatch.assets.polygons import Polygons
from isomatch.values.arrays import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Renumbering:
    """What the points, corners and polygons of a new asset were in the old one.

    Parameters
    ----------
    point_index : (n_new,) array of int
        Old point of each new one.
    new_point : (n_old,) array of int
        New point of each old one, −1 for none.
    polygons : Polygons
        The new ones.
    polygon_index, corner_index : array of int
        Old polygon of each new one, and old corner of each new one.
    """

    point_index: IntArray
    new_point: IntArray
    polygons: Polygons
    polygon_index: IntArray
    corner_index: IntArray

    @classmethod
    def of(
        cls, polygons: Polygons, point_index: IntArray, new_point: IntArray, kept: IntArray, turned: BoolArray
    ) -> Renumbering:
        """Make it of the triangles of polygons that are kept, and which of these are turned over.

        A polygon of which all triangles are kept stays one, others become their triangles.
        """
        owner = polygons.of_triangle[kept]
        n_kept, n_turned = (np.bincount(rows, minlength=len(polygons)) for rows in (owner, owner[turned]))
        whole = (n_kept == polygons.sizes - 2) & ((n_turned == 0) | (n_turned == n_kept))
        alone = ~whole[owner]
        triangles = polygons.corner_of_triangle[kept[alone]]
        triangles[turned[alone]] = triangles[turned[alone]][:, [0, 2, 1]]
        of_whole, sizes = np.flatnonzero(whole), polygons.sizes[whole]
        offset = spans(np.zeros(len(sizes), dtype=np.int64), sizes)
        backwards = np.repeat((n_turned > 0)[whole], sizes)
        offset = np.where(backwards, -offset % np.repeat(sizes, sizes), offset)
        corners = np.concatenate([np.repeat(polygons.starts[whole], sizes) + offset, triangles.ravel()])
        index = np.concatenate([of_whole, owner[alone]])
        sizes = np.concatenate([sizes, np.full(len(triangles), 3)])
        order = np.argsort(index, kind="stable")
        corner_index = corners[spans((np.cumsum(sizes) - sizes)[order], sizes[order])]
        made = Polygons(new_point[polygons.corners[corner_index]], sizes[order])
        return cls(point_index, new_point, made, index[order], corner_index)
