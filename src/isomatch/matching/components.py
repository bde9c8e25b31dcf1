"""Shapes of several components, such as bodies with eyes: find partners, make one map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain, permutations, product
from typing import Self, cast

import numpy as np
import scipy
from scipy.spatial import cKDTree

from isomatch._core.arrays import Float, FloatArray, Int, UserVertices
from isomatch._core.errors import NotConvergedError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import UNMATCHED, carry_along, nearest_rotation
from isomatch.matching.assessment.confidence import expected_errors
from isomatch.matching.assessment.evidence import Evidence, Solution, measured_evidence, outcome_of
from isomatch.matching.assessment.quality import measure_quality
from isomatch.matching.parameters import COMPONENTS, TIES
from isomatch.matching.priors import (
    MIN_POINTS,
    NO_USER_LANDMARKS,
    Priors,
    UserPriors,
    checked_descriptors,
    checked_initial_map,
    checked_landmarks,
)
from isomatch.matching.problem import Problem
from isomatch.matching.result import MAP_ARRAYS, Outcome
from isomatch.matching.strategies import solve
from isomatch.shapes import PreparedShape, components_of
from isomatch.surfaces import Mesh

NO_PARTNERS = 1e6  # cost of two components that cannot be partners; chosen: far above any other cost
# √area of the source; shorter distances between samples are raised to this, so that ratios are finite; chosen
MIN_DISTANCE = 1e-6
SIDES = "source", "target"  # names of the two shapes


def match_components(pair: Problem, user_priors: UserPriors, timer: StageTimer) -> Solution:
    """Match two shapes whose components are matched one by one."""
    timer.start("components")
    parallel_map(components_of, (pair.source, pair.target))
    priors = ComponentPriors(pair, user_priors)
    components = _Components(pair, priors, timer)
    matches, tied = components.match_large()
    timer.start("components")
    matches += components.match_carried(matches)
    timer.start("quality")
    solution = compose_matches(pair, matches, tied, priors)
    return replace(solution, notes=(*solution.notes, *components.failed))


class _Components:
    """Finds partners among the components of both shapes, and matches them."""

    def __init__(self, pair: Problem, priors: ComponentPriors, timer: StageTimer) -> None:
        self.pair, self.priors, self.timer = pair, priors, timer
        self.sources, self.targets = priors.sides
        self.failed: list[str] = []  # notes on components between which no map was found

    def match_large(self) -> tuple[list[ComponentMatch], bool]:
        """Match the large components; also say whether another assignment of partners fits equally well."""
        rows, columns = (self._runners_up(side) for side in (self.sources, self.targets))
        joined = self.priors.joined[: len(rows), : len(columns)]
        if len(rows) == len(columns) == 1:
            return [self._match(0, 0)], False
        if joined.any():
            chosen = zip(*scipy.optimize.linear_sum_assignment(-joined))
            return [self._match(i, j) for i, j in chosen if joined[i, j]], False
        differences = np.array([[self._spectrum_difference(i, j) for j in columns] for i in rows])
        similar = differences <= differences.min() + COMPONENTS.same_spectrum_difference
        tried = {(i, j): self._try_match(i, j) for i, j in np.argwhere(similar).tolist()}
        matches = {ij: match for ij, match in tried.items() if match}
        if not matches:
            return [self._match(0, 0)], False
        assigned = ([matches[ij] for ij in pairs if ij in matches] for pairs in _assignments(*similar.shape))
        best, *others = sorted(filter(None, assigned), key=_assignment_rank)
        if not others:
            return best, False
        *classes, cost = _assignment_rank(best)
        *other_classes, other_cost = _assignment_rank(others[0])
        return best, other_classes == classes and other_cost < self.pair.config.outcome.tie * cost

    def _runners_up(self, side: tuple[PreparedShape, ...]) -> list[int]:
        """Numbers of the components that are tried as partners of the largest one."""
        least = COMPONENTS.min_runner_up_area * side[0].share
        return [i for i, shape in enumerate(side[: COMPONENTS.max_runners_up]) if shape.share >= least]

    def match_carried(self, matches: list[ComponentMatch]) -> list[ComponentMatch]:
        """Match the remaining components that lie near a partner when they are carried along."""
        rows = numbers_without(self.sources, [match.pair.source for match in matches])
        columns = numbers_without(self.targets, [match.pair.target for match in matches])
        carrier = Carrier.of([match.solution for match in matches])
        if not (rows and columns and carrier):
            return []
        centres = {i: carrier.move(self.sources[i]).mean(axis=0) for i in rows}
        cost = np.array([[self._cost(carrier, centres[i], i, j) for j in columns] for i in rows])
        pairs = [
            (a, b) for a, b in zip(*scipy.optimize.linear_sum_assignment(cost)) if cost[a, b] < NO_PARTNERS
        ]
        tried = [self._try_match(rows[a], columns[b], carrier) for a, b in pairs]
        return [match for match in tried if match]

    def _cost(self, carrier: Carrier, centre: FloatArray, i: int, j: int) -> float:
        """Cost of two partners by place, size and spectrum; negative if priors join them."""
        joined = self.priors.joined
        if joined[i].any() or joined[:, j].any():
            return -float(joined[i, j]) if joined[i, j] else NO_PARTNERS
        source, target = self.sources[i], self.targets[j]
        place = carrier.offset(centre, target)
        size = abs(np.log(carrier.length_ratio(source, target))) / np.log(COMPONENTS.max_length_ratio)
        if place > COMPONENTS.max_carried_distance or size > 1:
            return NO_PARTNERS
        place /= COMPONENTS.max_carried_distance
        return float(place**2 + size**2 + self._spectrum_difference(i, j))

    def _spectrum_difference(self, i: int, j: int) -> float:
        """Mean difference of the logarithms of the first eigenvalues of two bodies of unit area."""
        spectra = [shape.laplace.values[1:] for shape in (self.sources[i], self.targets[j])]
        n = min(COMPONENTS.n_eigenvalues, *map(len, spectra))
        return float(np.abs(np.log(spectra[0][:n] / spectra[1][:n])).mean())

    def _try_match(self, i: int, j: int, carrier: Carrier | None = None) -> ComponentMatch | None:
        """Match two components; None, and a note, if no map is found."""
        try:
            return self._match(i, j, carrier)
        except NotConvergedError as error:
            source, target = _name_of_component(self.sources[i]), _name_of_component(self.targets[j])
            self.failed.append(f"{source} was not matched to {target} of the target: {error}")
            return None

    def _match(self, i: int, j: int, carrier: Carrier | None = None) -> ComponentMatch:
        """Match two components, by themselves or starting from where one is carried."""
        pair = replace(self.pair, source=self.sources[i], target=self.targets[j])
        priors = self.priors.on(pair)
        with self.timer.within(f"component {i + 1}"):
            if carrier is None or priors.any:
                solution = solve(replace(pair, priors=priors), self.timer)
                return ComponentMatch(solution, with_priors=priors.any)
            self.timer.start("quality")
            return self._match_near_place(pair, carrier)

    def _match_near_place(self, pair: Problem, carrier: Carrier) -> ComponentMatch:
        """Match two components that are close when one is carried along."""
        # The maps of other components carry the source's component along. A rigid component, such as an eye
        # or a helmet, then lies on its partner. The match of any other component starts from the place to which
        # the component was carried. If the component is close to what carries it, this place decides between
        # symmetric maps.
        is_held = carrier.gap(pair.target) <= COMPONENTS.max_held_distance
        placed = self._place_rigidly(pair, carrier)
        if placed and placed.outcome.is_called_right:
            if is_held or not pair.target.symmetries:
                return ComponentMatch(placed, "it moves along rigidly")
            ambiguous = placed.with_evidence(Evidence(ambiguous=True))
            return ComponentMatch(ambiguous, "nothing near it tells how it is turned")
        carried = replace(pair, config=replace(pair.config, hypotheses="given", start="auto", part="none"))
        priors = Priors.of(pair.source, pair.target, None, carrier.image(pair.source, pair.target))
        solution = replace(solve(replace(carried, priors=priors), self.timer), pair=pair)
        if solution.outcome is Outcome.PRIORS_CONTRADICTED:
            doubted = replace(solution, evidence=(Evidence(poor=True),))
            return ComponentMatch(doubted, "its map does not agree with its place")
        measures = replace(solution.quality, runner_up=np.inf, mirrored=np.inf)
        decided = measured_evidence(pair, measures, pair.config.orientation)
        differs = outcome_of([decided]) is not solution.outcome
        is_tied = differs and not solution.quality.runner_up < 1 / pair.config.outcome.tie
        if pair.relation is not None or not (is_held and is_tied):
            return ComponentMatch(solution)
        regions = tuple(region for region in solution.regions if region.runner_up is None)
        by_place = replace(solution, evidence=(decided,), regions=regions)
        return ComponentMatch(by_place, "symmetric by itself, decided by its place")

    def _place_rigidly(self, pair: Problem, carrier: Carrier) -> Solution | None:
        """Carry a component rigidly to the nearest points; None if it does not fit there."""
        moved, target = carrier.move_rigidly(pair.source), cast(Mesh, pair.target.body).vertices
        points = pair.target.index.points(target, moved)
        gap = np.linalg.norm(points.interpolation(len(target)) @ target - moved, axis=1)
        if gap.mean() > COMPONENTS.same_place_distance:
            return None
        quality = measure_quality(pair, points)
        found = pair.source.correspondence(pair.target, points)
        evidence = (measured_evidence(pair, quality, pair.config.orientation),)
        errors = pair.source.lift_smooth(expected_errors(pair, points))
        return Solution(pair, found, quality, evidence, errors, origin="place")


def _assignment_rank(matches: list[ComponentMatch]) -> tuple[int, int, float]:
    """Sort key of an assignment: number of pairs, then the least sure one, then residuals."""
    residuals = np.nan_to_num([match.solution.quality.spectral_residual for match in matches], nan=np.inf)
    sureness = min(match.solution.outcome.sureness for match in matches)
    spread = np.std([np.log(match.pair.source.scale / match.pair.target.scale) for match in matches])
    residual = np.maximum(residuals, TIES.spectral_residual_noise).mean()
    return -len(matches), -sureness, float(residual + spread)


def _assignments(n: int, m: int) -> list[list[tuple[int, int]]]:
    """All assignments of n numbers to m numbers, or of m to n if m is less."""
    if n > m:
        return [[(i, j) for j, i in pairs] for pairs in _assignments(m, n)]
    return [list(enumerate(chosen)) for chosen in permutations(range(m), n)]


@dataclass(frozen=True, eq=False)
class ComponentMatch:
    """Two components that are partners."""

    solution: Solution  # in the users' vertices; its pair consists of the two components
    remark: str = ""  # how the map was selected, if not by a match of the two components alone
    with_priors: bool = False  # whether the user gave priors for them

    @property
    def pair(self) -> Problem:
        """The two components."""
        return self.solution.pair

    @property
    def share(self) -> float:
        """The largest share that a component has of the area or of the vertices of its shape."""
        return max(max(shape.share, _vertex_share(shape)) for shape in (self.pair.source, self.pair.target))


def compose_matches(
    pair: Problem, matches: list[ComponentMatch], tied: bool, priors: ComponentPriors
) -> Solution:
    """Sum up the maps of all pairs of components; the first match is the main one."""
    main, *others = matches
    bounds = pair.config.outcome
    # the result is at most as sure as the map of each component that is large or has priors
    deciding = (m for m in matches if m is main or m.share > bounds.large_component or m.with_priors)
    counted = [match.solution.all_evidence for match in deciding]
    sides = {side: [getattr(match.pair, side) for match in matches] for side in SIDES}
    unmatched = [_find_unpartnered(side, matched, pair) for side, matched in sides.items()]
    large = max(left_out for left_out, _ in unmatched) > bounds.large_component
    evidence = (*chain(*counted), Evidence(partial=large, ambiguous=tied))
    notes = [*main.solution.notes, *(_describe_match(match) for match in others)]
    if tied:
        notes.append("the largest components may as well be exchanged: nothing tells which are partners")
    if lost := len(priors.landmarks) - sum(len(priors.landmarks_on(match.pair)) for match in matches):
        notes.append(
            f"{lost} of {len(priors.landmarks)} landmarks do not lie on partners, or fewer than {MIN_POINTS} on one, "
            "and are left out"
        )
    arrays = {name: getattr(main.solution.map, name).copy() for name in MAP_ARRAYS}
    errors, distances = main.solution.expected_error.copy(), main.solution.descriptor_distance
    distances = None if distances is None else distances.copy()
    for match in others:
        solution = match.solution
        new = solution.map.matched & (arrays["vertices"] == UNMATCHED)
        for name, array in arrays.items():
            array[new] = getattr(solution.map, name)[new]
        if distances is not None and solution.descriptor_distance is not None:
            distances[new] = solution.descriptor_distance[new]
        errors[new] = solution.expected_error[new] * np.sqrt(match.pair.target.share / main.pair.target.share)
    whole = replace(main.solution.map, **arrays)
    coverage = sum(match.pair.target.share * match.solution.quality.coverage for match in matches)
    quality = replace(main.solution.quality, matched=float(whole.matched.mean()), coverage=coverage)
    return replace(
        main.solution,
        map=whole,
        evidence=evidence,
        quality=quality,
        expected_error=errors,
        descriptor_distance=distances,
        regions=tuple(sorted(chain(*(m.solution.regions for m in matches)), key=lambda region: -region.area)),
        notes=(*notes, *(note for _, side_notes in unmatched for note in side_notes)),
    )


def _find_unpartnered(side: str, matched: list[PreparedShape], pair: Problem) -> tuple[float, list[str]]:
    """Find unmatched components of a shape: their share of area or vertices, and notes."""
    components = components_of(getattr(pair, side))
    unmatched = [components[i] for i in numbers_without(components, matched)]
    notes = [
        f"{side}: {_name_of_component(shape)} has no partner and is left unmatched" for shape in unmatched
    ]
    tiny = 1 - sum(shape.share for shape in components)
    if tiny > 1e-9:
        notes.append(
            f"{side}: components that cannot be matched by themselves, with {tiny:.1%} of the area, are left unmatched"
        )
    return max(tiny + sum(shape.share for shape in unmatched), sum(map(_vertex_share, unmatched))), notes


def _vertex_share(shape: PreparedShape) -> float:
    return float((shape.body_vertex >= 0).mean())


def _name_of_component(shape: PreparedShape) -> str:
    size = f"{(shape.body_vertex >= 0).sum()} vertices, {shape.share:.1%} of the area"
    return f"the component of vertex {shape.user_vertex[0]} ({size})"


def _describe_match(match: ComponentMatch) -> str:
    outcome = match.solution.outcome.value + (f", {match.remark}" if match.remark else "")
    source, target = _name_of_component(match.pair.source), _name_of_component(match.pair.target)
    return f"{source} is matched to {target} of the target: {outcome}"


def numbers_without(side: tuple[PreparedShape, ...], matched: list[PreparedShape]) -> list[int]:
    """Numbers of the components that are not yet matched."""
    return [i for i, shape in enumerate(side) if not any(shape is other for other in matched)]


class ComponentPriors:
    """The user's priors, and the parts of them that concern two components."""

    def __init__(self, pair: Problem, user_priors: UserPriors) -> None:
        self.pair = pair
        landmarks, initial_map, descriptors = user_priors
        sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
        self.landmarks = NO_USER_LANDMARKS if landmarks is None else checked_landmarks(landmarks, *sizes)
        self.image = UserVertices(np.full(sizes[0], UNMATCHED))
        if initial_map is not None:
            self.image = checked_initial_map(initial_map, *sizes)
        self.functions = None if descriptors is None else checked_descriptors(descriptors, *sizes)
        rows = np.flatnonzero(self.image != UNMATCHED)
        pairs = np.column_stack([rows, self.image[rows]])
        self.joins = UserVertices(np.concatenate([self.landmarks, pairs]))
        joined = [self._inside(Problem(*sides, pair.config), self.joins) for sides in product(*self.sides)]
        self.joined = np.reshape([len(rows) for rows in joined], [len(side) for side in self.sides])
        if len(self.joins) and self.joined.max() < MIN_POINTS:
            Priors.of(pair.source, pair.target, landmarks, initial_map)  # raises an error: too few priors

    @property
    def sides(self) -> tuple[tuple[PreparedShape, ...], tuple[PreparedShape, ...]]:
        """Components of source and target."""
        return components_of(self.pair.source), components_of(self.pair.target)

    def _inside(self, pair: Problem, joins: Int[UserVertices, "_ 2"]) -> Int[UserVertices, "q 2"]:
        """Keep the pairs that lie on two components."""
        on_source = pair.source.body_vertex[joins[:, 0]] >= 0
        return UserVertices(joins[on_source & (pair.target.body_vertex[joins[:, 1]] >= 0)])

    def on(self, pair: Problem) -> Priors:
        """Priors on two components; landmarks or initial map are left out if they are too few to be used."""
        landmarks = self.landmarks_on(pair)
        all_pairs = np.column_stack([np.arange(len(self.image)), self.image])
        initial_pairs = self._inside(pair, UserVertices(all_pairs[self.image != UNMATCHED]))
        image = np.full(len(self.image), UNMATCHED)
        image[initial_pairs[:, 0]] = initial_pairs[:, 1]
        functions = self.functions
        if functions is not None and pair.source.body is not self.pair.source.body:
            parts = zip((pair.source, pair.target), functions)
            if not all(np.isfinite(shape.restrict(values)).all() for shape, values in parts):
                functions = None
        initial_map = image if len(initial_pairs) >= MIN_POINTS else None
        kept = landmarks if len(landmarks) else None
        return Priors.of(pair.source, pair.target, kept, initial_map, functions)

    def landmarks_on(self, pair: Problem) -> Int[UserVertices, "q 2"]:
        """Landmarks on two components, if they are enough to be used."""
        landmarks = self._inside(pair, self.landmarks)
        return landmarks if len(landmarks) >= MIN_POINTS else NO_USER_LANDMARKS


@dataclass(frozen=True, eq=False)
class Carrier:
    """A motion of space that follows a map: rigid near each point, as matched points move."""

    points: Float[FloatArray, "m 3"]  # matched points of the source, in units of its shape
    images: Float[FloatArray, "m 3"]  # their images, in units of the target
    units: tuple[float, float]  # lengths of 1 of both shapes, in the users' units
    scale: float  # length between images over length between points
    side: float  # −1 if the map reverses the orientation, else 1

    @classmethod
    def of(cls, maps: list[Solution]) -> Self | None:
        """Follow the maps of components; None if they map fewer than four samples."""
        main = maps[0].pair
        units = main.source.scale, main.target.scale
        points = np.concatenate([_positions(solution.pair.source, units[0]) for solution in maps])
        images = np.concatenate([_images(solution, units[1]) for solution in maps])
        mapped = np.isfinite(images).all(axis=1)
        points, images = points[mapped], images[mapped]
        if len(points) < 4:
            return None
        nearest = cKDTree(points).query(points, 2)[1][:, 1]
        before, after = (np.linalg.norm(x - x[nearest], axis=1) for x in (points, images))
        scale = float(np.median(after / np.maximum(before, MIN_DISTANCE)))
        return cls(points, images, units, scale, -1.0 if maps[0].quality.orientation < 0 else 1.0)

    def move(self, source: PreparedShape) -> Float[FloatArray, "q 3"]:
        """Carry the samples of a component along."""
        samples = _positions(source, self.units[0])
        return carry_along(samples, self.points, self.images, scale=self.scale, mirrored=self.side < 0)

    def gap(self, target: PreparedShape) -> float:
        """Distance of a component from the surface that carries it, in √area of the component."""
        centre = _positions(target, self.units[1]).mean(axis=0)
        return float(cKDTree(self.images).query(centre)[0] * self.units[1] / target.scale)

    def offset(self, centre: FloatArray, target: PreparedShape) -> float:
        """Distance of a carried centre from a component, in its √area × (1 + gap)."""
        shift = centre - _positions(target, self.units[1]).mean(axis=0)
        return float(np.linalg.norm(shift) / ((1 + self.gap(target)) * target.scale / self.units[1]))

    def move_rigidly(self, source: PreparedShape) -> Float[FloatArray, "n 3"]:
        """Turn the body of a component rigidly as it is carried, about its centre."""
        body, moved = cast(Mesh, source.body).vertices, self.move(source)
        covariance = body[source.sample_vertices].T @ (moved - moved.mean(axis=0))
        return np.asarray(body @ nearest_rotation(covariance, self.side < 0))

    def length_ratio(self, source: PreparedShape, target: PreparedShape) -> float:
        """√area of a carried component over √area of a component of the target."""
        return self.scale * source.scale / self.units[0] / (target.scale / self.units[1])

    def image(self, source: PreparedShape, target: PreparedShape) -> Int[UserVertices, "n_source"]:
        """Map carried samples of a component to the nearest of its partner; others to −1."""
        moved, samples = self.move(source), _positions(target, self.units[1])
        nearest = cKDTree(samples - samples.mean(axis=0)).query(moved - moved.mean(axis=0))[1]
        image = np.full(source.surface.n_vertices, UNMATCHED)
        rows = source.user_vertex[source.sample_vertices]
        image[rows] = target.user_vertex[target.sample_vertices[nearest]]
        return UserVertices(image)


def _positions(shape: PreparedShape, unit: float) -> Float[FloatArray, "q 3"]:
    """Positions of the samples of a component, divided by a unit."""
    return cast(Mesh, shape.surface).vertices[shape.user_vertex[shape.sample_vertices]] / unit


def _images(solution: Solution, unit: float) -> Float[FloatArray, "q 3"]:
    """Positions of the images of the samples of the source; nan where there is none."""
    source = solution.pair.source
    images = solution.map.pull_back(cast(Mesh, solution.pair.target.surface).vertices / unit)
    return images[source.user_vertex[source.sample_vertices]]
