"""`match`, `match_both`, `continue_with`: match two shapes, or their components."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.errors import SettingError
from isomatch._core.first_use import visualization
from isomatch._core.stage_timer import Progress, StageTimer, with_two_arguments
from isomatch._core.threads import in_background, serial_blas
from isomatch.correspondence import UNMATCHED, Correspondence, iterative_closest_points
from isomatch.io import SurfaceLike
from isomatch.matching.assessment.evidence import Evidence, Solution, result_of
from isomatch.matching.components import match_components
from isomatch.matching.hard_landmarks import pin_landmarks
from isomatch.matching.isometric.inverse import Inverse
from isomatch.matching.isometric.isometry import IsometricMatch
from isomatch.matching.maps import Candidate
from isomatch.matching.model import MatchingModel
from isomatch.matching.parameters import SCREENING
from isomatch.matching.priors import (
    Priors,
    UserPriors,
    checked_initial_map,
    checked_landmarks,
    known_functions,
)
from isomatch.matching.problem import Problem, Refinement, Start, name_of, prepare_pair
from isomatch.matching.refinements import REFINEMENTS
from isomatch.matching.result import Alternative, MatchResult, Outcome
from isomatch.matching.strategies import (
    BOTH_SIDES,
    ELASTIC,
    ISOMETRIC,
    Attempts,
    side_to_turn,
    solve,
    try_strategies,
)
from isomatch.matching.via import Via, solve_via
from isomatch.settings import Config
from isomatch.shapes import PreparedShape


def match(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    refinement: Refinement | None = None,
    starts: Sequence[Start] | None = None,
    relation: Callable[[Problem], MatchingModel[Any, Any]] | None = None,
    functions: tuple[ArrayLike, ArrayLike] | None = None,
    via: Via | None = None,
) -> MatchResult:
    """Match two near-isometric surfaces.

    Parameters
    ----------
    source, target : Mesh, PointCloud, Graph, PreparedShape, path_like, tuple or object
        The shapes; `prepare` a shape that is matched more than once. Also the path of a mesh file, a tuple (vertices,
        faces) or a mesh of trimesh, PyVista, meshio or Open3D; see ``isomatch.io``.
    landmarks : (m, 2) array_like of int, optional
        Rows (source vertex, target vertex), m ≥ 3; see `read_landmarks`. With ``Config.pin`` they hold.
    initial_map : (n_source,) array_like of int, optional
        Target vertex of each source vertex from another method; −1 where unknown. It wins unless another map fits better.
    initial_descriptors : two array_likes, optional
        (n_source, q) and (n_target, q) values of functions that should correspond.
    config : Config, optional
        By default the settings of the prepared shapes, else the defaults.
    seed : int
        Seeds sampling and eigensolver of shapes not yet prepared.
    progress : callable, optional
        Called as ``progress(stage, share)`` when a stage starts, on the calling thread; the share of the work done rises
        from 0 to 1. It may also take the stage alone, as `show_progress` does. An exception that it raises ends the
        match.
    refinement : Refinement, optional
        Your own subclass of `Refinement`, instead of ``config.refinement``.
    starts : sequence of callable, optional
        Propose first maps, besides priors: functions of the problem that return arrays (q, 2) of vertices of both
        bodies; ``[yours, *default_starts]`` adds one to the defaults. Landmarks and an initial map always contend, too;
        with ``Config(hypotheses="given")`` no start may win.
    relation : callable, optional
        Claims how the shapes, or two components, are related: it makes a `MatchingModel` of their `Problem`, as the
        classes `Isometry`, `Part`, `TwoParts` and `Elastic` do. By default every model that suits them is tried, see
        `select_strategies`. `Part` and `Elastic` need meshes and the orientation "preserve", and `Part` takes no
        descriptors.
    functions : two array_likes, optional
        (n_source, q) and (n_target, q), or (n_source,) and (n_target,), values that mean the same on both shapes, such as
        thickness, sulcal depth or colour; nan where unknown. Unlike ``initial_descriptors``, which only start the search,
        they are coordinates of every stage, with the weight ``Config.refining.function_weight``.
    via : surface, tuple of surfaces or list of either, optional
        Match through a complete shape, if source and target are fragments; or through two, one like the source and one
        like the target, ``via=(whole, other)``. The maps from each shape to the next are composed. If a list of such
        chains is given, the map that verifies best is returned. `prepare` wholes that are used more than once.

    Returns
    -------
    MatchResult
        ``.map`` is the `Correspondence` source → target.

    Raises
    ------
    MeshError
        If a surface cannot be used.
    LandmarkError, MapError, DescriptorError
        If landmarks, initial map or descriptors do not fit the shapes.
    SettingError
        If shapes were prepared with other settings, priors are required and none was given, a refinement, start or
        relation returns something invalid, or a relation does not suit the shapes or the settings.
    NotConvergedError
        If no map of a part keeps the orientation.

    Notes
    -----
    The method is from Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, with automatic starts and a joint
    refinement. Two shapes of 5 000 vertices take about 2 s on two cores. Large meshes are matched on fewer vertices,
    see ``Config.resolution``.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> result = match(source.mesh, target.mesh)
    >>> result.outcome.name
    'CONVERGED'
    """
    timer = StageTimer(progress)

    def run() -> MatchResult:
        with serial_blas():
            timer.start("prepare")
            prepared = prepare_pair(source, target, config, seed, timer)
            priors = landmarks, initial_map, initial_descriptors
            problem = _complete_problem(prepared, priors, functions, refinement, starts, relation)
            if via is None:
                solution = solve_prepared(problem, priors, timer)
            else:
                if functions is not None or any(prior is not None for prior in priors):
                    raise SettingError(
                        "via takes no priors: what is known of both shapes says nothing of those between"
                    )
                no_priors: UserPriors = (None, None, None)
                solution = solve_via(problem, via, lambda leg: solve_prepared(leg, no_priors, timer))
            notes = *solution.notes, *_note_stages(problem, refinement)
            result = result_of(replace(solution, notes=notes), timer, seed)
        timer.reach("done", 1.0)
        return result

    return in_background(run)


def _complete_problem(
    problem: Problem,
    priors: UserPriors,
    functions: tuple[ArrayLike, ArrayLike] | None,
    refinement: Refinement | None,
    starts: Sequence[Start] | None,
    relation: Callable[[Problem], MatchingModel[Any, Any]] | None,
) -> Problem:
    """Add functions, starts, relation, and a refinement, by default from the settings.

    Raise `SettingError` if landmarks must hold and none were given.
    """
    if problem.config.pin is not None and priors[0] is None:
        raise SettingError(f"pin = {problem.config.pin}, but no landmarks were given that could be held")
    return replace(
        problem,
        functions=known_functions(problem.source, problem.target, functions, problem.config),
        refinement=REFINEMENTS[problem.config.refinement] if refinement is None else refinement,
        starts=starts,
        relation=relation,
    )


def solve_prepared(problem: Problem, user_priors: UserPriors, timer: StageTimer) -> Solution:
    """Match two prepared shapes, given landmarks, an initial map and descriptors."""
    landmarks, initial_map, _ = user_priors
    source, target, tolerance = problem.source, problem.target, problem.config.pin
    if isinstance(initial_map, Correspondence):
        initial_map.check_fits(source.surface, target.surface)
    if problem.oriented and (source.others or target.others):
        solution = match_components(problem, user_priors, timer)
    else:
        solution = solve(replace(problem, priors=Priors.of(source, target, *user_priors)), timer)
    if tolerance is None or landmarks is None:
        return solution
    timer.start("hard landmarks")
    sizes = source.surface.n_vertices, target.surface.n_vertices
    return pin_landmarks(problem, solution, checked_landmarks(landmarks, *sizes), tolerance)


def _note_stages(problem: Problem, refinement: Refinement | None) -> list[str]:
    """Note which stages the user handed in."""
    starts, relation = problem.starts, problem.relation
    names = {
        "refinement": refinement and type(refinement).__name__,
        "starts": None if starts is None else ", ".join(map(name_of, starts)) or "none",
        "relation": relation and name_of(relation),
    }
    stages = "; ".join(f"{stage} = {name}" for stage, name in names.items() if name)
    return [f"stages handed in: {stages}"] if stages else []


# share of the reported progress for the preparation and the map from source to target; chosen
FIRST_DIRECTION_SHARE = 0.75


class BothDirections(NamedTuple):
    """Results of `match_both`: one for each direction."""

    source_to_target: MatchResult
    target_to_source: MatchResult

    def _repr_html_(self) -> str:
        return str(visualization().html_of(self))  # a named tuple cannot inherit this


def match_both(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    refinement: Refinement | None = None,
    starts: Sequence[Start] | None = None,
    relation: Callable[[Problem], MatchingModel[Any, Any]] | None = None,
    functions: tuple[ArrayLike, ArrayLike] | None = None,
) -> BothDirections:
    """Match two surfaces in both directions; the shapes are prepared once.

    For complete shapes without priors, the map back is not searched again. If the first map is a sure isometry, its
    inverse takes nearest points in the same coordinates; else the inverses of the map and of its alternatives are
    hypotheses. Otherwise, or if one shape alone seems to be inside out, the map back is searched
    like the first one. The first note of ``target_to_source`` says which was done.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, config, seed, progress
        As for `match`, whose errors are raised; priors are inverted for the map back.
    refinement, starts, relation, functions
        As for `match`; used in both directions.

    Returns
    -------
    BothDirections
        ``source_to_target`` is the result of `match`. Both take about 1.3 times as long as `match`; the timings of
        ``target_to_source`` do not include the preparation.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> both = match_both(source.mesh, target.mesh)
    >>> both.source_to_target.map.shape == both.target_to_source.map.shape[::-1]
    True
    """
    report = with_two_arguments(progress) if progress else lambda stage, share: None
    first = FIRST_DIRECTION_SHARE
    timer = StageTimer(lambda stage, share: report(stage, first * share))
    timer_back = StageTimer(lambda stage, share: report(f"back: {stage}", first + (1 - first) * share))

    def run() -> BothDirections:
        with serial_blas():
            timer.start("prepare")
            prepared = prepare_pair(source, target, config, seed, timer)
            priors = landmarks, initial_map, initial_descriptors
            problem = _complete_problem(prepared, priors, functions, refinement, starts, relation)
            return _match_both_ways(problem, priors, timer, timer_back, seed)

    both = in_background(run)
    report("done", 1.0)
    return both


def _match_both_ways(
    problem: Problem, user_priors: UserPriors, timer: StageTimer, timer_back: StageTimer, seed: int
) -> BothDirections:
    source, target = problem.source, problem.target
    problem_back, priors_back = problem.turned, _reverse_priors(problem, user_priors)
    attempts = None
    if not (problem.oriented and (source.others or target.others)):
        problem = replace(problem, priors=Priors.of(source, target, *user_priors))
        searched = not problem.priors.any and problem.config.hypotheses == "all" and problem.relation is None
        attempts = Attempts(problem, timer) if searched and not side_to_turn(problem) else None
    first_solution = try_strategies(attempts) if attempts else solve_prepared(problem, user_priors, timer)
    result = result_of(first_solution, timer, seed)
    timer_back.restart()
    ways = {ISOMETRIC.name: (ISOMETRIC,), BOTH_SIDES.name: (ISOMETRIC,), ELASTIC.name: (ISOMETRIC, ELASTIC)}
    if attempts is None or first_solution.way not in ways:
        solution = solve_prepared(problem_back, priors_back, timer_back)
        note = "the shapes were prepared for both directions at once; the map was found by itself"
    else:
        found = attempts.matches.get(BOTH_SIDES.name, attempts.matches[ISOMETRIC.name])
        hypotheses = _reverse_hypotheses(found, problem, problem_back)
        way_back, is_sure = ways[first_solution.way], first_solution.outcome is Outcome.CONVERGED
        # the inverse of a doubtful map may be better than the map, and then is searched from the hypotheses
        inverse_of = found if is_sure and way_back == (ISOMETRIC,) and problem.refinement.polishes else None
        tried = Attempts(problem_back, timer_back, hypotheses, inverse_of, way_back)
        solution = try_strategies(tried).with_evidence(Evidence.of(first_solution.outcome))
        how = "the hypotheses are the map of the other direction and"
        if inverse_of and isinstance(tried.matches[ISOMETRIC.name].model, Inverse):
            how = "images are nearest points in the coordinates of the other direction; listed are"
        note = (
            f"the shapes were prepared for both directions at once; {how} {len(hypotheses) - 1} alternatives to it, "
            "turned around, and the outcome is at most as sure as there"
        )
    solution = replace(solution, notes=(note, *solution.notes))
    return BothDirections(result, result_of(solution, timer_back, seed))


def _reverse_priors(problem: Problem, user_priors: UserPriors) -> UserPriors:
    """Invert priors; where several source vertices have one image, the last of them is kept."""
    landmarks, initial_map, descriptors = user_priors
    sizes = problem.source.surface.n_vertices, problem.target.surface.n_vertices
    image_back = None
    if initial_map is not None:
        image = checked_initial_map(initial_map, *sizes)
        rows = np.flatnonzero(image != UNMATCHED)
        image_back = np.full(sizes[1], UNMATCHED)
        image_back[image[rows]] = rows
    return (
        None if landmarks is None else checked_landmarks(landmarks, *sizes)[:, ::-1],
        image_back,
        None if descriptors is None else descriptors[::-1],
    )


def _reverse_hypotheses(isometric: IsometricMatch, pair: Problem, pair_back: Problem) -> list[Candidate]:
    """Invert refined maps, best first, and the best candidates, on the search vertices."""
    fits = isometric.ranking.best, *isometric.ranking.others
    images = [fit.image[: len(pair.source_vertices)] for fit in fits]
    tried = [fit.candidate.alignment for fit in fits if fit.candidate]
    others = [c for c in isometric.proposals.eligible if all(c.alignment is not other for other in tried)]
    others = others[: pair.config.selection.most_contenders]
    images += [pair.target_vertices[candidate.target_row] for candidate in others]
    # first maps of the match back: for each search vertex of the target, the source row whose image is nearest
    between = pair.target.distances.between
    starts = np.array([between(pair.target_vertices, image).argmin(axis=1) for image in images])
    aligned = iterative_closest_points(*pair_back.search_points, starts, SCREENING.n_prior_steps)
    origins = [*(fit.origin for fit in fits), *(candidate.origin for candidate in others)]
    return [Candidate(alignment, origin) for alignment, origin in zip(aligned, origins, strict=True)]


FORMER_PREFIX = "the map before, "  # begins the origin of a map that an alternative has replaced


def continue_with(
    result: MatchResult,
    number: int,
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    progress: Progress | None = None,
) -> MatchResult:
    """Refine an alternative of a result; the previous map becomes the first alternative.

    Parameters
    ----------
    result : MatchResult
        Result of `match` for the two shapes.
    number : int
        Number of the alternative, from 1.
    source, target, progress
        As for `match`.
    landmarks : (m, 2) array_like of int, optional
        Landmarks that must hold if ``result.config.pin`` is set; otherwise they are not used.

    Returns
    -------
    MatchResult
        The result of the new map, with the settings of ``result`` except ``hypotheses="given"`` and ``start="auto"``. A
        note names the alternative that was chosen.

    Raises
    ------
    SettingError
        If there is no alternative of that number, or the result is of a baseline.
    MapError
        If the maps are between other shapes.
    """
    others = result.alternatives
    if not 1 <= number <= len(others):
        raise SettingError(
            f"there is no alternative {number}; the result has {len(others) or 'none'} of them"
        )
    if not isinstance(result.config, Config):
        raise SettingError(f"the result is of {type(result.config).__name__}; only maps of match are refined")
    chosen = others[number - 1]
    start: Any = chosen.map  # a `Correspondence`, so that its surfaces are checked
    config = replace(result.config, hypotheses="given", start="auto")
    former_map = result.map  # so that the function below keeps this map, not the whole result
    former = Alternative(lambda: former_map, nan, nan, FORMER_PREFIX + result.origin)
    result = match(
        source,
        target,
        landmarks=None if config.pin is None else landmarks,
        initial_map=start,
        config=config,
        seed=result.seed,
        progress=progress,
    )
    remaining = [replace(a, origin=a.origin.removeprefix(FORMER_PREFIX)) for a in others if a is not chosen]
    origin = chosen.origin.removeprefix(FORMER_PREFIX)
    note = f"alternative {number}, from {origin}, was chosen and refined; the map before is alternative 1"
    return replace(result, alternatives=(former, *remaining), origin=origin, notes=(note, *result.notes))
