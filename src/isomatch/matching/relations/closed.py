"""Closed: an isometry of shapes whose holes are capped; what lands on a cap has no image."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from isomatch.correspondence import Correspondence, Embedding, PrecisePoints, iterative_closest_points
from isomatch.errors import NotConvergedError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.confidence import DoubtfulRegion
from isomatch.matching.fit import Hypothesis
from isomatch.matching.pair import ShapePair
from isomatch.matching.priors import Priors
from isomatch.matching.quality import covered_share
from isomatch.matching.relations.isometry import MOST_MIRRORED, IsometricMatch, Isometry, Measured
from isomatch.matching.relations.part_pair import PartPair
from isomatch.matching.relations.part_registration import PartFit, PartFits
from isomatch.matching.result import Alternative
from isomatch.matching.search import PRIOR_STEPS
from isomatch.matching.stages import Stages
from isomatch.matching.starts import start_from_pairs
from isomatch.matching.verification import Evidence, PartDoubt, Solution
from isomatch.runtime.stage_timer import StageTimer
from isomatch.runtime.threads import parallel_map
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, capped_shape, crease_length, creased_shape, cut_shape
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_method, cached_property

FLIPPED = 6  # best hypotheses whose flips are tried: the best is more often wrong; mesh018–mesh014 with holes: 30 with 3
CREASED = 3  # times that a shape is cut along its creases, and matched; docs/lab/design_notes.md
HOPELESS = 1.3  # score over that of the best map, above which creases are no better cut once more
TORN = 0.1  # √area between the images of the two sides of a crease, from which it is a self-contact
OF_USERS = {"matrix", "function"}  # names of engines of the user's own distances


@dataclass(frozen=True, eq=False)
class ClosedMatch:
    """The match of two shapes whose holes are capped."""

    pair: ShapePair  # the shapes as they are
    priors: Priors  # those on the shapes as they are
    relation: Isometry  # of the capped ones
    isometric: IsometricMatch

    @property
    def origin(self) -> str:
        """Where the map came from."""
        return self.relation.origin_of(self.isometric.selection.winner)

    @property
    def score(self) -> float:
        """Cost of the map."""
        return self.isometric.selection.winner.score

    def image_of(self, side: str) -> IntArray:
        """Vertex of the other shape for each vertex of the source or the target: the nearest one that is on no cap."""
        return self._image(self.isometric.embedding, side)

    def mirrored_images(self, side: str) -> list[IntArray]:
        """Return the same by the best maps that reverse the orientation, which the match did not allow."""
        best = self.relation.turned(self.isometric.eligible)[:MOST_MIRRORED]
        fits = self.relation.refine_and_select(self.relation.begun(best))
        return [self._image(self.relation.everywhere(fit), side) for fit in fits]

    def _image(self, embedding: Embedding, side: str) -> IntArray:
        """Vertices (n_part,) of the other open body, by coordinates of the closed ones."""
        sides = zip((self.relation.source, self.relation.target), embedding)
        (part, of_part), (whole, of_whole) = sides if side == "source" else reversed([*sides])
        n_part = 1 + int(_origin(part).max())
        return np.asarray(_owners(whole)[1][whole.index.vertices(of_whole, of_part[:n_part])])

    @property
    def pairs(self) -> IntArray:
        """Vertices of both open bodies that correspond, (q, 2)."""
        n_source, n_target = self.pair.source.body.n_vertices, self.pair.target.body.n_vertices
        of_source, of_target = self.isometric.embedding
        image = self.relation.pair.target.index.vertices(of_target, of_source[:n_source])
        kept = np.flatnonzero(image < n_target)
        return np.column_stack([kept, image[kept]])

    def torn(self, side: int) -> BoolArray:
        """Which vertices of the open source or target have copies whose images are far apart, (n_body,)."""
        way = 1 if side == 0 else -1
        here, there = (self.relation.source, self.relation.target)[::way]
        at, to = self.isometric.embedding[::way]
        image = there.index.vertices(to, at)
        origin = _origin(here)
        n = 1 + int(origin.max())
        copies = np.arange(n, len(origin))
        copies = copies[origin[copies] >= 0]
        torn = np.zeros(n, dtype=bool)
        torn[origin[copies]] = there.distance(image[copies], image[origin[copies]]) > TORN
        return torn

    @cached_property
    def doubt(self) -> PartDoubt:
        """How sure the map is, as one of the source as it is to the target with its holes closed."""
        selection, config = self.isometric.selection, self.pair.config
        part, whole = self.pair.source, self.relation.pair.target
        pair = PartPair.of(part, whole, config)
        if config.scale != "area":  # the capped body was made from one of unit area
            pair = pair.with_unit(pair.unit / self.pair.target.scale)
        fits = PartFits(pair)

        def measured(embedding: Embedding) -> PartFit:
            image = whole.index.vertices(embedding.target, embedding.source[: part.body.n_vertices])
            return fits.measured(pair.in_unit_of(image), image[part.sample_vertices[: config.n_refine]])

        fit, runner_up = measured(self.isometric.embedding), np.inf
        if selection.against:
            other = measured(self.relation.refinement.everywhere(self.relation, selection.against))
            runner_up = max(1.0, other.cost / fit.cost)
        return PartDoubt(fit.bent_cost, runner_up, pair.trusted, config.parts)

    @cached_method
    def solution(self, timer: StageTimer) -> Solution:
        """Sum up the map, in the users' vertices; what lands on a cap is unmatched."""
        timer.start("quality")
        closed = self.relation.summed_up(self.isometric, self.isometric.measured, timer)
        points, matched = self._opened(closed.map)
        source, target, descriptor_distance = self.pair.source, self.pair.target, closed.descriptor_distance
        if descriptor_distance is not None:
            descriptor_distance = np.where(matched, descriptor_distance[: source.body.n_vertices], np.nan)
        radius = self.pair.config.outcome.coverage_radius
        coverage = covered_share(target.body, points.corners[matched, 0], radius)
        quality = replace(closed.quality, coverage=coverage)
        notes = [
            *self.relation.pair.notes,
            "stretch, residual and distortion are those of the shapes with their holes closed",
        ]
        measured = Measured(points, quality, descriptor_distance, closed.reason, closed.origin, matched)
        opened = measured.solution(
            self.pair,
            self.priors,
            closed.expected_error[: source.body.n_vertices],
            closed.evidence,
            notes,
            regions=self._opened_regions(closed.regions),
        )
        quality = replace(opened.quality, matched=float(opened.map.matched.mean()))
        others = [replace(a, extend=partial(self._opened_map, a)) for a in closed.alternatives]
        return replace(opened, quality=quality, alternatives=tuple(others))

    def _opened_map(self, alternative: Alternative) -> Correspondence:
        return self.pair.source.correspondence(self.pair.target, *self._opened(alternative.map))

    def _opened_regions(self, closed: tuple[DoubtfulRegion, ...]) -> list[DoubtfulRegion]:
        """Take the caps off regions of the capped bodies."""
        source, (_, owner) = self.pair.source, _owners(self.relation.pair.target)
        regions = []
        for region in closed:
            kept = region.vertices < source.body.n_vertices
            runner_up = None if region.runner_up is None else owner[region.runner_up[kept]]
            regions.append(replace(region, vertices=region.vertices[kept], runner_up=runner_up))
        return regions

    def _opened(self, closed: Correspondence) -> tuple[PrecisePoints, BoolArray]:
        """Take the caps off a map of the capped bodies: points on the target's body, and which of them are images."""
        rows = slice(self.pair.source.body.n_vertices)
        vertices, corners, weights = closed.vertices[rows], closed.faces[rows], closed.barycentric[rows]
        gap, owner = _owners(self.relation.pair.target)
        matched = gap[vertices] <= self.pair.config.parts.rim * np.sqrt(self.pair.target.body.area)
        points = PrecisePoints.at_vertices(owner[vertices])
        inside = (gap[corners] == 0).all(axis=1)
        points.corners[inside], points.barycentric[inside] = owner[corners[inside]], weights[inside]
        return points, matched


def has_own_distances(pair: ShapePair) -> bool:
    """Whether the distances of either shape are the user's own."""
    return bool({pair.source.distances.engine, pair.target.distances.engine} & OF_USERS)


def match_closed(pair: ShapePair, priors: Priors, stages: Stages, timer: StageTimer) -> ClosedMatch | None:
    """Match two shapes with all their holes closed, by landmarks and the initial map; None if no map was found."""
    if has_own_distances(pair):
        return None  # those across caps are not known
    timer.start("prepare")
    source, target = parallel_map(capped_shape, (pair.source, pair.target))
    flipped = max(FLIPPED, pair.config.search.flipped)
    config = replace(pair.config, search=replace(pair.config.search, flipped=flipped))
    return _match_between(source, target, config, pair, priors, stages, timer)


def match_cut(
    pair: ShapePair, priors: Priors, stages: Stages, timer: StageTimer, n_source: int, n_target: int
) -> ClosedMatch | None:
    """Match two shapes, cut along the paths of so many self-contacts; None without cut paths, or if no map was found."""
    timer.start("prepare")
    source, target = cut_shape(pair.source, n_source), cut_shape(pair.target, n_target)
    if source is None and target is None:
        return None
    source, target = source or capped_shape(pair.source), target or capped_shape(pair.target)
    return _match_between(source, target, pair.config, pair, priors, stages, timer)


def match_creased(
    pair: ShapePair,
    priors: Priors,
    stages: Stages,
    timer: StageTimer,
    handles: tuple[int, int],  # self-contacts of either shape that are cut besides
    score: float,  # of the best map so far
    both: bool = False,  # whether both shapes are cut along creases, or only that with self-contacts or longer ones
) -> Iterator[ClosedMatch]:
    """Match two shapes cut along creases, and again along those that the last map tears."""
    # natural folds are creases, too; where both sides of one have near images, it is no self-contact
    shapes = pair.source, pair.target
    torn: tuple[BoolArray | None, BoolArray | None] = None, None
    one = max(range(2), key=lambda i: (handles[i], crease_length(shapes[i])))
    last = None
    for _ in range(CREASED):
        timer.start("prepare")
        cut = [i for i in range(2) if both or i == one]
        creased = [creased_shape(shapes[i], handles[i], torn[i]) if i in cut else None for i in range(2)]
        if creased == [None, None]:
            return
        source, target = (
            made or cut_shape(shape, most) or capped_shape(shape)
            for made, shape, most in zip(creased, shapes, handles)
        )
        last = _match_between(source, target, pair.config, pair, priors, stages, timer, last)
        if last is None or last.score > HOPELESS * score:
            return
        yield last
        torn = last.torn(0), last.torn(1)


def _match_between(
    source: PreparedShape,
    target: PreparedShape,
    config: Config,
    pair: ShapePair,
    priors: Priors,
    stages: Stages,
    timer: StageTimer,
    before: ClosedMatch | None = None,
) -> ClosedMatch | None:
    """Match two closed shapes, made of those of a pair; from a match of shapes closed otherwise, if there is one."""
    nothing = np.zeros((source.body.n_vertices, 0)), np.zeros((target.body.n_vertices, 0))
    functions = pair.functions and Embedding(
        # on the surface with its holes closed: the values of the rim on caps
        *(values[_owners(capped)[1]] for capped, values in zip((source, target), pair.known))
    )
    closed = Priors(priors.landmarks, priors.initial_pairs, nothing, user_landmarks=priors.user_landmarks)
    both = ShapePair(source, target, config, functions)
    relation = Isometry().on(both, closed, stages)
    start = None
    if before is not None:
        first = start_from_pairs(both, before.pairs)
        alignment = iterative_closest_points(*both.search_points, first[None], PRIOR_STEPS)[0]
        start = [Hypothesis(alignment, before.origin), *relation.hypotheses()[0]]
    try:
        return ClosedMatch(pair, priors, relation, relation.match(timer, start))
    except NotConvergedError:
        return None


def with_doubt(
    closed: Solution, evidence: tuple[Evidence, ...], doubt: PartDoubt, note: str, with_priors: bool
) -> Solution:
    """Take the map with the holes closed, with the evidence for it as a map of a part."""
    closed = replace(closed, evidence=evidence, quality=replace(closed.quality, doubt=doubt.doubt))
    return replace(closed, notes=(*closed.notes, note, *doubt.notes(closed.outcome, with_priors)))


def _owners(closed: PreparedShape) -> tuple[FloatArray, IntArray]:
    """Distance of each vertex of a closed body from the open one, and the nearest vertex there."""
    origin = _origin(closed)
    real = np.flatnonzero(origin >= 0)
    if len(real) == len(origin):
        return np.zeros(len(origin)), origin
    gap, near = distance_along_edges_to_nearest(closed.body, real)
    return gap, origin[near]


def _origin(closed: PreparedShape) -> IntArray:
    assert closed.origin is not None  # made by `capped_shape` or `cut_shape`
    return closed.origin
