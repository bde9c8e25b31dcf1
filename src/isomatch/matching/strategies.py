"""Solve a problem of connected shapes: try strategies, and return the best verified map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from operator import attrgetter, itemgetter
from typing import Any, Literal, TypeAlias, cast

import numpy as np

from isomatch._core.arrays import BodyVertices, UserVertices
from isomatch._core.errors import MeshError, NotConvergedError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.matching.assessment.evidence import Evidence, Solution, outcome_of
from isomatch.matching.elastic.elastic import Elastic, far_from_isometric
from isomatch.matching.isometric.both_sides import BothSides
from isomatch.matching.isometric.candidates import is_sure
from isomatch.matching.isometric.inverse import Inverse
from isomatch.matching.isometric.isometry import IsometricMatch, Isometry, find_torn_vertices, image_of
from isomatch.matching.maps import Candidate
from isomatch.matching.model import Match, MatchingModel, origin_of
from isomatch.matching.parameters import MAP_DISTANCE, SCREENING, STRATEGY
from isomatch.matching.partial.part import Part, PartSide
from isomatch.matching.partial.two_parts import TwoParts
from isomatch.matching.pipeline import finish, match_under, search_under
from isomatch.matching.priors import NO_FUNCTIONS
from isomatch.matching.problem import Problem, name_of
from isomatch.matching.result import Outcome
from isomatch.matching.verify import on_bodies, relative_cost, verifier_of
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

# Each strategy claims something about the shapes, says when it is tried, and finds a map of the shapes as
# they were given, with evidence. The first sure map ends the search. If several strategies found maps,
# `verify` selects one of them; evidence decides only between maps whose costs tie.

# names of the engines of distances that the user computed
USER_ENGINES = {"matrix", "function"}


@dataclass(eq=False)
class Attempts:
    """A problem, and the results of the strategies tried on it so far."""

    problem: Problem
    timer: StageTimer
    hypotheses: Sequence[Candidate] | None = None  # if given, they replace the search for an isometry
    inverse_of: IsometricMatch | None = None  # if given, its inverse is the map that is sought
    only: tuple[Strategy, ...] = ()  # strategies to try; by default all that suit the problem
    solutions: list[Solution] = field(default_factory=list)
    matches: dict[str, Match[Any, Any]] = field(default_factory=dict)  # by the name of the strategy
    failures: list[str] = field(default_factory=list)  # why strategies found no map
    # names of strategies whose maps are completed only if the match returns them
    incomplete: list[str] = field(default_factory=list)
    costs: dict[str, float] = field(default_factory=dict)  # by `verify`, by the name of the strategy

    def cost(self, solution: Solution) -> float:
        """Cost of a map by `verify`, computed once."""
        if solution.way not in self.costs:
            image = on_bodies(self.problem, UserVertices(solution.map.vertices))
            self.costs[solution.way] = verifier_of(self.problem)(image).cost
        return self.costs[solution.way]

    @property
    def is_unsure(self) -> bool:
        """Whether no map so far is sure."""
        return all(solution.outcome.is_doubtful for solution in self.solutions)

    @property
    def is_called_right(self) -> bool:
        """Whether a map so far is called right, and is not ambiguous either."""
        return any(solution.outcome.is_called_right for solution in self.solutions)


Overlap: TypeAlias = Literal["whole", "part", "parts"]
"""Whether both shapes are complete, one is a part of the other, or both are parts of one body."""


@dataclass(frozen=True)
class Strategy:
    """What is claimed of the shapes, when this is tried, and whether its map ends the search."""

    name: str
    overlap: Overlap
    why: str  # when the strategy is tried, in words
    # builds the model, perhaps of a variant of the shapes; None if there is no such variant
    model: Callable[[Attempts], MatchingModel[Any, Any] | None]
    # whether the shapes and the settings suit the strategy
    fits: Callable[[Problem], bool] = lambda problem: True
    # whether the results of other strategies call for this one
    applies: Callable[[Attempts], bool] = lambda tried: True
    # whether the solution of this strategy is good enough to end the search
    is_enough: Callable[[Attempts, Solution], bool] = lambda tried, solution: not solution.outcome.is_doubtful
    # whether the search goes on although the solution of this strategy is good enough
    continues: Callable[[Attempts], bool] = lambda tried: False
    most_models: int = 1  # models that are built one after the other, at most, while their maps get better
    is_guess: bool = False  # whether the map of this strategy is never taken as sure
    replaces: Strategy | None = None  # the strategy whose map this one improves and replaces


def part_of(problem: Problem) -> PartSide | Literal["both"] | None:
    """Say which shape is a part of the other; "both" if they are parts of one body."""
    # with part = "auto", a shape with a long boundary is a part; maps of parts must preserve the orientation
    config, shapes = problem.config, (problem.source, problem.target)
    searches_further = problem.refinement.searches_further and config.orientation == "preserve"
    if config.part == "none" or not (problem.oriented and searches_further) or problem.priors.has_functions:
        return None
    if config.part != "auto":
        return config.part
    of_source, of_target = (shape.longest_boundary > config.parts.long_boundary for shape in shapes)
    if of_source and of_target:
        return "both"
    return "source" if of_source else "target" if of_target else None


def has_own_distances(problem: Problem) -> bool:
    """Whether the user computed the distances of a shape."""
    return bool({problem.source.distances.engine, problem.target.distances.engine} & USER_ENGINES)


def handles_of(problem: Problem) -> tuple[int, int]:
    """Count the handles of both shapes, if they may come from self-contacts."""
    settings = problem.config.preparation
    is_searched = problem.refinement.searches_further and settings.self_contact_concavity
    is_excluded = problem.priors.has_functions or has_own_distances(problem)
    if is_excluded or not (problem.oriented and is_searched):
        return 0, 0
    handles = problem.source.handles, problem.target.handles
    return handles if max(handles) <= settings.most_self_contacts else (0, 0)


def surplus_of(problem: Problem) -> tuple[int, int]:
    """Count the handles that only the source, or only the target has."""
    of_source, of_target = handles_of(problem)
    return max(of_source - of_target, 0), max(of_target - of_source, 0)


def _isometry_of(
    problem: Problem, source: PreparedShape, target: PreparedShape, config: Config | None = None
) -> Isometry:
    """Make the isometric model of variants of both shapes."""
    config, priors = config or problem.config, replace(problem.priors, functions=NO_FUNCTIONS)
    return Isometry(replace(problem, source=source, target=target, config=config, priors=priors))


def _find_isometry(tried: Attempts) -> Isometry | None:
    """Search an isometry; the inverse of a known one is taken first, and kept unless it is doubtful."""
    before = tried.matches.get(ISOMETRIC.name)
    if before is None and tried.inverse_of is not None and tried.hypotheses is not None:
        return Inverse(tried.problem, tried.hypotheses, tried.inverse_of)
    if before is None or (isinstance(before.model, Inverse) and _is_doubtful(before)):
        return Isometry(tried.problem, tried.hypotheses)
    return None


def _is_doubtful(match: Match[Any, Any]) -> bool:
    """Whether the measures of a map make it doubtful."""
    return outcome_of([match.measured.evidence(match.model.pair, far=False)]).is_doubtful


def _cap_holes(tried: Attempts) -> Isometry:
    """Cap the holes of both shapes."""
    tried.timer.start("prepare")
    problem, search = tried.problem, tried.problem.config.search
    flipped = replace(search, flipped=max(STRATEGY.n_flipped, search.flipped))
    source, target = parallel_map(capped_shape, (problem.source, problem.target))
    return _isometry_of(problem, source, target, replace(problem.config, search=flipped))


def _cut_self_contacts(tried: Attempts, most: tuple[int, int]) -> Isometry | None:
    """Cut the shapes along at most ``most`` self-contacts, and cap them; None without any."""
    tried.timer.start("prepare")
    shapes = tried.problem.source, tried.problem.target
    variants = [cut_shape(shape, n) for shape, n in zip(shapes, most)]
    if not any(variants):
        return None
    source, target = (variant or capped_shape(shape) for variant, shape in zip(variants, shapes))
    return _isometry_of(tried.problem, source, target)


def _cut_creases(tried: Attempts) -> Isometry | None:
    """Cut the shape with more handles along its creases, or those that the map before tears."""
    # a crease may also be a natural fold: if the images of its two sides are close, it is no self-contact
    problem, before = tried.problem, tried.matches.get(CUT_CREASES.name)
    surplus, shapes = surplus_of(problem), (problem.source, problem.target)
    side = int(surplus[1] > surplus[0])
    loose = find_torn_vertices(before, side, STRATEGY.self_contact_distance) if before else None
    tried.timer.start("prepare")
    creased = creased_shape(shapes[side], surplus[side], loose)
    if creased is None:
        return None
    other = capped_shape(shapes[1 - side])
    return _isometry_of(problem, *((other, creased) if side else (creased, other)))


def _open_limbs(tried: Attempts) -> Part | None:
    """Take a source with more handles for a part, after its self-contacts and creases were cut open."""
    # Surface is missing where limbs touch, so a distance is at least the distance on the fused limbs, and at
    # most the distance on the separated ones. A target is not opened: as a part, it would leave much of the
    # source without image.
    tried.timer.start("prepare")
    opened = opened_shape(tried.problem.source, surplus_of(tried.problem)[0])
    return Part(replace(tried.problem, source=opened)) if opened else None


def _stretch_limbs(tried: Attempts) -> Elastic | None:
    """Let limbs stretch, starting from the best isometry; None if that is good enough."""
    elastic = Elastic(tried.problem, tried.matches[ISOMETRIC.name])
    tried.timer.start("bending")
    return None if elastic.is_needless else elastic


def _part_from_closed(tried: Attempts) -> Part:
    """Take one shape for a part, and start from the map with the holes capped."""
    match, side = tried.matches[CAPPED.name], cast(PartSide, part_of(tried.problem))
    return _part_from(tried.problem, side, match, image_of(match, side))


def _part_from_both_sides(tried: Attempts) -> Part | None:
    """Search the map with the holes capped from the other shape; None if that finds the same map."""
    problem, turned = tried.problem, tried.problem.turned
    side, turned_side = (cast(PartSide, part_of(x)) for x in (problem, turned))
    match = search_under(_cap_holes(Attempts(turned, tried.timer)), tried.timer)
    image, known = image_of(match, turned_side), image_of(tried.matches[CAPPED.name], side)
    whole = problem.target if side == "source" else problem.source
    is_same = whole.mean_distance(image, known) < MAP_DISTANCE.same_map
    return None if is_same else _part_from(problem, side, match, image)


def _part_from(problem: Problem, side: PartSide, match: Match[Any, Any], image: BodyVertices) -> Part:
    """Take one shape for a part, and start from an image of its vertices under a match."""
    return Part(problem, side, (image, origin_of(problem, match.ranking.best), match.ranking.runner_up))


def _may_be_searched_from_target(problem: Problem) -> bool:
    """Whether isometries may be searched from the target: no priors, no user's starts."""
    return problem.starts is None and problem.refinement.searches_further and problem.is_sided


def _is_unsure_isometry(tried: Attempts) -> bool:
    """Whether another isometry may be right, and no other strategy is sure."""
    match = tried.matches.get(ISOMETRIC.name)
    if match is None or tried.hypotheses is not None:
        return False
    others = (solution for solution in tried.solutions if solution.way != ISOMETRIC.name)
    nothing_else_is_sure = all(solution.outcome.is_doubtful for solution in others)
    return nothing_else_is_sure and not is_sure(cast(Isometry, match.model), match.ranking)


def _is_poor_of_two_parts(tried: Attempts) -> bool:
    """Whether an isometry of two parts of one body is poor, so that their common region comes first."""
    found = (solution for solution in tried.solutions if solution.way == ISOMETRIC.name)
    return part_of(tried.problem) == "both" and any("poor" in solution.flags for solution in found)


def _may_win(tried: Attempts, name: str) -> bool:
    """Whether the map of a strategy, once improved, may verify better than the maps of others."""
    tried.timer.start("quality")
    costs = {solution.way: tried.cost(solution) for solution in tried.solutions}
    cost = costs.pop(name, None)
    return cost is not None and not cost > STRATEGY.hopeless_cost_ratio * min(costs.values(), default=np.inf)


def _is_clear_part(tried: Attempts, solution: Solution) -> bool:
    """Whether a map of a part is good enough to be final."""
    bound = STRATEGY.final_doubt_fraction * tried.problem.config.parts.poor_doubt
    return solution.outcome is Outcome.PARTIAL and solution.quality.doubt <= bound


def _is_far(tried: Attempts) -> bool:
    """Whether no isometry fits well, so that an elastic map should be sought."""
    match = tried.matches.get(ISOMETRIC.name)
    return match is not None and far_from_isometric(tried.problem, match.measured.quality)


def _may_be_wrong_isometry(tried: Attempts) -> bool:
    """Whether an isometry may be wrong though it looks sure: limbs may be fused, or may stretch."""
    if max(handles_of(tried.problem)) > 0 or _is_far(tried):
        return True
    return _may_be_searched_from_target(tried.problem) and _is_unsure_isometry(tried)


# The arguments of each strategy are its name, its kind of overlap, the text on when it is tried, and then the
# functions `model`, `fits`, `applies`, `is_enough` of `Strategy`, in this order.
ISOMETRIC = Strategy(
    "isometry",
    "whole",
    "always, unless one shape is a part",
    _find_isometry,
    continues=_may_be_wrong_isometry,
    most_models=2,
)
BOTH_SIDES = Strategy(  # an isometry, improved by maps that are searched from the target
    "isometry from both sides",
    "whole",
    "if other isometries may be right, and nothing else is sure",
    lambda tried: BothSides(tried.matches[ISOMETRIC.name]),
    _may_be_searched_from_target,
    lambda tried: _is_unsure_isometry(tried) and not _is_poor_of_two_parts(tried),
    replaces=ISOMETRIC,
)
BOTH_SIDES_LAST = replace(
    BOTH_SIDES,
    why="for two parts, after them, if the isometry is poor and may still win",
    applies=lambda tried: (
        _is_unsure_isometry(tried) and _is_poor_of_two_parts(tried) and _may_win(tried, ISOMETRIC.name)
    ),
)

CUT_EXTRA_HANDLES = Strategy(  # an isometry, once one shape's surplus of handles is cut
    "self-contacts cut",
    "whole",
    "if nothing before is sure, as one shape has more handles",
    lambda tried: _cut_self_contacts(tried, surplus_of(tried.problem)),
    lambda problem: max(surplus_of(problem)) > 0,
)
CUT_ALL_HANDLES = Strategy(  # an isometry, once all handles of both shapes are cut
    "all self-contacts cut",
    "whole",
    "if nothing before is sure, as both shapes have handles",
    lambda tried: _cut_self_contacts(tried, handles_of(tried.problem)),
    lambda problem: min(handles_of(problem)) > 0,
)
CUT_CREASES = Strategy(  # an isometry, once the shape with more handles is cut along creases
    "creases cut",
    "whole",
    "if nothing is sure, as one shape has more handles",
    _cut_creases,
    CUT_EXTRA_HANDLES.fits,
    lambda tried: tried.is_unsure,
    most_models=STRATEGY.max_crease_cuts,
)
OPEN_LIMBS = Strategy(  # the source, with its limbs parted where they touch, as a part of the target
    "limbs apart",
    "part",
    "if nothing is sure, as the source has more handles",
    _open_limbs,
    lambda problem: surplus_of(problem)[0] > 0 and problem.config.orientation == "preserve",
    lambda tried: tried.is_unsure,
    is_guess=True,
)
ELASTIC = Strategy(  # a map that lets limbs stretch
    "elastic", "whole", "if no isometry fits", _stretch_limbs, attrgetter("allows_elastic"), _is_far
)
PART = Strategy(  # a map of a part to a whole
    "part",
    "part",
    "one shape is a part of the other: it has a long boundary, or the settings say so",
    lambda tried: Part(tried.problem, cast(PartSide, part_of(tried.problem))),
    applies=lambda tried: tried.is_unsure,
    is_enough=_is_clear_part,
)
CAPPED = Strategy(  # an isometry between shapes whose holes are closed by caps
    "holes closed",
    "whole",
    "a part with its holes capped, unless it is sure before",
    _cap_holes,
    lambda problem: problem.config.parts.close_holes and not has_own_distances(problem),
    is_enough=lambda tried, solution: False,
)
PART_FROM_CLOSED = Strategy(  # a map of a part, refined from the map that CAPPED found
    "part, from the holes closed",
    "part",
    "as a part, from the map with its holes capped",
    _part_from_closed,
    CAPPED.fits,
    lambda tried: CAPPED.name in tried.matches,
    lambda tried, solution: tried.is_called_right,
)
PART_FROM_BOTH_SIDES = Strategy(  # as PART_FROM_CLOSED, from a map of capped shapes searched from the target
    "part, from both sides",
    "part",
    "if nothing before is called right: with the holes capped, the map is searched from the other shape",
    _part_from_both_sides,
    lambda problem: CAPPED.fits(problem) and _may_be_searched_from_target(problem),
    lambda tried: CAPPED.name in tried.matches and not tried.is_called_right,
    lambda tried, solution: not tried.is_unsure,
)
OVERLAPPING = Strategy(  # a map between two parts that overlap
    "two parts",
    "parts",
    "if no isometry is sure, as both shapes have long boundaries",
    lambda tried: TwoParts(tried.problem),
)
VIA = Strategy("via", "parts", "wholes are given", lambda tried: None)  # `solve_via` finds its maps

# Strategies in the order in which they are tried: COMPLETE for two complete shapes, MUCH_MISSING for a part that
# lacks much of the whole, LITTLE_MISSING for a part that lacks little, TWO_PARTS for two parts that overlap.
# FROM_CLOSED, a piece of two of these, has the strategies that refine maps of shapes whose holes are closed.
COMPLETE = ISOMETRIC, CUT_EXTRA_HANDLES, CUT_ALL_HANDLES, CUT_CREASES, OPEN_LIMBS, ELASTIC, BOTH_SIDES
FROM_CLOSED = PART_FROM_CLOSED, PART_FROM_BOTH_SIDES
MUCH_MISSING = PART, CAPPED, CUT_EXTRA_HANDLES, CUT_ALL_HANDLES, CUT_CREASES, *FROM_CLOSED
LITTLE_MISSING = CAPPED, CUT_EXTRA_HANDLES, CUT_ALL_HANDLES, CUT_CREASES, *FROM_CLOSED, PART
TWO_PARTS = ISOMETRIC, BOTH_SIDES, OVERLAPPING, BOTH_SIDES_LAST
STRATEGIES = {strategy.name: strategy for strategy in (*TWO_PARTS, *MUCH_MISSING, *COMPLETE, VIA)}
"""What each strategy claims, by its name, which `MatchResult.way` records."""


def strategies_of(problem: Problem) -> tuple[Strategy, ...]:
    """Strategies for a problem, in the order in which they are tried."""
    side = part_of(problem)
    if side == "both":
        return TWO_PARTS
    if side is None:
        return COMPLETE
    little = max(handles_of(problem)) > 0 or Part(problem, side).little_is_missing
    return LITTLE_MISSING if little and problem.config.parts.close_holes else MUCH_MISSING


def select_strategies(problem: Problem) -> list[tuple[str, str]]:
    """List the strategies that a match would try, in order, until one is sure.

    Parameters
    ----------
    problem : Problem
        Two connected shapes with priors and settings.

    Returns
    -------
    list of (str, str)
        The name of each strategy, as in `MatchResult.way`, and when it is tried. A relation handed in is the only one.

    Notes
    -----
    If only one shape seems to be inside out, all are also tried with its faces turned over.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> from isomatch.matching import prepare_pair
    >>> problem = prepare_pair(*(animal.mesh for animal in example_pair()))
    >>> [name for name, when in select_strategies(problem)]
    ['isometry', 'elastic', 'isometry from both sides']
    """
    if problem.relation is not None:
        return [(name_of(problem.relation), "the relation was handed in")]
    return [(strategy.name, strategy.why) for strategy in strategies_of(problem) if strategy.fits(problem)]


def try_strategies(tried: Attempts) -> Solution:
    """Try one strategy after the other until one is sure; return the map that verifies best."""
    problem, timer = tried.problem, tried.timer
    if problem.relation is not None:
        return _match_by_relation(problem, timer)
    failure = None
    for strategy in tried.only or strategies_of(problem):
        if not (strategy.fits(problem) and strategy.applies(tried)):
            continue
        try:
            with _within(timer, strategy.name):
                solution = _attempt(strategy, tried)
        except (MeshError, NotConvergedError) as error:
            solution, reason = None, f"the way {strategy.name!r} found no map"
            if strategy is CAPPED:  # caps may make a shape that cannot be prepared
                reason = "with the holes closed no map was found"
            elif isinstance(error, MeshError):
                raise
            else:
                failure = error
            tried.failures.append(f"{reason}: {error}")
        if solution is not None:
            replaced = strategy.replaces and strategy.replaces.name
            tried.solutions = [before for before in tried.solutions if before.way != replaced]
            tried.solutions.append(replace(solution, pair=problem, way=strategy.name))
            if strategy.is_enough(tried, solution) and not strategy.continues(tried):
                break
    if not tried.solutions:
        raise failure or NotConvergedError("no way found a map; give three to five landmarks")
    solution = tried.solutions[0] if len(tried.solutions) == 1 else _select_verified(tried)
    if solution.way in tried.incomplete:
        match = tried.matches[solution.way]
        with _within(timer, solution.way):
            solution = match.model.complete(match, match.measured, solution, timer)
    return replace(solution, notes=(*solution.notes, *tried.failures))


def _within(timer: StageTimer, way: str) -> AbstractContextManager[None]:
    """Name the stages of a strategy after it; those of an isometry have no prefix."""
    return nullcontext() if way == ISOMETRIC.name else timer.within(way)


def _attempt(strategy: Strategy, tried: Attempts) -> Solution | None:
    """Match by a strategy; None if it makes no model of the problem."""
    match: Match[Any, Any] | None = None
    for _ in range(strategy.most_models):
        model = strategy.model(tried)
        if model is None:
            break
        other = search_under(model, tried.timer)
        if match and other.ranking.best.score > match.ranking.best.score:
            break
        tried.matches[strategy.name] = match = other
    if match is None:
        return None
    partial = strategy.overlap == "whole" and part_of(tried.problem) in ("source", "target")
    is_last = not (strategy.continues(tried) or tried.solutions)  # else the map that is selected is completed
    if not is_last:
        tried.incomplete.append(strategy.name)
    solution = finish(match, tried.timer, is_last)
    return solution.with_evidence(Evidence(poor=strategy.is_guess, partial=partial))


def _match_by_relation(problem: Problem, timer: StageTimer) -> Solution:
    """Match under the model that the user handed in."""
    model = problem.relation and problem.relation(problem)
    if not isinstance(model, MatchingModel):
        raise SettingError(
            f"relation = {name_of(problem.relation)} makes an object of type {type(model).__name__}; it should be a "
            "MatchingModel of the problem"
        )
    return replace(match_under(model, timer), way=model.way)


def _select_verified(tried: Attempts) -> Solution:
    """Select the map that verifies best, and the surest of ties; limit its lead."""
    tried.timer.start("quality")
    problem, solutions, target = tried.problem, tried.solutions, tried.problem.target
    images = [on_bodies(problem, UserVertices(solution.map.vertices)) for solution in solutions]
    costs = [tried.cost(solution) for solution in solutions]
    tied = [i for i, cost in enumerate(costs) if cost <= problem.config.outcome.tie * min(costs)]

    def rank(i: int) -> tuple[float, ...]:
        # Doubtful maps are ranked by their doubt before their cost, as only maps of parts have a doubt. Maps found with
        # the holes closed by caps are rough and come after these.
        outcome, doubt = solutions[i].outcome, np.nan_to_num(solutions[i].quality.doubt, nan=np.inf)
        return -outcome.sureness, float(doubt) if outcome.is_doubtful else 0.0, costs[i]

    best = min(tied, key=rank)

    def differs(i: int) -> bool:
        both = (images[i] >= 0) & (images[best] >= 0)
        distance = target.mean_distance(images[i][both], images[best][both]) if both.any() else np.inf
        return distance > MAP_DISTANCE.other_map

    second = min((cost for i, cost in enumerate(costs) if differs(i)), default=np.inf)
    lead = relative_cost(second, costs[best])
    cost_list = ", ".join(f"{cost:.2g} by {solution.way}" for cost, solution in zip(costs, solutions))
    # the lead is nan where no cost can be verified, and then taken as 1
    solution = solutions[best].with_lead(lead if lead > 1.0 else 1.0)
    is_doubtful = solution.outcome.is_doubtful
    if CAPPED.name in tried.matches and is_doubtful and _mirror_image_fits(tried, costs[best]):
        solution = solution.with_evidence(Evidence(mirrored=True))
    return replace(solution, reason=f"{solution.reason}; of several ways it verifies best (cost {cost_list})")


def _mirror_image_fits(tried: Attempts, cost: float) -> bool:
    """Whether the mirror image of the source verifies clearly better, for a part."""
    # of maps between capped shapes that reverse the orientation, the best is refined as a map of a part
    problem, capped = tried.problem, tried.matches[CAPPED.name]
    if problem.priors.any:
        return False
    model, side = cast(Isometry, capped.model), cast(PartSide, part_of(problem))
    reversing = model.begin(model.mirrored_candidates(capped.proposals.eligible)[: SCREENING.max_mirrored])
    best = min(model.refine(reversing), key=lambda fit: fit.score, default=None)
    if best is None:
        return False
    mirrored = replace(problem, source=mirror_image(problem.source))
    image = image_of(replace(capped, ranking=replace(capped.ranking, best=best)), side)
    solution = match_under(Part(mirrored, side, (image, best.origin, np.inf)), tried.timer)
    image = on_bodies(mirrored, UserVertices(solution.map.vertices))
    return verifier_of(mirrored)(image).cost < problem.config.outcome.mirror_image * cost


def side_to_turn(problem: Problem) -> Literal["source", "target"] | None:
    """Say which shape seems to be inside out; None unless exactly one does."""
    if problem.config.orientation == "any" or not problem.oriented:
        return None
    source, target = problem.source.seems_inside_out, problem.target.seems_inside_out
    return None if source == target else "source" if source else "target"


def solve(problem: Problem, timer: StageTimer) -> Solution:
    """Match two shapes; if one seems inside out, also with its faces turned over, and keep the better map."""
    side = side_to_turn(problem)
    if side is None:
        return try_strategies(Attempts(problem, timer))
    turned = replace(problem, **{side: turned_over(getattr(problem, side))})  # type: ignore[arg-type]
    found: list[tuple[float, str, Solution]] = []
    failures: list[str] = []
    for how, variant in (("as they are", problem), ("turned over", turned)):
        try:
            with timer.within(f"faces {how}"):
                solution = try_strategies(Attempts(variant, timer))
                image = on_bodies(variant, UserVertices(solution.map.vertices))
                cost = verifier_of(variant)(image).cost
            found.append((cost, how, solution))
        except NotConvergedError as error:
            failures.append(f"with the faces {how} no map was found: {error}")
    if not found:
        raise NotConvergedError(
            "no map keeps the orientation of the faces, as they are or turned over; give three to five landmarks"
        )
    _, how, solution = min(found, key=itemgetter(0))
    note = f"the {side} seems to be inside out; of both windings of its faces, the map verifies better with them {how}"
    return replace(solution, pair=problem, notes=(note, *failures, *solution.notes))
