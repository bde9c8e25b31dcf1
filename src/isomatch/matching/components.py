"""Shapes of several components, such as bodies with eyes and clothes: which are partners, and one map of all."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map
from isomatch.correspondence import UNMATCHED
from isomatch.errors import NotConvergedError
from isomatch.matching.carrier import Carrier
from isomatch.matching.connected import match_connected
from isomatch.matching.hints import (
    FEWEST_POINTS,
    Hints,
    checked_descriptors,
    checked_initial_map,
    checked_landmarks,
)
from isomatch.matching.pair import ShapePair
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.quality import measure_quality, outcome_of
from isomatch.matching.result import MAP_ARRAYS, MatchResult, Outcome
from isomatch.matching.stage_timer import StageTimer
from isomatch.matching.vertex_confidence import expected_errors
from isomatch.surfaces import Mesh

FAR_APART = 1e6  # cost of components that are no partners
SIDES = "source", "target"


@dataclass(frozen=True, eq=False)
class ComponentMatch:
    """Two components that are partners.

    Parameters
    ----------
    pair : ShapePair
        The components, each as a prepared shape of the user's whole surface.
    result : MatchResult
        Their map, in the users' vertices.
    remark : str
        How the map was decided upon, if not by the components alone.
    hinted : bool
        Whether the user gave hints for them.
    """

    pair: ShapePair
    result: MatchResult
    remark: str = ""
    hinted: bool = False

    @property
    def share(self) -> float:
        """Share of the area or of the vertices of either shape, the largest one."""
        return max(max(shape.share, _vertex_share(shape)) for shape in (self.pair.source, self.pair.target))


def match_components(
    pair: ShapePair,
    landmarks: ArrayLike | None,
    initial_map: ArrayLike | None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None,
    timer: StageTimer,
    seed: int,
) -> MatchResult:
    """Match shapes of which at least one has further components that can be matched by themselves.

    The largest components are matched first. Their map carries the others along, which tells partners, and where each of
    their vertices goes.

    Parameters and errors are those of `match`.
    """
    timer.start("components")
    parallel_map(lambda shape: shape.components, (pair.source, pair.target))
    found = _Components(pair, _Given(pair, landmarks, initial_map, initial_descriptors), timer, seed)
    matches, tied = found.large_ones()
    matches += found.carried_ones(matches)
    return _composed(pair, matches, tied, found.given, timer)


class _Given:
    """The user's hints, and what of them concerns two components."""

    def __init__(
        self,
        pair: ShapePair,
        landmarks: ArrayLike | None,
        initial_map: ArrayLike | None,
        initial_descriptors: tuple[ArrayLike, ArrayLike] | None,
    ) -> None:
        self.pair = pair
        self.functions: tuple[FloatArray, FloatArray] | None = None
        sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
        none = np.zeros((0, 2), dtype=np.int64)
        self.landmarks = none if landmarks is None else checked_landmarks(landmarks, *sizes)
        self.image = np.full(sizes[0], UNMATCHED)
        if initial_map is not None:
            self.image = checked_initial_map(initial_map, *sizes)
        if initial_descriptors is not None:
            self.functions = checked_descriptors(initial_descriptors, *sizes)
        known = np.flatnonzero(self.image != UNMATCHED)
        self.joins = np.concatenate([self.landmarks, np.column_stack([known, self.image[known]])])
        joined = [self._inside(ShapePair(*sides, pair.config), self.joins) for sides in product(*self.sides)]
        self.joined = np.reshape([len(rows) for rows in joined], [len(side) for side in self.sides])
        if len(self.joins) and self.joined.max() < FEWEST_POINTS:
            Hints.of(pair, landmarks, initial_map, None)  # refuses them

    @property
    def sides(self) -> tuple[tuple[PreparedShape, ...], tuple[PreparedShape, ...]]:
        """Components of source and target."""
        return self.pair.source.components, self.pair.target.components

    def _inside(self, pair: ShapePair, joins: IntArray) -> IntArray:
        """Those pairs of the users' vertices that lie on two components."""
        here = pair.source.body_vertex[joins[:, 0]] >= 0
        return joins[here & (pair.target.body_vertex[joins[:, 1]] >= 0)]

    def on(self, pair: ShapePair) -> Hints:
        """Hints on two components; none where too little is known of them."""
        landmarks = self.landmarks_on(pair)
        known = self._inside(pair, np.column_stack([np.arange(len(self.image)), self.image]))
        known = known[known[:, 1] != UNMATCHED]
        image = np.full(len(self.image), UNMATCHED)
        image[known[:, 0]] = known[:, 1]
        functions = self.functions
        if functions is not None and pair.source.body is not self.pair.source.body:
            parts = zip((pair.source, pair.target), functions)
            if not all(np.isfinite(shape.restrict(values)).all() for shape, values in parts):
                functions = None
        return Hints.of(
            pair,
            landmarks if len(landmarks) else None,
            image if len(known) >= FEWEST_POINTS else None,
            functions,
        )

    def landmarks_on(self, pair: ShapePair) -> IntArray:
        """Landmarks on two components, if they are enough to be used."""
        landmarks = self._inside(pair, self.landmarks)
        return landmarks if len(landmarks) >= FEWEST_POINTS else landmarks[:0]


class _Components:
    """The components of both shapes, and which of them are partners."""

    def __init__(self, pair: ShapePair, given: _Given, timer: StageTimer, seed: int) -> None:
        self.pair, self.given, self.timer, self.seed = pair, given, timer, seed
        self.sources, self.targets = given.sides
        self.settings = pair.config.components

    def large_ones(self) -> tuple[list[ComponentMatch], bool]:
        """Match the largest components, and others nearly as large whose spectra do not tell which are partners.

        Returns also whether another assignment of them fits as well.
        """
        rows, columns = (self._rivals(side) for side in (self.sources, self.targets))
        joined = self.given.joined[: len(rows), : len(columns)]
        if len(rows) == len(columns) == 1:
            return [self._matched(0, 0)], False
        if joined.any():
            chosen = zip(*linear_sum_assignment(-joined))
            return [self._matched(i, j) for i, j in chosen if joined[i, j]], False
        unlike = np.array([[self._unlike(i, j) for j in columns] for i in rows])
        tried = unlike <= unlike.min() + self.settings.same_spectrum
        matched: dict[tuple[int, int], ComponentMatch] = {}
        for i, j in np.argwhere(tried).tolist():
            with suppress(NotConvergedError):
                matched[i, j] = self._matched(i, j)
        if not matched:
            return [self._matched(0, 0)], False
        found = [
            [matched[each] for each in pairs if each in matched] for pairs in _assignments(*unlike.shape)
        ]
        best, *others = sorted((matches for matches in found if matches), key=_against)
        tied = others and _against(others[0])[:2] == _against(best)[:2]
        limit = self.pair.config.outcome.tie * _against(best)[2]
        return best, bool(tied and _against(others[0])[2] < limit)

    def _rivals(self, side: tuple[PreparedShape, ...]) -> list[int]:
        least = self.settings.rival_area * side[0].share
        return [i for i, shape in enumerate(side[: self.settings.most_rivals]) if shape.share >= least]

    def carried_ones(self, known: list[ComponentMatch]) -> list[ComponentMatch]:
        """Match the components that have a partner near where the known map carries them."""
        rows = _without(self.sources, [match.pair.source for match in known])
        columns = _without(self.targets, [match.pair.target for match in known])
        carrier = Carrier.of([(match.pair, match.result) for match in known], self.settings.falloff)
        if not (rows and columns and carrier):
            return []
        centres = {i: carrier.moved(self.sources[i]).mean(axis=0) for i in rows}
        cost = np.array([[self._cost(carrier, centres[i], i, j) for j in columns] for i in rows])
        chosen = [
            (rows[a], columns[b]) for a, b in zip(*linear_sum_assignment(cost)) if cost[a, b] < FAR_APART
        ]
        found = []
        for i, j in chosen:
            with suppress(NotConvergedError):
                found.append(self._matched(i, j, carrier))
        return found

    def _cost(self, carrier: Carrier, centre: FloatArray, i: int, j: int) -> float:
        """Weigh what speaks against two partners: place, size and spectrum; less than nothing if hints join them."""
        joined = self.given.joined
        if joined[i].any() or joined[:, j].any():
            return -float(joined[i, j]) if joined[i, j] else FAR_APART
        source, target, settings = self.sources[i], self.targets[j], self.settings
        place = carrier.offset(centre, target)
        size = abs(np.log(carrier.length_ratio(source, target))) / np.log(settings.most_length_ratio)
        if place > settings.most_apart or size > 1:
            return FAR_APART
        return float((place / settings.most_apart) ** 2 + size**2 + self._unlike(i, j))

    def _unlike(self, i: int, j: int) -> float:
        """Mean difference of the logarithms of the first eigenvalues of two bodies, which are of unit area."""
        spectra = [shape.laplace.values[1:] for shape in (self.sources[i], self.targets[j])]
        n = min(self.settings.spectrum_functions, *map(len, spectra))
        return float(np.abs(np.log(spectra[0][:n] / spectra[1][:n])).mean())

    def _matched(self, i: int, j: int, carrier: Carrier | None = None) -> ComponentMatch:
        """Match two components: by themselves, or starting from where they are carried to."""
        pair = ShapePair(self.sources[i], self.targets[j], self.pair.config)
        hints = self.given.on(pair)
        if carrier is None or hints.any:
            result = match_connected(pair, hints, self.timer, self.seed)
            return ComponentMatch(pair, result, hinted=hints.any)
        return self._carried(pair, carrier)

    def _carried(self, pair: ShapePair, carrier: Carrier) -> ComponentMatch:
        """Match two components that are carried to each other.

        A rigid thing, as an eye or a helmet, is where it is carried to; otherwise the map starts from there. The place
        decides what symmetry leaves open, if the component is near enough to what carries it.
        """
        held = carrier.gap(pair.target) <= self.settings.held
        result = self._placed(pair, carrier)
        if result and result.outcome.sureness >= Outcome.PARTIAL.sureness:
            if held or not pair.target.symmetries:
                return ComponentMatch(pair, result, "it moves along rigidly")
            result = replace(result, outcome=Outcome.SYMMETRY_AMBIGUOUS)
            return ComponentMatch(pair, result, "nothing near it tells how it is turned")
        led = replace(pair, config=replace(pair.config, hypotheses="given", start="auto", part="none"))
        hints = Hints.of(led, None, carrier.image(pair.source, pair.target), None)
        result = match_connected(led, hints, self.timer, self.seed)
        if result.outcome is Outcome.HINTS_CONTRADICTED:
            result = replace(result, outcome=Outcome.LOW_CONFIDENCE)
            return ComponentMatch(pair, result, "its map does not agree with its place")
        measures = replace(result.quality, rival=np.inf, mirrored=np.inf)
        decided = outcome_of(pair, measures, pair.config.orientation)
        tied = decided is not result.outcome and not result.quality.rival < 1 / pair.config.outcome.tie
        if not (held and tied):
            return ComponentMatch(pair, result)
        result = replace(result, outcome=decided)
        return ComponentMatch(pair, result, "symmetric by itself, decided by its place")

    def _placed(self, pair: ShapePair, carrier: Carrier) -> MatchResult | None:
        """Map a component to the nearest points when it is carried along rigidly; None if it does not fit there."""
        moved, there = carrier.turned(pair.source), cast(Mesh, pair.target.body).vertices
        points = pair.target.index.points(there, moved)
        gap = np.linalg.norm(points.interpolation(len(there)) @ there - moved, axis=1)
        if gap.mean() > self.settings.same_place:
            return None
        quality = measure_quality(pair, points, Hints.of(pair, None, None, None))
        return MatchResult(
            map=pair.source.correspondence(pair.target, points),
            outcome=outcome_of(pair, quality, pair.config.orientation),
            quality=quality,
            expected_error=pair.source.lift_smooth(expected_errors(pair, points)),
            alternatives=(),
            timings={},
            notes=(),
            engine=pair.source.distances.engine,
            origin="place",
            reason="",
            config=pair.config,
            seed=self.seed,
        )


def _against(matches: list[ComponentMatch]) -> tuple[int, int, float]:
    """Weigh what speaks against an assignment: first few pairs, then the least sure, then misfits and unequal scales."""
    noise = matches[0].pair.config.selection.misfit_noise
    misfits = [np.nan_to_num(match.result.quality.misfit, nan=np.inf) for match in matches]
    sureness = min(match.result.outcome.sureness for match in matches)
    spread = np.std([np.log(match.pair.source.scale / match.pair.target.scale) for match in matches])
    return -len(matches), -sureness, float(np.maximum(misfits, noise).mean() + spread)


def _assignments(n: int, m: int) -> list[list[tuple[int, int]]]:
    """All ways to assign n things to m, or the other way round if these are fewer."""
    if n > m:
        return [[(i, j) for j, i in pairs] for pairs in _assignments(m, n)]
    return [list(enumerate(chosen)) for chosen in permutations(range(m), n)]


def _without(side: tuple[PreparedShape, ...], matched: list[PreparedShape]) -> list[int]:
    """Numbers of the components that are not yet matched."""
    return [i for i, shape in enumerate(side) if not any(shape is other for other in matched)]


def _composed(
    pair: ShapePair, matches: list[ComponentMatch], tied: bool, given: _Given, timer: StageTimer
) -> MatchResult:
    """Sum up the maps of all pairs of components; the first is the main one."""
    main, *others = matches
    bounds = pair.config.outcome
    counted = [
        match.result.outcome
        for match in matches
        if match is main or match.share > bounds.large_component or match.hinted
    ]
    unmatched = [_unpartnered(side, [getattr(match.pair, side) for match in matches], pair) for side in SIDES]
    if max(left_out for left_out, _ in unmatched) > bounds.large_component:
        counted.append(Outcome.PARTIAL)
    notes = [*main.result.notes, *(_described(match) for match in others)]
    if tied:
        counted.append(Outcome.SYMMETRY_AMBIGUOUS)
        notes.append("the largest components may as well be exchanged: nothing tells which are partners")
    if lost := len(given.landmarks) - sum(len(given.landmarks_on(match.pair)) for match in matches):
        notes.append(
            f"{lost} of {len(given.landmarks)} landmarks do not lie on partners, or fewer than {FEWEST_POINTS} on one, "
            "and are left out"
        )
    vertices, corners, weights = (getattr(main.result.map, name).copy() for name in MAP_ARRAYS)
    errors = main.result.expected_error.copy()
    for match in others:
        new = match.result.map.matched & (vertices == UNMATCHED)
        for array, name in zip((vertices, corners, weights), MAP_ARRAYS):
            array[new] = getattr(match.result.map, name)[new]
        errors[new] = match.result.expected_error[new] * np.sqrt(
            match.pair.target.share / main.pair.target.share
        )
    whole = replace(main.result.map, vertices=vertices, faces=corners, barycentric=weights)
    quality = replace(
        main.result.quality,
        matched=float(whole.matched.mean()),
        coverage=sum(match.pair.target.share * match.result.quality.coverage for match in matches),
    )
    return replace(
        main.result,
        map=whole,
        outcome=Outcome.least_sure(counted),
        quality=quality,
        expected_error=errors,
        notes=(*notes, *(note for _, side_notes in unmatched for note in side_notes)),
        timings=timer.stop(),
    )


def _unpartnered(side: str, matched: list[PreparedShape], pair: ShapePair) -> tuple[float, list[str]]:
    """Share of one shape that is unmatched, of the area or of the vertices, and a note on each component of it."""
    components = getattr(pair, side).components
    alone = [components[i] for i in _without(components, matched)]
    notes = [f"{side}: {_named(shape)} has no partner and is left unmatched" for shape in alone]
    tiny = 1 - sum(shape.share for shape in components)
    if tiny > 1e-9:
        notes.append(
            f"{side}: components that cannot be matched by themselves, with {tiny:.1%} of the area, are left unmatched"
        )
    area = tiny + sum(shape.share for shape in alone)
    return max(area, sum(map(_vertex_share, alone))), notes


def _vertex_share(shape: PreparedShape) -> float:
    return float((shape.body_vertex >= 0).mean())


def _named(shape: PreparedShape) -> str:
    size = f"{(shape.body_vertex >= 0).sum()} vertices, {shape.share:.1%} of the area"
    return f"the component of vertex {shape.user_vertex[0]} ({size})"


def _described(match: ComponentMatch) -> str:
    outcome = match.result.outcome.value + (f", {match.remark}" if match.remark else "")
    return f"{_named(match.pair.source)} is matched to {_named(match.pair.target)} of the target: {outcome}"
