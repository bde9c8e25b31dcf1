"""Distances from landmarks, in numbers that a part and a whole share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.matching.relations.part_pair import TRUSTED, PartPair
from isomatch.matching.relations.part_signatures import PartSignatures
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property


@dataclass(frozen=True, eq=False)
class LandmarkDistances:
    """Distances from landmarks, up to a reach beyond which a twisted limb or an unknown detour spoils them.

    Parameters
    ----------
    whole : PreparedShape
        A mesh of area 1.
    landmarks : (l,) array of int
        Vertices of its body.
    reach : float
        Larger distances count as this, in √area of the whole.
    """

    whole: PreparedShape
    landmarks: IntArray
    reach: float

    @cached_property
    def values(self) -> FloatArray:
        """(n_whole, l) distances."""
        everywhere = np.arange(self.whole.body.n_vertices)
        return np.clip(self.whole.distances.between(everywhere, self.landmarks), 0.0, self.reach)

    def of_part(self, pair: PartPair) -> PartSignatures:
        """Distances on a part in the unit of a pair, trusted where no path beyond the boundary can be shorter."""
        bounds = (each[: len(self.landmarks)] for each in (pair.lower, pair.along))
        lower, upper = (np.minimum(pair.unit * bound.T, self.reach) for bound in bounds)
        return PartSignatures(upper, (lower >= TRUSTED * upper).astype(np.float64))
