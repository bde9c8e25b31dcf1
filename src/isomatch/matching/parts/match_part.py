"""The match of a part to a whole: units, starts, refinement and choice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from operator import attrgetter

import numpy as np

from isomatch.errors import NotConvergedError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.parts.bent_part import BentPart
from isomatch.matching.parts.evidence import Evidence
from isomatch.matching.parts.part_fits import PartFit, PartFits
from isomatch.matching.parts.part_pair import NO_LANDMARKS, PartPair
from isomatch.matching.parts.part_starts import PartStarts, self_maps
from isomatch.matching.select import nearest_to_hints
from isomatch.runtime.threads import parallel_map
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import IntArray
from isomatch.values.cached import cached_property

TWISTED = 10.0  # factor on the score of a map whose orientation is less than half of the clearest


@dataclass(frozen=True, eq=False)
class PartMatch:
    """What the match of a part found.

    Parameters
    ----------
    fits : tuple of PartFit
        Refined maps: the one selected, then the others, best first.
    scores : tuple of float
        What speaks against each.
    closed : float
        What speaks against the map with the holes closed, over that against the best.
    """

    fits: tuple[PartFit, ...]
    scores: tuple[float, ...]
    closed: float = np.inf

    @property
    def pair(self) -> PartPair:
        """The shapes, in the unit of the best map."""
        return self.fits[0].pair

    @property
    def rival(self) -> float:
        """Score of the best map that differs, over that of the best; inf if none does."""
        best, whole = self.fits[0], self.pair.whole
        for fit, score in zip(self.fits[1:], self.scores[1:]):
            if whole.mean_distance(fit.image, best.image) > self.pair.config.parts.apart:
                return max(1.0, score / self.scores[0])  # one that lost to hints ties
        return np.inf

    @property
    def evidence(self) -> Evidence:
        """How sure the best map is."""
        return Evidence(self.scores[0], self.rival, self.pair.trusted, self.pair.config.parts)

    def agrees(self, image: IntArray) -> bool:
        """Whether a map (n_part,) that was found otherwise is a variant of the best one."""
        best, pair = self.fits[0], self.pair
        apart = pair.whole.mean_distance(best.image, image[best.refinement.vertices])
        return apart <= pair.config.parts.apart

    @property
    def share(self) -> float:
        """Area of the part over that of the whole, by the best map."""
        return self.fits[0].refinement.local_unit(self.fits[0].image) ** 2

    @cached_property
    def bent(self) -> BentPart:
        """The part bent onto the whole by the best map, in full."""
        best, settings = self.fits[0], self.pair.config.parts
        return best.bending.in_full(best.bent, settings.bending[-settings.n_bent_in_full :])


def match_part(
    part: PreparedShape,
    whole: PreparedShape,
    config: Config,
    landmarks: IntArray = NO_LANDMARKS,
    closed: IntArray | None = None,
    known: IntArray = NO_LANDMARKS,
) -> PartMatch:
    """Match a part to a whole.

    Parameters
    ----------
    part, whole : PreparedShape
        Meshes, in the same units.
    config : Config
    landmarks : (l, 2) array of int
        Vertices of the bodies of part and whole that correspond.
    closed : (n_part,) array of int, optional
        The map that was found with the holes closed; it is refined and contends as well.
    known : (q, 2) array of int
        Vertices of part and whole that correspond by another map. This map contends too, and wins a tie.

    Returns
    -------
    PartMatch

    Raises
    ------
    NotConvergedError
        If no map that keeps the orientation was found.
    """
    settings, pair = config.parts, PartPair.of(part, whole, config, landmarks)
    led = _filled(part, known) if len(known) else None
    refinements = PartFits(pair, led)
    given = [
        (pair.in_unit_of(image), image[part.sample_vertices[: settings.n_rough]])
        for image in (closed, led)
        if image is not None
    ]
    only_given = led is not None and config.hypotheses == "given"
    rough = [] if only_given else _rough_fits(pair, refinements, given)
    distinct = _distinct(rough, settings.n_contenders, settings.apart)
    hopeful = [fit for fit in distinct if fit.promise <= settings.hopeless * distinct[0].promise]
    hopeful = distinct[: max(len(hopeful), 2)]  # the best, and a rival
    contenders = [*((fit.pair, fit.image) for fit in hopeful), *given]
    if not contenders:
        raise NotConvergedError(
            "no map of the part keeps the orientation of the faces; give three to five landmarks, or start = 'pose' if "
            "the shapes are roughly aligned in space"
        )
    fits = parallel_map(lambda each: refinements.fine(*each), contenders)
    parallel_map(attrgetter("bent_score"), fits)  # on several threads, and kept
    against = _against(fits)
    fits.sort(key=against)
    n_settled = sum(
        against(fit) <= settings.hopeless * against(fits[0]) for fit in fits[: settings.n_settled]
    )
    fits[:n_settled] = parallel_map(refinements.settled, fits[:n_settled])
    parallel_map(attrgetter("bent_score"), fits)
    against = _against(fits)
    fits.sort(key=against)
    tied = [fit for fit in fits if against(fit) <= settings.tie * against(fits[0])]
    winner = nearest_to_hints(tied, config.selection)[0]
    fits.sort(key=lambda fit: fit is not winner)
    against_closed = np.inf
    if closed is not None:
        as_found = refinements.measured(
            pair.in_unit_of(closed), closed[part.sample_vertices[: config.n_refine]]
        )
        against_closed = against(as_found) / against(winner)
    return PartMatch(tuple(fits), tuple(map(against, fits)), against_closed)


def _against(fits: list[PartFit]) -> Callable[[PartFit], float]:
    """Return what speaks against a map, among others: its score, and that it twists the part."""
    clearest = max(fit.orientation for fit in fits)
    return lambda fit: fit.bent_score * (1 if fit.orientation >= 0.5 * clearest else TWISTED)


def _distinct(fits: list[PartFit], count: int, apart: float) -> list[PartFit]:
    """Take the first fits whose images differ from those of the ones before."""
    found: list[PartFit] = []
    for fit in fits:
        if len(found) == count:
            break
        if all(fit.pair.whole.mean_distance(fit.image, other.image) > apart for other in found):
            found.append(fit)
    return found


def _rough_fits(
    pair: PartPair, refinements: PartFits, given: list[tuple[PartPair, IntArray]]
) -> list[PartFit]:
    """Refine starts and given maps roughly, and vary the best by maps of the whole onto itself; the best first."""
    promise = attrgetter("promise")
    # landmarks tell the sides
    onto_itself = [] if len(pair.landmarks) else self_maps(pair.whole, pair.config)
    starts = PartStarts(pair, refinements.coordinates.signatures, onto_itself)()
    fits = [fit for fit in parallel_map(refinements.rough, starts) if fit]
    fits += [fit for fit in parallel_map(lambda each: refinements.roughly(*each), given) if fit]
    settings = pair.config.parts
    best = _distinct(sorted(fits, key=promise), settings.n_varied, settings.apart)
    varied = parallel_map(lambda each: refinements.varied(*each), list(product(best, onto_itself)))
    return sorted([*fits, *(fit for fit in varied if fit)], key=promise)


def _filled(part: PreparedShape, known: IntArray) -> IntArray:
    """Image (n_part,) of each vertex of a part under a map that is known at some: elsewhere that of the nearest one."""
    _, nearest = distance_along_edges_to_nearest(part.body, np.unique(known[:, 0]))
    image = np.zeros(part.body.n_vertices, dtype=np.int64)
    image[known[::-1, 0]] = known[::-1, 1]
    filled: IntArray = image[nearest]
    return filled
