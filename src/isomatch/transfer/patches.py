"""Pieces of the surface that receives, by which labels are voted for and values of polygons averaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from isomatch.assets import Attribute
from isomatch.transfer.bridge import Bridge
from isomatch.values.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Patches:
    """Pieces of the receiver's surface: their area, their owner, and the row of an attribute at each.

    An owner is a vertex, a corner or a polygon; ``owner_of_row`` is that of each row of the receiver.
    """

    area: FloatArray
    owner: IntArray
    rows: IntArray
    owner_of_row: IntArray

    @classmethod
    def of(cls, attribute: Attribute, bridge: Bridge) -> Patches:
        """Make the pieces of the domain of an attribute: thirds of triangles that have a place."""
        receiver = bridge.receiver
        triangles = receiver.polygons.corner_of_triangle.ravel()
        owner, owner_of_row = {
            "point": (receiver.mesh.faces.ravel(), receiver.vertex_of_point),
            "corner": (triangles, np.arange(len(receiver.polygons.corners))),
            "face": (receiver.polygons.of_corner[triangles], np.arange(len(receiver.polygons))),
        }[attribute.domain]
        places = bridge.at_thirds
        found = places.found
        area = np.repeat(receiver.mesh.face_areas, 3)[found] + np.finfo(float).tiny
        return cls(area, owner[found], places.nearest_rows(attribute)[found], owner_of_row)

    @property
    def n_owners(self) -> int:
        """Number of owners."""
        return int(self.owner_of_row.max(initial=-1)) + 1

    def sums(self, of_piece: IntArray, n: int) -> csr_array:
        """(n_owners, n) area of the pieces of each owner that have each of n values."""
        return csr_array((self.area, (self.owner, of_piece)), shape=(self.n_owners, n))
