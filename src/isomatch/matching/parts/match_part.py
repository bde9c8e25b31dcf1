"""The match of a part to a whole: units, starts, refinement and choice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import IntArray
from isomatch._threads import parallel_map
from isomatch.correspondence import Embedding
from isomatch.errors import NotConvergedError
from isomatch.matching.config import Config
from isomatch.matching.parts.part_pair import NO_LANDMARKS, PartPair
from isomatch.matching.parts.part_refinement import PartRefinement
from isomatch.matching.parts.part_signatures import part_signatures
from isomatch.matching.parts.part_starts import PartStarts, self_maps
from isomatch.matching.prepare import PreparedShape

TWISTED = 10.0  # factor on the score of a map whose orientation is less than half of the clearest


@dataclass(frozen=True, eq=False)
class PartFit:
    """A refined map of a part.

    Parameters
    ----------
    image : (r,) array of int
        Vertices of the whole for the vertices of the refinement.
    misfit : float
        Mean distance of these vertices from their images in the last coordinates.
    stress : float
        Mean cost of the images of the anchors, see `PartPair.stress`.
    orientation : float
        Mean cosine of the normals.
    """

    image: IntArray
    misfit: float
    stress: float
    orientation: float


@dataclass(frozen=True, eq=False)
class PartMatch:
    """What the match of a part found.

    Parameters
    ----------
    pair : PartPair
        The shapes, in the unit found.
    refinement : PartRefinement
    fits : tuple of PartFit
        Refined maps, best first.
    scores : tuple of float
        What speaks against each.
    """

    pair: PartPair
    refinement: PartRefinement
    fits: tuple[PartFit, ...]
    scores: tuple[float, ...]

    @property
    def rival(self) -> float:
        """Score of the best map that differs, over that of the best; inf if none does."""
        best, whole = self.fits[0], self.pair.whole
        for fit, score in zip(self.fits[1:], self.scores[1:]):
            if whole.mean_distance(fit.image, best.image) > self.pair.config.parts.apart:
                return score / self.scores[0]
        return np.inf

    def embedding(self) -> Embedding:
        """Coordinates of all vertices of part and whole under the best map."""
        everywhere = np.arange(self.pair.part.body.n_vertices)
        return self.refinement.embedding(self.fits[0].image, 10**6, everywhere)


def match_part(
    part: PreparedShape, whole: PreparedShape, config: Config, landmarks: IntArray = NO_LANDMARKS
) -> PartMatch:
    """Match a part to a whole.

    Parameters
    ----------
    part, whole : PreparedShape
        Meshes, in the same units.
    config : Config
    landmarks : (l, 2) array of int
        Vertices of the bodies of part and whole that correspond.

    Returns
    -------
    PartMatch

    Raises
    ------
    NotConvergedError
        If no map that keeps the orientation was found.
    """
    settings = config.parts
    pair = PartPair.of(part, whole, config, landmarks)
    signatures = part_signatures(pair)
    onto_itself = [] if len(landmarks) else self_maps(whole, config)  # landmarks tell the sides
    search = PartStarts(pair, signatures, onto_itself)
    starts = search()
    unit = pair.unit_of(starts[0])
    if abs(unit / pair.unit - 1) > settings.unit_change:
        most = settings.largest_unit_change
        pair = pair.with_unit(pair.unit * float(np.clip(unit / pair.unit, 1 / most, most)))
        signatures = part_signatures(pair)
        search = PartStarts(pair, signatures, onto_itself)
        starts = search()
    rough = PartRefinement(pair, signatures, settings.n_rough)
    fits = [fit for fit in parallel_map(lambda images: _rough(pair, search, rough, images), starts) if fit]
    if not fits:
        raise NotConvergedError("no map of the part keeps the orientation of the faces; give landmarks")
    # a map that is twisted in places may still become the right one, so the orientation only counts with its root
    fits.sort(
        key=lambda fit: fit.misfit * fit.stress**settings.stress_exponent / max(fit.orientation, 0.1) ** 0.5
    )
    fine = PartRefinement(pair, signatures, config.n_refine)
    fits = parallel_map(
        lambda fit: _fine(pair, search, fine, rough.vertices, fit), fits[: settings.n_contenders]
    )
    trusted = pair.trusted > settings.least_trusted
    exponent = settings.stress_exponent if trusted else settings.untrusted_stress_exponent
    top = max(fit.orientation for fit in fits)

    def score(fit: PartFit) -> float:
        return float(fit.misfit * fit.stress**exponent * (1 if fit.orientation >= 0.5 * top else TWISTED))

    fits.sort(key=score)
    return PartMatch(pair, fine, tuple(fits), tuple(score(fit) for fit in fits))


def _rough(
    pair: PartPair, search: PartStarts, refinement: PartRefinement, images: IntArray
) -> PartFit | None:
    vertices = refinement.vertices[: pair.config.n_search]
    image = refinement.extended(vertices, search.dense(images, vertices), 40)
    if refinement.orientation(image, 40) < 0:
        return None
    image, misfit = refinement.refined(image, pair.config.parts.sizes)
    stress = pair.stress(refinement.at(image, 70, pair.anchors))
    return PartFit(image, misfit, stress, refinement.orientation(image, 40))


def _fine(
    pair: PartPair, search: PartStarts, refinement: PartRefinement, vertices: IntArray, fit: PartFit
) -> PartFit:
    settings = pair.config.refining
    image = refinement.extended(vertices, fit.image, 70)
    image, _ = refinement.refined(image, settings.sizes_without_positions, with_positions=False)
    image, misfit = refinement.refined(image, (*settings.sizes_with_positions, *settings.final_sizes))
    anchors = search.completed(
        refinement.at(image, min(200, len(pair.whole.laplace.values)), pair.anchors), 2
    )
    return PartFit(image, misfit, pair.stress(anchors), refinement.orientation(image, 60))
