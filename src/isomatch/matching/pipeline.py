"""The whole way from two surfaces to a map between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map, serial_blas
from isomatch.errors import LandmarkError, MapError, NotConvergedError, SettingError
from isomatch.matching import refine
from isomatch.matching.choice import Judged, contenders, judge, ranked, ranked_by_side
from isomatch.matching.clock import Clock, Progress
from isomatch.matching.config import Config
from isomatch.matching.hypotheses import (
    SAME_MAP,
    Hypothesis,
    converged,
    images_of_rotation,
    recomposed,
    search,
    start_from_functions,
    twins,
)
from isomatch.matching.initial import (
    OFF_DIAGONAL,
    WEAKER,
    checked_descriptors,
    checked_initial_map,
    checked_landmarks,
    rotations_from_landmarks,
)
from isomatch.matching.nearest import Coordinates, nearest_in_cells
from isomatch.matching.pair import Pair, prepared_pair
from isomatch.matching.precise import interpolation, nearest_points
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.quality import landmark_errors, outcome_of, quality_of
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.surfaces import Surface

LANDMARK_SLACK = (
    0.05  # hypotheses whose landmark error exceeds the smallest by more than this, in √area, are dropped
)

MOST_ALTERNATIVES = 2


def match(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> MatchResult:
    """Match two near-isometric surfaces.

    Parameters
    ----------
    source, target : Mesh, PointCloud, Graph or PreparedShape
        The shapes; `prepare` one that is matched more than once.
    landmarks : (m, 2) array_like of int, optional
        Rows (source vertex, target vertex), m ≥ 3.
    initial_map : (n_source,) array_like of int, optional
        Target vertex of each source vertex from another method; −1 where unknown.
    initial_descriptors : two array_likes, optional
        (n_source, q) and (n_target, q) values of functions that should correspond.
    config : Config, optional
        Settings; by default those of the prepared shapes, else the defaults.
    seed : int
        Seeds sampling and eigensolver of shapes not yet prepared.
    progress : callable, optional
        Called with the name of each stage as it starts. If the first map is poor, stages after "prepare" come again.

    Returns
    -------
    MatchResult
        ``.map`` is the `Correspondence` source → target.

    Raises
    ------
    MeshError
        If a surface cannot be used.
    LandmarkError
        If landmarks, initial map or descriptors do not fit the shapes.
    NotConvergedError
        If no hypothesis could be formed at all.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, with automatic starts and a joint refinement beyond it.
    About 2 s for two shapes of 5 000 vertices on two cores, half of it preparation; 1 s more where the first map is poor.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> result = match(source.mesh, target.mesh)
    >>> result.outcome.name
    'CONVERGED'
    """
    clock = Clock(progress)
    with serial_blas():
        clock.start("prepare")
        pair, config = prepared_pair(source, target, config, seed)
        source, target = pair.source.shape, pair.target.shape
        parallel_map(lambda shape: (shape.cloud, shape.signatures, shape.curvature), [source, target])
        clock.start("hypotheses")
        pairs = None if landmarks is None else checked_landmarks(landmarks, *_sizes(source, target))
        given = _given(pair, pairs, initial_map, initial_descriptors)
        if config.hypotheses == "given" and not given:
            raise SettingError(
                "hypotheses = 'given', but no landmarks, initial map or descriptors were given"
            )
        found = search(pair, given)
        clock.start("choice")
        judged = judge(pair, found)
        attempt = _attempt(pair, judged, given, pairs, config, clock)
        notes = [*(f"source: {n}" for n in source.notes), *(f"target: {n}" for n in target.notes)]
        if attempt.outcome is Outcome.LOW_CONFIDENCE and config.hypotheses == "all":
            clock.start("hypotheses")
            if new := recomposed(pair, found):
                clock.start("choice")
                judged += judge(pair, new)
                attempt = _attempt(pair, judged, given, pairs, config, clock, rounds=2)
                notes.append(
                    f"the first map was poor: {len(new)} more compositions of those found were tried"
                )
        alternatives = parallel_map(lambda judged: _alternative(pair, judged), attempt.others)
    return MatchResult(
        map=source.lifted(target, attempt.image, *attempt.precise),
        outcome=attempt.outcome,
        quality=attempt.quality,
        alternatives=tuple(alternatives),
        timings=clock.stop(),
        notes=tuple(notes),
        engine=source.distances.engine,
        origin=attempt.fits[0].judged.hypothesis.origin,
        config=config,
        seed=seed,
    )


@dataclass(frozen=True, eq=False)
class _Attempt:
    """What comes of some hypotheses: refined winner and rivals, runners-up, images of the body, and their quality."""

    fits: list[refine.JointFit]
    others: list[Judged]
    image: IntArray
    precise: tuple[IntArray, FloatArray]
    quality: Quality
    outcome: Outcome


def _attempt(
    pair: Pair,
    judged: list[Judged],
    given: list[Hypothesis],
    landmarks: IntArray | None,
    config: Config,
    clock: Clock,
    rounds: int = 1,
) -> _Attempt:
    """Choose among what was found in some rounds of the search, refine the best and judge it."""
    source, target = pair.source.shape, pair.target.shape
    order = _candidates(pair, judged, landmarks, config)
    rivals: list[Judged] = []
    if given and config.hypotheses == "given":
        # what was not given is tried as well, to know whether it fits better
        of_given = ranked(judge(pair, given), config.orientation)
        order, rivals = _agreeing(pair, of_given, landmarks, config), order
    if not order:
        raise NotConvergedError(
            "no first map could be formed: a shape has fewer than four extremities (a sphere, a flat patch); "
            "give landmarks, an initial map or descriptors"
        )
    clock.start("refinement")
    fits = _contest(pair, order, rivals, config, rounds)
    coordinates = _coordinates(pair, fits[0], config)
    image = nearest_in_cells(*coordinates, target.cells)
    precise = nearest_points(*coordinates, target.faces, image)
    clock.start("quality")
    pull_back = interpolation(*precise, target.body.n_vertices)
    quality = quality_of(pair, image, pull_back, fits, landmarks)
    outcome = outcome_of(quality, source, target, config.orientation, bool(given))
    others = _others(pair, [fit.judged for fit in fits] + order + rivals)
    return _Attempt(fits, others, image, precise, quality, outcome)


def _sizes(source: PreparedShape, target: PreparedShape) -> tuple[int, int]:
    return source.mesh.n_vertices, target.mesh.n_vertices


def _given(
    pair: Pair,
    landmarks: IntArray | None,
    initial_map: ArrayLike | None,
    descriptors: tuple[ArrayLike, ArrayLike] | None,
) -> list[Hypothesis]:
    """Hypotheses from what the user knows, each after iterative closest points."""
    source, target = pair.source.shape, pair.target.shape
    starts: list[tuple[IntArray, str]] = []
    if landmarks is not None:
        at_source, at_target = source.body_vertex[landmarks[:, 0]], target.body_vertex[landmarks[:, 1]]
        held = (at_source >= 0) & (at_target >= 0)
        if held.sum() < 3:
            raise LandmarkError(
                f"only {held.sum()} landmarks lie on the main component of both shapes; at least 3 are needed there"
            )
        rows = at_target[None, held], at_source[None, held]
        for penalty in (OFF_DIAGONAL, *WEAKER):
            rotation = rotations_from_landmarks(target.cloud, source.cloud, *rows, penalty)
            starts.append((images_of_rotation(pair, rotation[0]), "landmarks"))
    if initial_map is not None:
        image = checked_initial_map(initial_map, *_sizes(source, target))
        starts.append((_seen(pair, image), "initial map"))
    if descriptors is not None:
        of_source, of_target = checked_descriptors(descriptors, *_sizes(source, target))
        on_bodies = of_source[source.mesh_vertex], of_target[target.mesh_vertex]
        starts.append((start_from_functions(pair, *on_bodies), "descriptors"))
    given = [Hypothesis(converged(pair, image), origin) for image, origin in starts]
    if landmarks is None:
        return given
    # points at extremities leave the front and the back of a thin body undecided
    led = [start for start in given if start.origin == "landmarks"]
    best = min(led, key=lambda start: start.alignment.residual)
    return [*given, *(replace(twin, origin="landmarks") for twin in twins(pair, best, given))]


def _seen(pair: Pair, image: IntArray) -> IntArray:
    """Restrict a map in the users' indices to the search vertices: rows of the target's glimpse.

    Images between the target's search vertices go to the one nearest in descriptors; source vertices without an
    image take that of the nearest search vertex that has one.
    """
    source, target = pair.source.shape, pair.target.shape
    vertices = image[source.mesh_vertex[pair.source.rows]]
    on_body = np.where(vertices >= 0, target.body_vertex[vertices], -1)
    known = np.flatnonzero(on_body >= 0)
    if len(known) < 3:
        raise MapError("the initial map leaves (nearly) everything unmatched; it cannot start anything")
    columns = pair.target.cloud.coordinates.shape[1]
    stand_in = known[cKDTree(pair.source.cloud.coordinates[known]).query(pair.source.cloud.coordinates)[1]]
    return np.asarray(
        cKDTree(pair.target.cloud.coordinates).query(target.cloud.coordinates[on_body[stand_in], :columns])[
            1
        ],
        dtype=np.int64,
    )


def _candidates(pair: Pair, judged: list[Judged], landmarks: IntArray | None, config: Config) -> list[Judged]:
    """Rank those that agree with the landmarks, and the twins of the best: it may be the half-turned one of the two."""
    order = _agreeing(pair, ranked(judged, config.orientation), landmarks, config)
    new = twins(pair, order[0].hypothesis, [j.hypothesis for j in judged]) if order else []
    if not new:
        return order
    return _agreeing(pair, ranked([*judged, *judge(pair, new)], config.orientation), landmarks, config)


def _agreeing(pair: Pair, order: list[Judged], landmarks: IntArray | None, config: Config) -> list[Judged]:
    """Drop hypotheses that contradict the landmarks."""
    if landmarks is None or not order:
        return order
    errors = [
        landmark_errors(pair, refine.extended_at(pair, j.image, landmarks[:, 0]), landmarks) for j in order
    ]
    least = min(errors)
    agreeing = [j for j, error in zip(order, errors) if error <= least + LANDMARK_SLACK]
    return ranked_by_side(agreeing, config.orientation)


def _contest(
    pair: Pair, order: list[Judged], rivals: list[Judged], config: Config, rounds: int
) -> list[refine.JointFit]:
    """Refine the contenders, and rivals that may not win: the best contender, then all others, best first."""
    both_sides = config.orientation == "any"
    fits = refine.jointly(pair, contenders(order, config.orientation, rounds), both_sides)
    if rivals:
        others = fits[1:] + refine.jointly(pair, contenders(rivals, config.orientation), both_sides)
        fits[1:] = sorted(others, key=partial(refine.score_of, pair))
    return fits


def _coordinates(pair: Pair, fit: refine.JointFit, config: Config) -> Coordinates:
    if config.refinement in ("joint", "smooth"):
        smooth = config.refinement == "smooth"
        coordinates = refine.joint_coordinates(pair, fit, with_signatures=not smooth)
        return refine.settled(pair, coordinates, refine.SMOOTH_STEPS if smooth else refine.SETTLING_STEPS)
    coordinates = refine.by_distances(pair, fit.judged.hypothesis.alignment.image)
    return refine.by_laplace_icp(pair, coordinates) if config.refinement == "laplace_icp" else coordinates


def _others(pair: Pair, order: list[Judged]) -> list[Judged]:
    """Give the runners-up that differ from the winner and from each other."""
    distinct = order[:1]
    for judged in order[1:]:
        if all(pair.difference(judged.image, other.image) > SAME_MAP for other in distinct):
            distinct.append(judged)
    return distinct[1 : 1 + MOST_ALTERNATIVES]


def _alternative(pair: Pair, judged: Judged) -> Alternative:
    source, target = pair.source.shape, pair.target.shape
    image = refine.extended(pair, judged.image, np.arange(source.body.n_vertices))
    return Alternative(
        source.lifted(target, image),
        judged.energy,
        judged.orientation,
        judged.hypothesis.origin,
    )
