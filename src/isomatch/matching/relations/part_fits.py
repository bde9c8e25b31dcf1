"""Maps of a part refined from their starts, with the evidence for each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from isomatch.descriptors import deviation_of
from isomatch.matching.fit import Fit
from isomatch.matching.relations.part_bending import BentPart, PartBending
from isomatch.matching.relations.part_pair import PartPair
from isomatch.matching.relations.part_refinement import (
    N_ROUGH_VERTICES,
    PartRefinement,
    PartSamples,
    WholeCoordinates,
)
from isomatch.matching.relations.part_starts import PartStart, completed, composed
from isomatch.matching.search import FromAnchors
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

# cost = misfit × stress to this power; docs/lab/design_notes.md: 0.15 to 0.4 choose alike
STRESS_EXPONENT = 0.25

# functions of the whole in the short refinement; chosen on cuts and holes, not one by one
ROUGH_SIZES = (20, 40, 70)

N_BENT = 2  # times that a map is settled; docs/lab/robustness.md: parts

LEAST_SCORE = 1e-12  # so that scores have a ratio where a part is copied onto itself without error
N_ROUGH_FUNCTIONS, N_FINE_FUNCTIONS = (
    40,
    60,
)  # functions of the whole that are drawn on the part, to see where normals point
N_DRAWN = 200  # functions by which the anchors of a fine map are drawn


@dataclass(frozen=True, eq=False, kw_only=True)
class PartFit(Fit):
    """A map of a part, in a unit.

    Parameters
    ----------
    image, misfit, orientation, hint_error
        As of `Fit`; ``score`` stays nan, see ``cost``.
    pair : PartPair
        The shapes, in the unit of the map.
    refinement : PartRefinement
        Refines the vertices that are mapped.
    bending : PartBending
        Bends the part.
    stress : float
        Mean cost of the images of the anchors, see `PartPair.stress`.
    lengths : tuple of float
        Lengths over which the part resists when it is bent by the map, see `PartSettings`.
    """

    pair: PartPair
    refinement: PartRefinement
    bending: PartBending
    stress: float = np.nan
    lengths: tuple[float, ...] = ()

    @cached_property
    def mismatches(self) -> FloatArray:
        """(r,) how differently part and whole look around each vertex and its image; nan where nothing is known."""
        here, there = self.pair.signature, self.pair.whole.balls
        if there is None:
            return np.full(len(self.image), np.nan)
        return here.at(self.refinement.vertices).mismatch(there.at(self.image), deviation_of(there))

    @property
    def mismatch(self) -> float:
        """Their mean, or 0 if nothing is known."""
        known = self.mismatches[np.isfinite(self.mismatches)]
        return float(known.mean()) if len(known) else 0.0

    @cached_property
    def bent(self) -> BentPart:
        """The part bent onto the whole by the map, at a lower resolution."""
        return self.bending.coarsely(self.pair, self.refinement, self.image, self.lengths)

    @property
    def is_measured(self) -> bool:
        """Whether the relation has measured the map."""
        return bool(np.isfinite(self.misfit) and np.isfinite(self.stress))

    @property
    def share(self) -> float:
        """Area of the part over that of the whole, by the map."""
        return self.refinement.local_unit(self.image) ** 2

    @property
    def cost(self) -> float:
        """What the map costs among others: how badly coordinates and distances agree."""
        return max(float(self.misfit * self.stress**STRESS_EXPONENT), LEAST_SCORE)

    @property
    def bent_cost(self) -> float:
        """What the map costs by itself, where no other is compared: the part is bent by it, too."""
        return max(self.cost * self.bent.misfit, LEAST_SCORE)

    @property
    def promise(self) -> float:
        """The cost of a map that is refined roughly: one twisted in places may still become the right one."""
        twist = np.sqrt(max(self.orientation, 0.1))
        return float(self.cost / twist * np.exp(self.pair.config.parts.mismatch_weight * self.mismatch))


class PartFits:
    """The two refinements of a start, rough and fine, with what they share for all starts in the same unit.

    Parameters
    ----------
    pair : PartPair
        The shapes, in any unit.
    hinted : (n_part,) array of int, optional
        Vertices of the whole that a given map has as images.
    coordinates : WholeCoordinates, optional
        Those of the whole, if they are known.
    """

    def __init__(
        self, pair: PartPair, hinted: IntArray | None = None, coordinates: WholeCoordinates | None = None
    ) -> None:
        config = pair.config
        self.pair, self._config, self._hinted, self._samples = pair, config, hinted, PartSamples(pair)
        self.coordinates = coordinates or WholeCoordinates(
            pair.whole, config, pair.landmarks, pair.functions.target
        )
        self.bending = PartBending(pair.meshes[0], config.parts.n_bent_vertices)
        self._known: dict[tuple[float, int], PartRefinement] = {}
        self._refined: dict[tuple[float, bytes], PartFit] = {}
        self._settled: dict[tuple[float, bytes], PartFit] = {}

    def of_part(self, part: PreparedShape) -> PartFits:
        """Return those of another part on which distances are the same, as of a mirror image."""
        return PartFits(replace(self.pair, part=part), self._hinted, self.coordinates)

    def _refinement(self, pair: PartPair, n_rows: int) -> PartRefinement:
        """Refine some vertices in the unit of a pair."""
        key = pair.unit, n_rows
        if key not in self._known:
            self._known[key] = PartRefinement(pair, self.coordinates, self._samples, n_rows)
        return self._known[key]

    def _rough_refinement(self, pair: PartPair) -> PartRefinement:
        return self._refinement(pair, N_ROUGH_VERTICES)

    def fine_refinement(self, pair: PartPair) -> PartRefinement:
        """Refine the vertices of a fine map in the unit of a pair."""
        return self._refinement(pair, self._config.n_refine)

    def rough(self, start: PartStart) -> PartFit | None:
        """Refine some vertices a little; None for a mirror image."""
        refinement = self._rough_refinement(start.pair)
        vertices = refinement.vertices[: self._config.n_search]
        origin = "landmarks" if len(self.pair.landmarks) else FromAnchors.name
        return self.roughly(start.pair, refinement.extended(start.dense(vertices), N_ROUGH_FUNCTIONS), origin)

    def varied(self, fit: PartFit, image_row: IntArray) -> PartFit | None:
        """Compose a roughly refined map with a map of the whole onto itself, and refine it again."""
        return self.roughly(fit.pair, composed(fit.pair.whole, fit.image, image_row), fit.origin)

    def roughly(self, pair: PartPair, image: IntArray, origin: str) -> PartFit | None:
        """Refine a map of the vertices of a rough one a little; None for a mirror image."""
        refinement = self._rough_refinement(pair)
        if refinement.orientation(image, N_ROUGH_FUNCTIONS) < 0:
            return None
        image, misfit = refinement.refined(image, ROUGH_SIZES)
        anchors = refinement.at(image, ROUGH_SIZES[-1], pair.anchors)
        return _fit(refinement, pair, image, misfit, anchors, N_ROUGH_FUNCTIONS, self.bending, origin)

    def begun(self, pair: PartPair, image: IntArray, origin: str) -> PartFit:
        """Extend a map of the vertices of a rough one to those of a fine one, in the unit that it measures."""
        pair = pair.with_unit(self._rough_refinement(pair).local_unit(image))
        refinement = self.fine_refinement(pair)
        image = refinement.extended(image, ROUGH_SIZES[-1])
        return PartFit(image, origin=origin, pair=pair, refinement=refinement, bending=self.bending)

    def refined(self, fit: PartFit) -> PartFit:
        """Refine a map to the end, unless the same was refined before."""
        return _remembered(self._refined, fit, self._refined_now)

    def _refined_now(self, fit: PartFit) -> PartFit:
        settings = self._config.refining
        sizes = (*settings.sizes_without_positions, *settings.sizes_of_parts)
        image, misfit = fit.refinement.refined(fit.image, sizes, False)
        if sizes := (*settings.sizes_with_positions, *settings.final_sizes):
            image, misfit = fit.refinement.refined(image, sizes)
        return self._finely(fit.pair, image, misfit, self._config.parts.bending[::2], fit.origin)

    def settled(self, fit: PartFit, again: Callable[[PartFit], PartFit]) -> PartFit:
        """Refine a map again from where the part lies that was bent by it, bend the part by the new map, and so on."""

        def settled_now(fit: PartFit) -> PartFit:
            for _ in range(N_BENT):
                image = self.bending.image(fit.bent, fit.refinement.vertices)
                fit = again(replace(fit, image=image, misfit=np.inf))
            return fit

        return _remembered(self._settled, fit, settled_now)

    def refined_again(self, fit: PartFit) -> PartFit:
        """Take the last steps of the refinement."""
        settings = self._config.refining
        steps = (settings.final_sizes, True) if settings.final_sizes else settings.last_step
        image, misfit = fit.refinement.refined(fit.image, *steps)
        return self._finely(fit.pair, image, misfit, self._config.parts.bending, fit.origin)

    def measured(self, pair: PartPair, image: IntArray, origin: str = "") -> PartFit:
        """Measure a map of the vertices of a fine one that was found otherwise, as if it were refined."""
        _, misfit = self.fine_refinement(pair).refined(image, *self._config.refining.last_step)
        return self._finely(pair, image, misfit, self._config.parts.bending, origin)

    def _finely(
        self, pair: PartPair, image: IntArray, misfit: float, lengths: tuple[float, ...], origin: str
    ) -> PartFit:
        refinement, most = self.fine_refinement(pair), len(pair.whole.laplace.values)
        anchors = completed(pair, refinement.at(image, min(N_DRAWN, most), pair.anchors), 2)
        error = 0.0
        if self._hinted is not None:
            error = pair.whole.mean_distance(image, self._hinted[refinement.vertices])
        k = N_FINE_FUNCTIONS
        return _fit(refinement, pair, image, misfit, anchors, k, self.bending, origin, lengths, error)


def _remembered(
    known: dict[tuple[float, bytes], PartFit], fit: PartFit, function: Callable[[PartFit], PartFit]
) -> PartFit:
    """Apply a function to a map, unless it was applied to the same one before."""
    key = fit.pair.unit, fit.image.tobytes()
    if key not in known:
        known[key] = function(fit)
    found = known[key]
    return found if found.origin == fit.origin else replace(found, origin=fit.origin)


def _fit(
    refinement: PartRefinement,
    pair: PartPair,
    image: IntArray,
    misfit: float,
    anchors: IntArray,
    k: int,
    bending: PartBending,
    origin: str,
    lengths: tuple[float, ...] = (),
    hint_error: float = 0.0,
) -> PartFit:
    """Gather the evidence for a map, and for the images that it gives the anchors."""
    return PartFit(
        image,
        misfit,
        orientation=refinement.orientation(image, k),
        hint_error=hint_error,
        origin=origin,
        pair=pair,
        refinement=refinement,
        bending=bending,
        stress=pair.stress(anchors),
        lengths=lengths,
    )
