"""Maps of a part refined from their starts, with the evidence for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.matching.parts.bent_part import BentPart, PartBending
from isomatch.matching.parts.part_pair import PartPair
from isomatch.matching.parts.part_refinement import PartRefinement, PartSamples, WholeCoordinates
from isomatch.matching.parts.part_starts import PartStart, completed, composed
from isomatch.values.arrays import IntArray
from isomatch.values.cached import cached_property

LEAST_SCORE = 1e-12  # so that scores have a ratio where a part is copied onto itself without error
N_ROUGH, N_FINE = (
    40,
    60,
)  # functions of the whole by which its copy on the part is drawn, to see where its normals point
N_DRAWN = 200  # functions by which the anchors of a fine map are drawn


@dataclass(frozen=True, eq=False)
class PartFit:
    """A refined map of a part.

    Parameters
    ----------
    pair : PartPair
        The shapes, in the unit of the map.
    refinement : PartRefinement
    image : (r,) array of int
        Vertices of the whole for the vertices of the refinement.
    misfit : float
        Mean distance of these vertices from their images in the last coordinates.
    stress : float
        Mean cost of the images of the anchors, see `PartPair.stress`.
    orientation : float
        Mean cosine of the normals.
    local_stress, curvature_mismatch : float
        See `PartRefinement`.
    bending : PartBending
        Bends the part.
    lengths : tuple of float
        Lengths over which the part resists when it is bent by the map, see `PartSettings`.
    hint_error : float
        Mean distance from the images that hints ask for, in √area of the whole; 0 before the end, and without hints.
    """

    pair: PartPair
    refinement: PartRefinement
    image: IntArray
    misfit: float
    stress: float
    orientation: float
    local_stress: float
    curvature_mismatch: float
    bending: PartBending
    lengths: tuple[float, ...] = ()
    hint_error: float = 0.0

    @cached_property
    def bent(self) -> BentPart:
        """The part bent onto the whole by the map, at a lower resolution."""
        return self.bending.coarsely(self.pair, self.refinement, self.image, self.lengths)

    @property
    def score(self) -> float:
        """What speaks against the map before the part is bent by it."""
        exponent = self.pair.config.parts.stress_exponent
        shape = np.sqrt(self.local_stress * self.curvature_mismatch)
        return float(self.misfit * self.stress**exponent * shape)

    @property
    def bent_score(self) -> float:
        """What speaks against the map once the part is bent by it."""
        return max(self.score * self.bent.misfit, LEAST_SCORE)

    @property
    def promise(self) -> float:
        """What speaks against a map that is refined roughly: one twisted in places may still become the right one."""
        return float(self.score / np.sqrt(max(self.orientation, 0.1)))


class PartFits:
    """The two refinements of a start, rough and fine, with what they share for all starts in the same unit.

    Parameters
    ----------
    pair : PartPair
        The shapes, in any unit.
    hinted : (n_part,) array of int, optional
        Vertices of the whole that a given map has as images.
    """

    def __init__(self, pair: PartPair, hinted: IntArray | None = None) -> None:
        config = pair.config
        self._config, self._hinted, self._samples = config, hinted, PartSamples(pair)
        self.coordinates = WholeCoordinates(pair.whole, config, pair.landmarks)
        self.bending = PartBending(pair.meshes[0], config.parts.n_bent_vertices)
        self._known: dict[tuple[float, int], PartRefinement] = {}

    def _refinement(self, pair: PartPair, n_rows: int) -> PartRefinement:
        """Refine some vertices in the unit of a pair."""
        key = pair.unit, n_rows
        if key not in self._known:
            self._known[key] = PartRefinement(pair, self.coordinates, self._samples, n_rows)
        return self._known[key]

    def _rough_refinement(self, pair: PartPair) -> PartRefinement:
        return self._refinement(pair, self._config.parts.n_rough)

    def fine_refinement(self, pair: PartPair) -> PartRefinement:
        """Refine the vertices of a fine map in the unit of a pair."""
        return self._refinement(pair, self._config.n_refine)

    def rough(self, start: PartStart) -> PartFit | None:
        """Refine some vertices a little; None for a mirror image."""
        refinement = self._rough_refinement(start.pair)
        vertices = refinement.vertices[: self._config.n_search]
        return self.roughly(start.pair, refinement.extended(start.dense(vertices), N_ROUGH))

    def varied(self, fit: PartFit, image_row: IntArray) -> PartFit | None:
        """Compose a roughly refined map with a map of the whole onto itself, and refine it again."""
        return self.roughly(fit.pair, composed(fit.pair.whole, fit.image, image_row))

    def roughly(self, pair: PartPair, image: IntArray) -> PartFit | None:
        """Refine a map of the vertices of a rough one a little; None for a mirror image."""
        refinement, sizes = self._rough_refinement(pair), self._config.parts.sizes
        if refinement.orientation(image, N_ROUGH) < 0:
            return None
        image, misfit = refinement.refined(image, sizes)
        anchors = refinement.at(image, sizes[-1], pair.anchors)
        return _fit(refinement, pair, image, misfit, anchors, N_ROUGH, self.bending)

    def fine(self, pair: PartPair, image: IntArray) -> PartFit:
        """Refine a map of the vertices of a rough one to the end."""
        settings, rough = self._config.refining, self._rough_refinement(pair)
        pair = pair.with_unit(rough.local_unit(image))
        refinement = self.fine_refinement(pair)
        image = refinement.extended(image, self._config.parts.sizes[-1])
        image, _ = refinement.refined(image, settings.sizes_without_positions, with_positions=False)
        image, misfit = refinement.refined(image, (*settings.sizes_with_positions, *settings.final_sizes))
        return self._finely(pair, image, misfit, self._config.parts.bending[::2])

    def settled(self, fit: PartFit) -> PartFit:
        """Refine a map again from where the part lies that was bent by it, bend the part by the new map, and so on."""
        for _ in range(self._config.parts.n_bent):
            image = self.bending.image(fit.bent, fit.refinement.vertices)
            image, misfit = fit.refinement.refined(image, self._config.refining.final_sizes)
            fit = self._finely(fit.pair, image, misfit, self._config.parts.bending)
        return fit

    def measured(self, pair: PartPair, image: IntArray) -> PartFit:
        """Measure a map of the vertices of a fine one that was found otherwise, as if it were refined."""
        _, misfit = self.fine_refinement(pair).refined(image, self._config.refining.final_sizes[-1:])
        return self._finely(pair, image, misfit, self._config.parts.bending)

    def _finely(self, pair: PartPair, image: IntArray, misfit: float, lengths: tuple[float, ...]) -> PartFit:
        refinement, most = self.fine_refinement(pair), len(pair.whole.laplace.values)
        anchors = completed(pair, refinement.at(image, min(N_DRAWN, most), pair.anchors), 2)
        error = 0.0
        if self._hinted is not None:
            error = pair.whole.mean_distance(image, self._hinted[refinement.vertices])
        return _fit(refinement, pair, image, misfit, anchors, N_FINE, self.bending, lengths, error)


def _fit(
    refinement: PartRefinement,
    pair: PartPair,
    image: IntArray,
    misfit: float,
    anchors: IntArray,
    k: int,
    bending: PartBending,
    lengths: tuple[float, ...] = (),
    hint_error: float = 0.0,
) -> PartFit:
    """Gather the evidence for a map, and for the images that it gives the anchors."""
    return PartFit(
        pair,
        refinement,
        image,
        misfit,
        pair.stress(anchors),
        refinement.orientation(image, k),
        refinement.local_stress(image),
        refinement.curvature_mismatch(image),
        bending,
        lengths,
        hint_error,
    )
