"""Solve a pair of connected shapes: ways in a table, tried until one is sure; the map that verifies best is taken."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias, cast

import numpy as np

from isomatch._core.arrays import UserVertices
from isomatch._core.cached import cached_property
from isomatch._core.errors import MeshError, NotConvergedError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.matching.assessment.evidence import Evidence, Solution, fits_badly
from isomatch.matching.elastic.elastic import FAR, FAR_KEPT, Elastic, far_from_isometric
from isomatch.matching.isometric.candidates import is_another
from isomatch.matching.isometric.isometry import MOST_MIRRORED, IsometricMatch, Isometry
from isomatch.matching.maps import Hypothesis
from isomatch.matching.partial.both_parts import BothParts
from isomatch.matching.partial.part import Part, PartSide
from isomatch.matching.pipeline import Stages
from isomatch.matching.problem import ShapePair, search_pairs
from isomatch.matching.proposals.priors import Priors
from isomatch.matching.result import Outcome
from isomatch.matching.verify import on_bodies, verifier_of
from isomatch.settings import Config
from isomatch.shapes import (
    PreparedShape,
    capped_shape,
    creased_shape,
    cut_shape,
    mirror_image,
    opened_shape,
    turned_over,
)

# A way is a row: what it claims of the shapes, and when it is tried. It returns a finished map of the shapes as they are,
# with its own evidence. The first sure one ends the search. Which map is returned is decided by `verify`, on the shapes
# as they are, whichever way found it; evidence says how sure it is, and compares only maps that tie.
SURE = Outcome.CONVERGED, Outcome.PARTIAL, Outcome.SYMMETRY_AMBIGUOUS  # nothing else is worth trying
OF_USERS = {"matrix", "function"}  # names of engines of the user's own distances
# best hypotheses whose flips are tried between capped shapes: of mesh018–mesh014 with holes the error is 30 with 3
FLIPPED = 6
CREASED = 3  # times that a shape is cut along its creases, and matched; docs/lab/design_notes.md
TORN = 0.1  # √area between the images of the two sides of a crease, from which it is a self-contact
NO_COST = 1e-12  # of a shape on its copy, so that a lead is finite
AGREES = 0.12  # √area: mean distance up to which maps of two ways are one; as between maps of a part
# share of the bound of the doubt, up to which the map of a part needs no other way; that of a mirror image had 0.94
LITTLE_DOUBT = 0.5


@dataclass(eq=False)
class Case:
    """A pair to be solved, and what its ways share."""

    pair: ShapePair
    priors: Priors
    stages: Stages
    timer: StageTimer
    hypotheses: Sequence[Hypothesis] | None = None  # of an isometry, in place of a search
    solutions: list[Solution] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)  # ways that found no map, and why

    @cached_property
    def side(self) -> PartSide | Literal["both"] | None:
        """Which shape is a part of the other, or whether both are parts of something that neither shows."""
        # a part has a long boundary; only refinements that look further, of maps that preserve the orientation, know of
        # parts
        config, (source, target) = self.pair.config, (self.pair.source, self.pair.target)
        searches_further = self.stages.refinement.searches_further and config.orientation == "preserve"
        if config.part == "none" or not (self.pair.oriented and searches_further) or self.has_functions:
            return None
        if config.part != "auto":
            return config.part
        of_source, of_target = (x.longest_boundary > config.parts.long_boundary for x in (source, target))
        if of_source and of_target:
            return "both"
        return "source" if of_source else "target" if of_target else None

    @property
    def has_functions(self) -> bool:
        """Whether descriptors were given, which only complete shapes have in common."""
        return bool(self.priors.functions[0].shape[1])

    @cached_property
    def part(self) -> Part:
        """The claim that one shape is a part of the other."""
        return Part(cast(PartSide, self.side)).on(self.pair, self.priors, self.stages)

    @cached_property
    def isometric(self) -> IsometricMatch:
        """The match of the shapes as they are, as complete ones."""
        return Isometry().on(self.pair, self.priors, self.stages).match(self.timer, self.hypotheses)

    @cached_property
    def closed(self) -> IsometricMatch | None:
        """The match of the shapes with their holes capped; None where distances across caps are not known, or no map."""
        if self.has_own_distances or not self.pair.config.parts.close:
            return None
        self.timer.start("prepare")
        search = self.pair.config.search
        config = replace(self.pair.config, search=replace(search, flipped=max(FLIPPED, search.flipped)))
        try:
            source, target = parallel_map(capped_shape, (self.pair.source, self.pair.target))
            return self.between(source, target, config)
        except (MeshError, NotConvergedError) as error:
            self.failed.append(f"with the holes closed no map was found: {error}")
            return None

    def cut(self, n_source: int, n_target: int) -> Solution | None:
        """Match the shapes cut along the paths of so many self-contacts, and capped; None without any such path."""
        self.timer.start("prepare")
        pair = self.pair
        source, target = cut_shape(pair.source, n_source), cut_shape(pair.target, n_target)
        if source is None and target is None:
            return None
        source, target = source or capped_shape(pair.source), target or capped_shape(pair.target)
        return self.summed_up(self.between(source, target, pair.config))

    def between(self, source: PreparedShape, target: PreparedShape, config: Config) -> IsometricMatch:
        """Match variants of both shapes as complete ones."""
        pair = replace(self.pair, source=source, target=target, config=config)
        nothing = np.zeros((source.body.n_vertices, 0)), np.zeros((target.body.n_vertices, 0))
        return Isometry().on(pair, replace(self.priors, functions=nothing), self.stages).match(self.timer)

    def summed_up(self, match: IsometricMatch) -> Solution:
        """Sum up a match of complete shapes, or of variants of them."""
        self.timer.start("quality")
        solution = match.relation.summed_up(match, match.measured, self.timer)
        return solution.with_evidence(Evidence(partial=self.side in ("source", "target")))

    @property
    def is_unsure(self) -> bool:
        """Whether no map so far is sure."""
        return all(solution.outcome not in SURE for solution in self.solutions)

    @cached_property
    def is_far(self) -> bool:
        """Whether no isometry fits well, so that an elastic map should be sought."""
        return far_from_isometric(self.isometric.relation, self.isometric.measured.quality)

    @property
    def has_own_distances(self) -> bool:
        """Whether the distances of either shape are the user's own."""
        return bool({self.pair.source.distances.engine, self.pair.target.distances.engine} & OF_USERS)

    @property
    def handles(self) -> tuple[int, int]:
        """Handles of both shapes; none where limbs cannot be fused, or nobody looks further."""
        pair, settings = self.pair, self.pair.config.preparation
        looks = pair.oriented and self.stages.refinement.searches_further and settings.self_contact_concavity
        if not looks or self.has_functions or self.has_own_distances:
            return 0, 0
        handles = pair.source.handles, pair.target.handles
        return handles if max(handles) <= settings.most_self_contacts else (0, 0)

    @property
    def surplus(self) -> tuple[int, int]:
        """Handles of either shape that the other does not have."""
        ours, theirs = self.handles
        return max(ours - theirs, 0), max(theirs - ours, 0)


Overlap: TypeAlias = Literal["whole", "part", "parts"]
"""Whether both shapes are complete, one is a part of the other, or both are parts of one body."""


@dataclass(frozen=True)
class Way:
    """A row of the table: what is claimed of the shapes, how it is tried, when, and whether its map ends the search."""

    name: str
    overlap: Overlap
    # makes a finished map of the shapes as they are, with the evidence for it
    solve: Callable[[Case], Solution | None]
    applies: Callable[[Case], bool] = lambda case: True
    is_enough: Callable[[Case, Solution], bool] = lambda case, solution: solution.outcome in SURE


def _elastic(case: Case) -> Solution | None:
    """Match elastically, from the best isometry and its candidates; gives the isometry if it wins and keeps lengths."""
    match, relation, pair, timer = case.isometric, case.isometric.relation, case.pair, case.timer
    others = [
        (search_pairs(pair, candidate.target_row), candidate.hypothesis.origin)
        for candidate in match.eligible
        if candidate.orientation > 0
    ]
    fits, measured = not fits_badly(match.measured.quality, pair.config.outcome), match.measured
    first = match.selection.winner
    rivals = [
        fit
        for fit in match.selection.runners_up
        if fit.side == first.side and is_another(relation, fit, first)
    ]
    elastic = Elastic(first, others, fits, rivals).on(pair, case.priors, case.stages)
    timer.start("bending")
    if elastic.is_needless:
        return None
    selection, reason = elastic.match(timer)
    if elastic.keeps_lengths(selection.winner):
        cost = selection.winner.score
        quality = replace(measured.quality, runner_up=selection.runner_up, bending_cost=cost)
        measured, note = replace(measured, quality=quality), FAR_KEPT
    else:
        timer.start("precision")
        measured, note = elastic.measure(selection, reason), FAR
    timer.start("quality")
    return relation.summed_up(match, measured, timer, note)


def _part_from_closed(case: Case) -> Solution | None:
    """Refine the map with the holes capped as one of a part, without a search of its own."""
    match = cast(IsometricMatch, case.closed)
    first = match.image_of(cast(PartSide, case.side)), match.relation.origin_of(match.selection.winner)
    return case.part.led_by(*first, match.selection.runner_up).solution(case.timer)


def _creases_cut(case: Case) -> Solution | None:
    """Cut what has more handles along its creases, too, and again along those that the last map tears; the best map."""
    # natural folds are creases, too; where both sides of one have near images, it is no self-contact
    side = int(case.surplus[1] > case.surplus[0])
    shapes: list[PreparedShape] = [capped_shape(case.pair.source), capped_shape(case.pair.target)]
    torn, best = None, None
    for _ in range(CREASED):
        case.timer.start("prepare")
        creased = creased_shape((case.pair.source, case.pair.target)[side], case.surplus[side], torn)
        if creased is None:
            break
        shapes[side] = creased
        match = case.between(shapes[0], shapes[1], case.pair.config)
        if best and match.selection.winner.score > best.selection.winner.score:
            break
        best, torn = match, match.torn(side, TORN)
    return case.summed_up(best) if best else None


def _limbs_apart(case: Case) -> Solution | None:
    """Match a source that has more handles with its self-contacts and creases open, as a part."""
    # What limbs hide where they touch is missing, and distances lie between those of fused limbs and of limbs apart. Of a
    # target that is a part much of the source would be left without images.
    case.timer.start("prepare")
    opened = opened_shape(case.pair.source, case.surplus[0])
    if opened is None:
        return None
    apart = Part("source").on(replace(case.pair, source=opened), case.priors, case.stages)
    return apart.solution(case.timer).with_evidence(Evidence(poor=True))  # never sure: much is guessed


def _is_clear(case: Case, solution: Solution) -> bool:
    """Whether the map of a part is far from doubtful."""
    bound = LITTLE_DOUBT * case.pair.config.parts.poor_doubt
    return solution.outcome is Outcome.PARTIAL and solution.quality.doubt <= bound


AS_IT_IS = Way(
    "isometry",
    "whole",
    lambda case: case.summed_up(case.isometric),
    # fused limbs make a handle, and may look right; so may an isometry of shapes that are none
    is_enough=lambda case, solution: solution.outcome in SURE and not max(case.handles) and not case.is_far,
)
# cut are the handles that only one shape has, or all of both, or its folds, too
SURPLUS_CUT = Way(
    "self-contacts cut", "whole", lambda case: case.cut(*case.surplus), lambda case: max(case.surplus) > 0
)
ALL_CUT = Way(
    "all self-contacts cut", "whole", lambda case: case.cut(*case.handles), lambda case: min(case.handles) > 0
)
CREASES_CUT = Way("creases cut", "whole", _creases_cut, lambda case: case.is_unsure and max(case.surplus) > 0)
LIMBS_APART = Way(
    "limbs apart",
    "part",
    _limbs_apart,
    lambda case: case.is_unsure and case.surplus[0] > 0 and case.pair.config.orientation == "preserve",
)
ELASTIC = Way("elastic", "whole", _elastic, lambda case: case.is_far)
PART = Way("part", "part", lambda case: case.part.solution(case.timer), is_enough=_is_clear)
CLOSED = Way(
    "holes closed",
    "whole",
    lambda case: case.summed_up(case.closed) if case.closed else None,
    is_enough=lambda case, solution: False,
)
PART_FROM_CLOSED = Way(
    "part, from the holes closed",
    "part",
    _part_from_closed,
    lambda case: case.closed is not None,
    lambda case, solution: not case.is_unsure,
)
OVERLAPPING = Way(
    "two parts",
    "parts",
    lambda case: BothParts().on(case.pair, case.priors, case.stages).solution(case.timer),
)
VIA = Way("via", "parts", lambda case: None)  # of shapes in between that were given, see `solve_via`

# in the order in which they are tried
COMPLETE = AS_IT_IS, SURPLUS_CUT, ALL_CUT, CREASES_CUT, LIMBS_APART, ELASTIC
MUCH_MISSING = PART, CLOSED, SURPLUS_CUT, ALL_CUT, CREASES_CUT, PART_FROM_CLOSED
LITTLE_MISSING = CLOSED, SURPLUS_CUT, ALL_CUT, CREASES_CUT, PART_FROM_CLOSED, PART
TWO_PARTS = AS_IT_IS, OVERLAPPING
WAYS = {way.name: way for way in (*COMPLETE, *MUCH_MISSING, *TWO_PARTS, VIA)}
"""What each way claims, by its name, which `MatchResult.way` records."""


def ways_of(case: Case) -> tuple[Way, ...]:
    """Give the ways for a pair, in the order in which they are tried."""
    if case.side == "both":
        return TWO_PARTS
    if case.side is None:
        return COMPLETE
    little = max(case.handles) > 0 or case.part.little_is_missing
    return LITTLE_MISSING if little and case.pair.config.parts.close else MUCH_MISSING


def solved(case: Case) -> Solution:
    """Try one way after the other until one is sure; the map that verifies best is taken."""
    relation, problem = case.stages.relation, None
    if relation is not None:
        found = relation.on(case.pair, case.priors, case.stages).solution(case.timer)
        return replace(found, way=relation.way)
    for way in ways_of(case):
        try:
            with nullcontext() if way is AS_IT_IS else case.timer.within(way.name):
                solution = way.solve(case) if way.applies(case) else None
        except NotConvergedError as error:
            solution, problem = None, error
            case.failed.append(f"the way {way.name!r} found no map: {error}")
        if solution is not None:
            case.solutions.append(replace(solution, pair=case.pair, way=way.name))
            if way.is_enough(case, solution):
                break
    if not case.solutions:
        raise problem or NotConvergedError("no way found a map; give three to five landmarks")
    solution = case.solutions[0] if len(case.solutions) == 1 else _verified_best(case)
    return replace(solution, notes=(*solution.notes, *case.failed))


def _verified_best(case: Case) -> Solution:
    """Take the map that verifies best, of those that tie the surest; it is no surer than its lead lets it be."""
    case.timer.start("quality")
    solutions, target = case.solutions, case.pair.target
    images = [on_bodies(case.pair, UserVertices(solution.map.vertices)) for solution in solutions]
    costs = [verifier_of(case.pair)(image).cost for image in images]
    tied = [i for i, cost in enumerate(costs) if cost <= case.pair.config.outcome.tie * min(costs)]

    def rank(i: int) -> tuple[float, ...]:
        # where none is sure, the map of a part in least doubt, for caps leave maps rough
        outcome, doubt = solutions[i].outcome, np.nan_to_num(solutions[i].quality.doubt, nan=np.inf)
        return -outcome.sureness, 0.0 if outcome in SURE else float(doubt), costs[i]

    best = min(tied, key=rank)

    def differs(i: int) -> bool:
        both = (images[i] >= 0) & (images[best] >= 0)
        return not both.any() or target.mean_distance(images[i][both], images[best][both]) > AGREES

    second = min((cost for i, cost in enumerate(costs) if differs(i)), default=np.inf)
    lead = second / max(costs[best], NO_COST)
    told = ", ".join(f"{cost:.2g} by {solution.way}" for cost, solution in zip(costs, solutions))
    solution = solutions[best].led(lead if lead > 1.0 else 1.0)  # 1 also where nothing can be verified
    if solution.outcome not in SURE and _mirror_image_fits(case, costs[best]):
        solution = solution.with_evidence(Evidence(mirrored=True))
    return replace(solution, reason=f"{solution.reason}; of several ways it verifies best (cost {told})")


def _mirror_image_fits(case: Case, cost: float) -> bool:
    """Whether the mirror image of the source verifies clearly better, where one shape is a part of the other."""
    # by the best map between capped shapes that reverses the orientation, refined as one of a part
    match, side = case.closed if case.side in ("source", "target") else None, cast(PartSide, case.side)
    if match is None or case.priors.any:
        return False
    relation, pair = match.relation, replace(case.pair, source=mirror_image(case.pair.source))
    turned = relation.begun(relation.turned(match.eligible)[:MOST_MIRRORED])
    best = min(relation.refine_and_select(turned), key=lambda fit: fit.score, default=None)
    if best is None:
        return False
    image = replace(match, embedding=relation.everywhere(best)).image_of(side)
    part = Part(side).on(pair, case.priors, case.stages).led_by(image, best.origin, np.inf)
    mirrored = on_bodies(pair, UserVertices(part.solution(case.timer).map.vertices))
    return verifier_of(pair)(mirrored).cost < case.pair.config.outcome.mirror_image * cost


def side_to_turn(pair: ShapePair) -> Literal["source", "target"] | None:
    """Name the shape that seems to be inside out, if only one of them does; two that do agree with each other."""
    if pair.config.orientation == "any" or not pair.oriented:
        return None
    source, target = pair.source.seems_inside_out, pair.target.seems_inside_out
    return None if source == target else "source" if source else "target"


def solve(pair: ShapePair, priors: Priors, stages: Stages, timer: StageTimer) -> Solution:
    """Match the bodies of two shapes; one that seems to be inside out also turned over, and the better map is taken."""
    side = side_to_turn(pair)
    if side is None:
        return solved(Case(pair, priors, stages, timer))
    turned = replace(pair, **{side: turned_over(getattr(pair, side))})  # type: ignore[arg-type]
    contending: list[tuple[float, str, Solution]] = []
    failed: list[str] = []
    for how, wound in (("as they are", pair), ("turned over", turned)):
        try:
            with timer.within(f"faces {how}"):
                solution = solved(Case(wound, priors, stages, timer))
                image = on_bodies(wound, UserVertices(solution.map.vertices))
                cost = verifier_of(wound)(image).cost
            contending.append((cost, how, solution))
        except NotConvergedError as error:
            failed.append(f"with the faces {how} no map was found: {error}")
    if not contending:
        raise NotConvergedError(
            "no map keeps the orientation of the faces, as they are or turned over; give three to five landmarks"
        )
    _, how, solution = min(contending, key=lambda each: each[0])
    note = f"the {side} seems to be inside out; of both windings of its faces, the map verifies better with them {how}"
    return replace(solution, pair=pair, notes=(note, *failed, *solution.notes))
