"""Solve a problem of connected shapes: strategies in a table, tried until one is sure; the best verified map is taken."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias, cast

import numpy as np

from isomatch._core.arrays import UserVertices
from isomatch._core.errors import MeshError, NotConvergedError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.matching.assessment.evidence import Evidence, Solution
from isomatch.matching.elastic.elastic import Elastic, far_from_isometric, may_be_far
from isomatch.matching.isometric.both_sides import BothSides
from isomatch.matching.isometric.candidates import is_sure
from isomatch.matching.isometric.isometry import IsometricMatch, Isometry, image_of, torn
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

# A strategy is a row: what it claims of the shapes, and when it is tried. It returns a finished map of the shapes as they
# are, with its own evidence. The first sure one ends the search. Which map is returned is decided by `verify`, on the
# shapes as they are, whichever strategy found it; evidence says how sure it is, and compares only maps that tie.
SURE = Outcome.CONVERGED, Outcome.PARTIAL, Outcome.SYMMETRY_AMBIGUOUS  # nothing else is worth trying
OF_USERS = {"matrix", "function"}  # names of engines of the user's own distances


@dataclass(eq=False)
class Attempts:
    """What was found of one problem so far; results only."""

    hypotheses: Sequence[Candidate] | None = None  # of an isometry, in place of a search
    solutions: list[Solution] = field(default_factory=list)
    matches: dict[str, Match[Any, Any]] = field(default_factory=dict)  # by the name of the strategy
    failures: list[str] = field(default_factory=list)  # strategies that found no map, and why
    incomplete: list[str] = field(default_factory=list)  # strategies whose map is completed if it is returned
    only: tuple[Strategy, ...] = ()  # strategies that are tried; by default all of the problem

    @property
    def is_unsure(self) -> bool:
        """Whether no map so far is sure."""
        return all(solution.outcome not in SURE for solution in self.solutions)


Overlap: TypeAlias = Literal["whole", "part", "parts"]
"""Whether both shapes are complete, one is a part of the other, or both are parts of one body."""


@dataclass(frozen=True)
class Strategy:
    """A row of the table: what is claimed of the shapes, how it is tried, when, and whether its map ends the search."""

    name: str
    overlap: Overlap
    why: str  # when it is tried, in words
    # builds the model of a variant of the shapes; None if there is no such variant
    model: Callable[[Problem, Attempts, StageTimer], MatchingModel[Any, Any] | None]
    fits: Callable[[Problem], bool] = lambda problem: True  # by the shapes and the settings alone
    applies: Callable[[Problem, Attempts], bool] = lambda problem, attempts: True  # by what was found
    is_enough: Callable[[Problem, Attempts, Solution], bool] = lambda problem, attempts, solution: (
        solution.outcome in SURE
    )
    # by its match: whether another strategy is tried, however sure its map is
    goes_on: Callable[[Problem, Attempts], bool] = lambda problem, attempts: False
    # builds the model of a further variant from what was found; the better map stays
    again: Callable[[Problem, Match[Any, Any], StageTimer], MatchingModel[Any, Any] | None] | None = None
    is_guess: bool = False  # whether its map is never sure
    replaces: Strategy | None = None  # whose map it begins with; that is no more one of several


def part_of(problem: Problem) -> PartSide | Literal["both"] | None:
    """Tell which shape is a part of the other, or whether both are parts of something that neither shows."""
    # a part has a long boundary; only refinements that look further, of maps that preserve the orientation, know of parts
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
    """Whether the distances of either shape are the user's own."""
    return bool({problem.source.distances.engine, problem.target.distances.engine} & OF_USERS)


def handles_of(problem: Problem) -> tuple[int, int]:
    """Count the handles of both shapes; none where limbs cannot be fused, or nobody looks further."""
    settings = problem.config.preparation
    looks = problem.oriented and problem.refinement.searches_further and settings.self_contact_concavity
    if not looks or problem.priors.has_functions or has_own_distances(problem):
        return 0, 0
    handles = problem.source.handles, problem.target.handles
    return handles if max(handles) <= settings.most_self_contacts else (0, 0)


def surplus_of(problem: Problem) -> tuple[int, int]:
    """Count the handles of either shape that the other does not have."""
    ours, theirs = handles_of(problem)
    return max(ours - theirs, 0), max(theirs - ours, 0)


def _of_variants(
    problem: Problem, source: PreparedShape, target: PreparedShape, config: Config | None = None
) -> Isometry:
    """Claim that variants of both shapes are complete."""
    config, priors = config or problem.config, replace(problem.priors, functions=NO_FUNCTIONS)
    return Isometry(replace(problem, source=source, target=target, config=config, priors=priors))


def _closed(problem: Problem, timer: StageTimer) -> Isometry:
    """Cap the holes of both shapes."""
    timer.start("prepare")
    search = problem.config.search
    flipped = replace(search, flipped=max(STRATEGY.n_flipped, search.flipped))
    source, target = parallel_map(capped_shape, (problem.source, problem.target))
    return _of_variants(problem, source, target, replace(problem.config, search=flipped))


def _cut(problem: Problem, most: tuple[int, int], timer: StageTimer) -> Isometry | None:
    """Cut the shapes along the paths of so many self-contacts, and cap them; None without any such path."""
    timer.start("prepare")
    shapes = problem.source, problem.target
    variants = [cut_shape(shape, n) for shape, n in zip(shapes, most)]
    if not any(variants):
        return None
    source, target = (variant or capped_shape(shape) for variant, shape in zip(variants, shapes))
    return _of_variants(problem, source, target)


def _creased(problem: Problem, before: IsometricMatch | None, timer: StageTimer) -> Isometry | None:
    """Cut what has more handles along its creases, too, or along those that the map before tears."""
    # natural folds are creases, too; where both sides of one have near images, it is no self-contact
    surplus, shapes = surplus_of(problem), (problem.source, problem.target)
    side = int(surplus[1] > surplus[0])
    loose = torn(before, side, STRATEGY.self_contact_distance) if before else None
    timer.start("prepare")
    creased = creased_shape(shapes[side], surplus[side], loose)
    if creased is None:
        return None
    other = capped_shape(shapes[1 - side])
    return _of_variants(problem, *((other, creased) if side else (creased, other)))


def _limbs_apart(problem: Problem, timer: StageTimer) -> Part | None:
    """Claim that a source that has more handles is a part, its self-contacts and creases open."""
    # What limbs hide where they touch is missing, and distances lie between those of fused limbs and of limbs apart. Of a
    # target that is a part much of the source would be left without images.
    timer.start("prepare")
    opened = opened_shape(problem.source, surplus_of(problem)[0])
    return Part(replace(problem, source=opened)) if opened else None


def _elastic(problem: Problem, attempts: Attempts, timer: StageTimer) -> Elastic | None:
    """Let limbs stretch, from the best isometry and its candidates; None if that fits and hardly stretches."""
    elastic = Elastic(problem, attempts.matches[AS_IT_IS.name])
    timer.start("bending")
    return None if elastic.is_needless else elastic


def _part_from_closed(problem: Problem, attempts: Attempts) -> Part:
    """Claim a part that is led by the map with the holes capped, without a search of its own."""
    match, side = attempts.matches[CLOSED.name], cast(PartSide, part_of(problem))
    origin = origin_of(problem, match.ranking.best)
    return Part(problem, side, (image_of(match, side), origin, match.ranking.runner_up))


def _may_be_searched_from_target(problem: Problem) -> bool:
    """Whether the isometry was searched without priors and starts, by a refinement that looks further."""
    alone = problem.starts is None and problem.refinement.searches_further
    return alone and problem.is_sided


def _is_unsure_isometry(problem: Problem, attempts: Attempts) -> bool:
    """Whether other isometries may be right, and no other strategy is sure."""
    match = attempts.matches.get(AS_IT_IS.name)
    if (
        match is None
        or attempts.hypotheses is not None
        or not (len(attempts.solutions) == 1 or attempts.is_unsure)
    ):
        return False
    return not is_sure(cast(Isometry, match.model), match.ranking)


def _is_clear(problem: Problem, solution: Solution) -> bool:
    """Whether the map of a part is far from doubtful."""
    bound = STRATEGY.final_doubt_fraction * problem.config.parts.poor_doubt
    return solution.outcome is Outcome.PARTIAL and solution.quality.doubt <= bound


def _is_far(problem: Problem, attempts: Attempts) -> bool:
    """Whether no isometry fits well, so that an elastic map should be sought."""
    match = attempts.matches.get(AS_IT_IS.name)
    return match is not None and far_from_isometric(problem, match.measured.quality)


AS_IT_IS = Strategy(
    "isometry",
    "whole",
    "always, unless one shape is a part",
    lambda problem, attempts, timer: Isometry(problem, attempts.hypotheses),
    # fused limbs make a handle, and may look right; so may an isometry of shapes that are none
    goes_on=lambda problem, attempts: (
        max(handles_of(problem)) > 0
        or _is_far(problem, attempts)
        or (_may_be_searched_from_target(problem) and _is_unsure_isometry(problem, attempts))
    ),
)
BOTH_SIDES = Strategy(
    "isometry from both sides",
    "whole",
    "if other isometries may be right, and nothing else is sure",
    lambda problem, attempts, timer: BothSides(attempts.matches[AS_IT_IS.name]),
    _may_be_searched_from_target,
    _is_unsure_isometry,
    replaces=AS_IT_IS,
)
# cut are the handles that only one shape has, or all of both, or its folds, too
SURPLUS_CUT = Strategy(
    "self-contacts cut",
    "whole",
    "if nothing before is sure, as one shape has more handles",
    lambda problem, attempts, timer: _cut(problem, surplus_of(problem), timer),
    lambda problem: max(surplus_of(problem)) > 0,
)
ALL_CUT = Strategy(
    "all self-contacts cut",
    "whole",
    "if nothing before is sure, as both shapes have handles",
    lambda problem, attempts, timer: _cut(problem, handles_of(problem), timer),
    lambda problem: min(handles_of(problem)) > 0,
)
CREASES_CUT = Strategy(
    "creases cut",
    "whole",
    "if nothing is sure, as one shape has more handles",
    lambda problem, attempts, timer: _creased(problem, None, timer),
    lambda problem: max(surplus_of(problem)) > 0,
    lambda problem, attempts: attempts.is_unsure,
    again=_creased,
)
LIMBS_APART = Strategy(
    "limbs apart",
    "part",
    "if nothing is sure, as the source has more handles",
    lambda problem, attempts, timer: _limbs_apart(problem, timer),
    lambda problem: surplus_of(problem)[0] > 0 and problem.config.orientation == "preserve",
    lambda problem, attempts: attempts.is_unsure,
    is_guess=True,
)
ELASTIC = Strategy("elastic", "whole", "if no isometry fits", _elastic, may_be_far, _is_far)
PART = Strategy(
    "part",
    "part",
    "one shape is a part of the other: it has a long boundary, or the settings say so",
    lambda problem, attempts, timer: Part(problem, cast(PartSide, part_of(problem))),
    is_enough=lambda problem, attempts, solution: _is_clear(problem, solution),
)
CLOSED = Strategy(
    "holes closed",
    "whole",
    "a part with its holes capped, unless it is sure before",
    lambda problem, attempts, timer: _closed(problem, timer),
    lambda problem: problem.config.parts.close and not has_own_distances(problem),
    is_enough=lambda problem, attempts, solution: False,
)
PART_FROM_CLOSED = Strategy(
    "part, from the holes closed",
    "part",
    "as a part, from the map with its holes capped",
    lambda problem, attempts, timer: _part_from_closed(problem, attempts),
    CLOSED.fits,
    lambda problem, attempts: CLOSED.name in attempts.matches,
    lambda problem, attempts, solution: not attempts.is_unsure,
)
OVERLAPPING = Strategy(
    "two parts",
    "parts",
    "if no isometry is sure, as both shapes have long boundaries",
    lambda problem, attempts, timer: TwoParts(problem),
)
VIA = Strategy("via", "parts", "wholes are given", lambda *_: None)  # see `solve_via`

# in the order in which they are tried
COMPLETE = AS_IT_IS, SURPLUS_CUT, ALL_CUT, CREASES_CUT, LIMBS_APART, ELASTIC, BOTH_SIDES
MUCH_MISSING = PART, CLOSED, SURPLUS_CUT, ALL_CUT, CREASES_CUT, PART_FROM_CLOSED
LITTLE_MISSING = CLOSED, SURPLUS_CUT, ALL_CUT, CREASES_CUT, PART_FROM_CLOSED, PART
TWO_PARTS = AS_IT_IS, OVERLAPPING, BOTH_SIDES
STRATEGIES = {strategy.name: strategy for strategy in (*COMPLETE, *MUCH_MISSING, *TWO_PARTS, VIA)}
"""What each strategy claims, by its name, which `MatchResult.way` records."""


def strategies_of(problem: Problem) -> tuple[Strategy, ...]:
    """Give the strategies for a problem, in the order in which they are tried."""
    side = part_of(problem)
    if side == "both":
        return TWO_PARTS
    if side is None:
        return COMPLETE
    little = max(handles_of(problem)) > 0 or Part(problem, side).little_is_missing
    return LITTLE_MISSING if little and problem.config.parts.close else MUCH_MISSING


def select_strategies(problem: Problem) -> list[tuple[str, str]]:
    """Tell without matching which strategies would be tried, in order until one is sure, and when or why each is.

    Parameters
    ----------
    problem : Problem
        Two connected shapes, and what is asked of their map.

    Returns
    -------
    list of (str, str)
        The name of each strategy, as in `MatchResult.way`, and when it is tried. A relation handed in is the only one.

    Notes
    -----
    Where one shape alone seems to be inside out, all are tried with its faces turned over, too.

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


def try_strategies(problem: Problem, attempts: Attempts, timer: StageTimer) -> Solution:
    """Try one strategy after the other until one is sure; the map that verifies best is taken."""
    if problem.relation is not None:
        return _of_relation(problem, timer)
    failure = None
    for strategy in attempts.only or strategies_of(problem):
        if not (strategy.fits(problem) and strategy.applies(problem, attempts)):
            continue
        try:
            with nullcontext() if strategy is AS_IT_IS else timer.within(strategy.name):
                solution = _attempt(strategy, problem, attempts, timer)
        except (MeshError, NotConvergedError) as error:
            solution, said = None, f"the way {strategy.name!r} found no map"
            if strategy is CLOSED:  # caps may be no surface
                said = "with the holes closed no map was found"
            elif isinstance(error, MeshError):
                raise
            else:
                failure = error
            attempts.failures.append(f"{said}: {error}")
        if solution is not None:
            replaced = strategy.replaces and strategy.replaces.name
            attempts.solutions = [before for before in attempts.solutions if before.way != replaced]
            attempts.solutions.append(replace(solution, pair=problem, way=strategy.name))
            if strategy.is_enough(problem, attempts, solution) and not strategy.goes_on(problem, attempts):
                break
    if not attempts.solutions:
        raise failure or NotConvergedError("no way found a map; give three to five landmarks")
    alone = len(attempts.solutions) == 1
    solution = attempts.solutions[0] if alone else _verified_best(problem, attempts, timer)
    if solution.way in attempts.incomplete:
        match = attempts.matches[solution.way]
        solution = match.model.complete(match, solution, timer)
    return replace(solution, notes=(*solution.notes, *attempts.failures))


def _attempt(strategy: Strategy, problem: Problem, attempts: Attempts, timer: StageTimer) -> Solution | None:
    """Match under the model of a strategy; None if there is none."""
    model = strategy.model(problem, attempts, timer)
    if model is None:
        return None
    match = search_under(model, timer)
    for _ in range(STRATEGY.max_crease_cuts - 1 if strategy.again else 0):
        model = strategy.again and strategy.again(problem, match, timer)
        if model is None:
            break
        other = search_under(model, timer)
        if other.ranking.best.score > match.ranking.best.score:
            break
        match = other
    attempts.matches[strategy.name] = match
    partial = strategy.overlap == "whole" and part_of(problem) in ("source", "target")
    is_last = not strategy.goes_on(problem, attempts)
    if not is_last:
        attempts.incomplete.append(strategy.name)
    return finish(match, timer, is_last).with_evidence(Evidence(poor=strategy.is_guess, partial=partial))


def _of_relation(problem: Problem, timer: StageTimer) -> Solution:
    """Match by the model that was handed in."""
    model = problem.relation and problem.relation(problem)
    if not isinstance(model, MatchingModel):
        raise SettingError(
            f"relation = {name_of(problem.relation)} makes an object of type {type(model).__name__}; it should be a "
            "MatchingModel of the problem"
        )
    return replace(match_under(model, timer), way=model.way)


def _verified_best(problem: Problem, attempts: Attempts, timer: StageTimer) -> Solution:
    """Take the map that verifies best, of those that tie the surest; it is no surer than its lead lets it be."""
    timer.start("quality")
    solutions, target = attempts.solutions, problem.target
    images = [on_bodies(problem, UserVertices(solution.map.vertices)) for solution in solutions]
    costs = [verifier_of(problem)(image).cost for image in images]
    tied = [i for i, cost in enumerate(costs) if cost <= problem.config.outcome.tie * min(costs)]

    def rank(i: int) -> tuple[float, ...]:
        # where none is sure, the map of a part in least doubt, for caps leave maps rough
        outcome, doubt = solutions[i].outcome, np.nan_to_num(solutions[i].quality.doubt, nan=np.inf)
        return -outcome.sureness, 0.0 if outcome in SURE else float(doubt), costs[i]

    best = min(tied, key=rank)

    def differs(i: int) -> bool:
        both = (images[i] >= 0) & (images[best] >= 0)
        return (
            not both.any()
            or target.mean_distance(images[i][both], images[best][both]) > MAP_DISTANCE.other_map
        )

    second = min((cost for i, cost in enumerate(costs) if differs(i)), default=np.inf)
    lead = relative_cost(second, costs[best])
    told = ", ".join(f"{cost:.2g} by {solution.way}" for cost, solution in zip(costs, solutions))
    solution = solutions[best].led(lead if lead > 1.0 else 1.0)  # 1 also where nothing can be verified
    closed = attempts.matches.get(CLOSED.name)
    if solution.outcome not in SURE and closed and _mirror_image_fits(problem, closed, costs[best], timer):
        solution = solution.with_evidence(Evidence(mirrored=True))
    return replace(solution, reason=f"{solution.reason}; of several ways it verifies best (cost {told})")


def _mirror_image_fits(problem: Problem, closed: IsometricMatch, cost: float, timer: StageTimer) -> bool:
    """Whether the mirror image of the source verifies clearly better, where one shape is a part of the other."""
    # by the best map between capped shapes that reverses the orientation, refined as one of a part
    if problem.priors.any:
        return False
    model, side = cast(Isometry, closed.model), cast(PartSide, part_of(problem))
    turned = model.begun(model.turned(closed.proposals.eligible)[: SCREENING.max_mirrored])
    best = min(model.refine(turned), key=lambda fit: fit.score, default=None)
    if best is None:
        return False
    mirrored = replace(problem, source=mirror_image(problem.source))
    image = image_of(replace(closed, ranking=replace(closed.ranking, best=best)), side)
    solution = match_under(Part(mirrored, side, (image, best.origin, np.inf)), timer)
    image = on_bodies(mirrored, UserVertices(solution.map.vertices))
    return verifier_of(mirrored)(image).cost < problem.config.outcome.mirror_image * cost


def side_to_turn(problem: Problem) -> Literal["source", "target"] | None:
    """Name the shape that seems to be inside out, if only one of them does; two that do agree with each other."""
    if problem.config.orientation == "any" or not problem.oriented:
        return None
    source, target = problem.source.seems_inside_out, problem.target.seems_inside_out
    return None if source == target else "source" if source else "target"


def solve(problem: Problem, timer: StageTimer) -> Solution:
    """Match the bodies of two shapes; one that seems to be inside out also turned over, and the better map is taken."""
    side = side_to_turn(problem)
    if side is None:
        return try_strategies(problem, Attempts(), timer)
    turned = replace(problem, **{side: turned_over(getattr(problem, side))})  # type: ignore[arg-type]
    contending: list[tuple[float, str, Solution]] = []
    failed: list[str] = []
    for how, wound in (("as they are", problem), ("turned over", turned)):
        try:
            with timer.within(f"faces {how}"):
                solution = try_strategies(wound, Attempts(), timer)
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
    return replace(solution, pair=problem, notes=(note, *failed, *solution.notes))
