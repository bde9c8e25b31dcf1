"""Shapes with holes matched as complete ones: caps close the holes, and what lands on a cap has no image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from isomatch.correspondence import Correspondence, Embedding, PrecisePoints
from isomatch.errors import NotConvergedError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.complete import CompleteMatch, complete_result, match_complete
from isomatch.matching.hints import Hints
from isomatch.matching.joint_refinement import joint_embedding
from isomatch.matching.pair import ShapePair
from isomatch.matching.parts.evidence import Evidence
from isomatch.matching.parts.part_fits import PartFit, PartFits
from isomatch.matching.parts.part_pair import PartPair
from isomatch.matching.parts.role import Part
from isomatch.matching.quality import contradicted_landmarks, covered_share
from isomatch.matching.result import Alternative, MatchResult
from isomatch.runtime.stage_timer import StageTimer
from isomatch.runtime.threads import parallel_map
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_property

GIVEN = {"matrix", "function"}  # names of engines of distances that were given


@dataclass(frozen=True, eq=False)
class ClosedMatch:
    """The match of two shapes whose holes are capped.

    Parameters
    ----------
    pair : ShapePair
        The shapes as they are.
    found : CompleteMatch
        The match of the capped ones.
    """

    pair: ShapePair
    found: CompleteMatch

    def image_of(self, part: Part) -> IntArray:
        """Vertex of the other shape for each vertex of a part: the nearest one that is on no cap."""
        of_source, of_target = self.found.embedding
        if part == "source":
            return _images(self.pair.source, of_source, self.pair.target, of_target)
        return _images(self.pair.target, of_target, self.pair.source, of_source)

    @cached_property
    def evidence(self) -> Evidence:
        """How sure the map is, as one of the source as it is to the target with its holes closed."""
        selection, config = self.found.selection, self.pair.config
        part, whole = self.pair.source, self.pair.target.capped
        pair = PartPair.of(part, whole, config)
        if config.scale != "area":  # the capped body was made from one of unit area
            pair = pair.with_unit(pair.unit / self.pair.target.scale)
        fits = PartFits(pair)

        def measured(embedding: Embedding) -> PartFit:
            image = whole.index.vertices(embedding.target, embedding.source[: part.body.n_vertices])
            return fits.measured(pair.in_unit_of(image), image[part.sample_vertices[: config.n_refine]])

        fit, rival = measured(self.found.embedding), np.inf
        if selection.against:
            smooth = config.refinement == "smooth"
            other = measured(joint_embedding(self.found.pair, selection.against, smooth))
            rival = max(1.0, other.bent_score / fit.bent_score)
        return Evidence(fit.bent_score, rival, pair.trusted, config.parts)

    def result(self, hints: Hints, timer: StageTimer, seed: int) -> MatchResult:
        """Sum up the map, in the users' vertices; what lands on a cap is unmatched."""
        closed = complete_result(self.found, timer, seed, may_stretch=False)
        points, matched = self._opened(closed.map)
        found = self.pair.source.correspondence(self.pair.target, points, matched)
        errors = closed.expected_error[: self.pair.source.body.n_vertices]
        images, radius = points.corners[matched, 0], self.pair.config.outcome.coverage_radius
        coverage = covered_share(self.pair.target.body, images, radius)
        alternatives = tuple(
            replace(each, extend=partial(self._opened_map, each)) for each in closed.alternatives
        )
        return replace(
            closed,
            map=found,
            expected_error=np.where(found.matched, self.pair.source.lift_smooth(errors), np.nan),
            alternatives=alternatives,
            quality=replace(closed.quality, matched=float(found.matched.mean()), coverage=coverage),
            notes=(
                *self.pair.notes,
                *hints.notes,
                *contradicted_landmarks(self.pair, points, hints),
                "stretch, residual and distortion are those of the shapes with their holes closed",
            ),
        )

    def _opened_map(self, alternative: Alternative) -> Correspondence:
        return self.pair.source.correspondence(self.pair.target, *self._opened(alternative.map))

    def _opened(self, closed: Correspondence) -> tuple[PrecisePoints, BoolArray]:
        """Take the caps off a map of the capped bodies: points on the target's body, and which of them are images."""
        n_target = self.pair.target.body.n_vertices
        rows = slice(self.pair.source.body.n_vertices)
        vertices, corners, weights = closed.vertices[rows], closed.faces[rows], closed.barycentric[rows]
        gap, owner = self._rim_of_target
        matched = gap[vertices] <= self.pair.config.parts.rim * np.sqrt(self.pair.target.body.area)
        points = PrecisePoints.at_vertices(owner[vertices])
        inside = (corners < n_target).all(axis=1)
        points.corners[inside], points.barycentric[inside] = corners[inside], weights[inside]
        return points, matched

    @cached_property
    def _rim_of_target(self) -> tuple[FloatArray, IntArray]:
        """Distance of each vertex of the capped target from the target, and its nearest vertex there."""
        target = self.pair.target
        return distance_along_edges_to_nearest(target.capped.body, np.arange(target.body.n_vertices))


def match_closed(pair: ShapePair, hints: Hints, timer: StageTimer) -> ClosedMatch | None:
    """Match two shapes with all their holes closed, by landmarks and the initial map; None if no map was found."""
    if {pair.source.distances.engine, pair.target.distances.engine} & GIVEN:
        return None  # distances across caps are not known
    source, target = parallel_map(lambda shape: shape.capped, (pair.source, pair.target))
    config = pair.config
    flipped = max(config.parts.flipped, config.search.flipped)
    nothing = np.zeros((source.body.n_vertices, 0)), np.zeros((target.body.n_vertices, 0))
    capped = ShapePair(source, target, replace(config, search=replace(config.search, flipped=flipped)))
    closed = Hints(hints.landmarks, hints.known, nothing, given=hints.given)
    try:
        return ClosedMatch(pair, match_complete(capped, closed, timer))
    except NotConvergedError:
        return None


def _images(part: PreparedShape, of_part: FloatArray, whole: PreparedShape, of_whole: FloatArray) -> IntArray:
    """Vertices (n_part,) of the body of a whole, by coordinates of the capped bodies of part and whole."""
    image = whole.capped.index.vertices(of_whole, of_part[: part.body.n_vertices])
    real = np.arange(whole.body.n_vertices)
    if len(real) < whole.capped.body.n_vertices:
        image = distance_along_edges_to_nearest(whole.capped.body, real)[1][image]
    return image
