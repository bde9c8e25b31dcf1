"""Shapes of several components, such as bodies with eyes and clothes: which are partners, and one map of all."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import permutations
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from isomatch.errors import NotConvergedError
from isomatch.matching.carrier import Carrier
from isomatch.matching.component_hints import ComponentHints
from isomatch.matching.component_result import ComponentMatch, composed, numbers_without
from isomatch.matching.confidence import expected_errors
from isomatch.matching.contest import MISFIT_NOISE
from isomatch.matching.hints import Hints
from isomatch.matching.judge import Evidence, Solution, measured_evidence, outcome_of
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair
from isomatch.matching.quality import measure_quality
from isomatch.matching.stages import Stages
from isomatch.matching.windings import solve_either_winding
from isomatch.runtime.stage_timer import StageTimer
from isomatch.runtime.threads import parallel_map
from isomatch.shapes import PreparedShape, components_of
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray

MOST_RIVALS = 3  # components tried as partners of the largest; chosen: nine matches at most

# over that of the largest component, from which another may be the partner of the largest;
# hemispheres differ by less, clothes by more
RIVAL_AREA = 0.5

# mean difference of their logarithms, above the least, up to which a pair is tried;
# halves of creatures: poses 0.03, other halves 0.13
SAME_SPECTRUM = 0.1

# mean distance, in √area, up to which a component carried along rigidly fits;
# chosen: half the spacing of the search vertices
SAME_PLACE = 0.02

SPECTRUM_FUNCTIONS = 20  # eigenvalues that are compared; halves of creatures: poses 0.03, other halves 0.13

# distance from where a component is carried to, over its √area and its distance from the carriers;
# one eye is 0.9 from the other
MOST_APART = 0.7

MOST_LENGTH_RATIO = 1.4  # √area of one over that of its partner; as for the unit of a part

# power of the distance with which the influence of a carrying vertex decreases;
# chosen: sums over a surface converge from 2 on
FALLOFF = 4.0

# distance of a component from those that carry it, over its √area, up to which its place tells how it is turned;
# chosen: a thing farther away than its own size may turn by itself
HELD = 1.0

FAR_APART = 1e6  # cost of components that are no partners


def match_components(
    pair: ShapePair,
    landmarks: ArrayLike | None,
    initial_map: ArrayLike | None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None,
    stages: Stages,
    timer: StageTimer,
) -> Solution:
    """Match shapes of which at least one has further components that can be matched by themselves.

    The largest components are matched first. Their map carries the others along, which tells partners, and where each of
    their vertices goes.

    Parameters and errors are those of `match`.
    """
    timer.start("components")
    parallel_map(components_of, (pair.source, pair.target))
    hints = ComponentHints(pair, landmarks, initial_map, initial_descriptors)
    components = _Components(pair, hints, stages, timer)
    matches, tied = components.large_ones()
    timer.start("components")
    matches += components.carried_ones(matches)
    timer.start("quality")
    return composed(pair, matches, tied, hints)


class _Components:
    """The components of both shapes, and which of them are partners."""

    def __init__(self, pair: ShapePair, hints: ComponentHints, stages: Stages, timer: StageTimer) -> None:
        self.pair, self.hints, self.stages, self.timer = pair, hints, stages, timer
        self.sources, self.targets = hints.sides

    def large_ones(self) -> tuple[list[ComponentMatch], bool]:
        """Match the largest components, and others nearly as large whose spectra do not tell which are partners.

        Returns also whether another assignment of them fits as well.
        """
        rows, columns = (self._rivals(side) for side in (self.sources, self.targets))
        joined = self.hints.joined[: len(rows), : len(columns)]
        if len(rows) == len(columns) == 1:
            return [self._matched(0, 0)], False
        if joined.any():
            chosen = zip(*linear_sum_assignment(-joined))
            return [self._matched(i, j) for i, j in chosen if joined[i, j]], False
        unlike = np.array([[self._unlike(i, j) for j in columns] for i in rows])
        tried = unlike <= unlike.min() + SAME_SPECTRUM
        matched: dict[tuple[int, int], ComponentMatch] = {}
        for i, j in np.argwhere(tried).tolist():
            with suppress(NotConvergedError):
                matched[i, j] = self._matched(i, j)
        if not matched:
            return [self._matched(0, 0)], False
        assignments = [
            [matched[numbers] for numbers in pairs if numbers in matched]
            for pairs in _assignments(*unlike.shape)
        ]
        best, *others = sorted((matches for matches in assignments if matches), key=_against)
        tied = others and _against(others[0])[:2] == _against(best)[:2]
        limit = self.pair.config.outcome.tie * _against(best)[2]
        return best, bool(tied and _against(others[0])[2] < limit)

    def _rivals(self, side: tuple[PreparedShape, ...]) -> list[int]:
        least = RIVAL_AREA * side[0].share
        return [i for i, shape in enumerate(side[:MOST_RIVALS]) if shape.share >= least]

    def carried_ones(self, matches: list[ComponentMatch]) -> list[ComponentMatch]:
        """Match the components that have a partner near where those matched already carry them."""
        rows = numbers_without(self.sources, [match.pair.source for match in matches])
        columns = numbers_without(self.targets, [match.pair.target for match in matches])
        carrier = Carrier.of([match.solution for match in matches], FALLOFF)
        if not (rows and columns and carrier):
            return []
        centres = {i: carrier.moved(self.sources[i]).mean(axis=0) for i in rows}
        cost = np.array([[self._cost(carrier, centres[i], i, j) for j in columns] for i in rows])
        chosen = [
            (rows[a], columns[b]) for a, b in zip(*linear_sum_assignment(cost)) if cost[a, b] < FAR_APART
        ]
        more = []
        for i, j in chosen:
            with suppress(NotConvergedError):
                more.append(self._matched(i, j, carrier))
        return more

    def _cost(self, carrier: Carrier, centre: FloatArray, i: int, j: int) -> float:
        """Return the cost of taking two components for partners: place, size, spectrum; negative if hints join them."""
        joined = self.hints.joined
        if joined[i].any() or joined[:, j].any():
            return -float(joined[i, j]) if joined[i, j] else FAR_APART
        source, target = self.sources[i], self.targets[j]
        place = carrier.offset(centre, target)
        size = abs(np.log(carrier.length_ratio(source, target))) / np.log(MOST_LENGTH_RATIO)
        if place > MOST_APART or size > 1:
            return FAR_APART
        return float((place / MOST_APART) ** 2 + size**2 + self._unlike(i, j))

    def _unlike(self, i: int, j: int) -> float:
        """Mean difference of the logarithms of the first eigenvalues of two bodies, which are of unit area."""
        spectra = [shape.laplace.values[1:] for shape in (self.sources[i], self.targets[j])]
        n = min(SPECTRUM_FUNCTIONS, *map(len, spectra))
        return float(np.abs(np.log(spectra[0][:n] / spectra[1][:n])).mean())

    def _matched(self, i: int, j: int, carrier: Carrier | None = None) -> ComponentMatch:
        """Match two components: by themselves, or starting from where they are carried to."""
        pair = ShapePair(self.sources[i], self.targets[j], self.pair.config, self.pair.functions)
        hints = self.hints.on(pair)
        with self.timer.within(f"component {i + 1}"):
            if carrier is None or hints.any:
                solution = solve_either_winding(pair, hints, self.stages, self.timer)
                return ComponentMatch(solution, hinted=hints.any)
            self.timer.start("quality")
            return self._carried(pair, carrier)

    def _carried(self, pair: ShapePair, carrier: Carrier) -> ComponentMatch:
        """Match two components that are carried to each other.

        A rigid thing, as an eye or a helmet, is where it is carried to; otherwise the map starts from there. The place
        decides what symmetry leaves open, if the component is near enough to what carries it.
        """
        held = carrier.gap(pair.target) <= HELD
        placed = self._placed(pair, carrier)
        if placed and placed.outcome.sureness >= Outcome.PARTIAL.sureness:
            if held or not pair.target.symmetries:
                return ComponentMatch(placed, "it moves along rigidly")
            turned = placed.with_evidence(Evidence(ambiguous=True))
            return ComponentMatch(turned, "nothing near it tells how it is turned")
        carried = replace(pair, config=replace(pair.config, hypotheses="given", start="auto", part="none"))
        hints = Hints.of(carried, None, carrier.image(pair.source, pair.target), None)
        solution = replace(solve_either_winding(carried, hints, self.stages, self.timer), pair=pair)
        if solution.outcome is Outcome.HINTS_CONTRADICTED:
            doubted = replace(solution, evidence=(Evidence(poor=True),))
            return ComponentMatch(doubted, "its map does not agree with its place")
        measures = replace(solution.quality, rival=np.inf, mirrored=np.inf)
        decided = measured_evidence(pair, measures, pair.config.orientation)
        differs = outcome_of([decided]) is not solution.outcome
        tied = differs and not solution.quality.rival < 1 / pair.config.outcome.tie
        if self.stages.relation is not None or not (held and tied):
            return ComponentMatch(solution)
        unlike = tuple(region for region in solution.regions if region.rival is None)
        by_place = replace(solution, evidence=(decided,), regions=unlike)
        return ComponentMatch(by_place, "symmetric by itself, decided by its place")

    def _placed(self, pair: ShapePair, carrier: Carrier) -> Solution | None:
        """Map a component to the nearest points when it is carried along rigidly; None if it does not fit there."""
        moved, there = carrier.turned(pair.source), cast(Mesh, pair.target.body).vertices
        points = pair.target.index.points(there, moved)
        gap = np.linalg.norm(points.interpolation(len(there)) @ there - moved, axis=1)
        if gap.mean() > SAME_PLACE:
            return None
        quality = measure_quality(pair, points, Hints.of(pair, None, None, None))
        return Solution(
            pair,
            pair.source.correspondence(pair.target, points),
            quality,
            (measured_evidence(pair, quality, pair.config.orientation),),
            pair.source.lift_smooth(expected_errors(pair, points)),
            origin="place",
        )


def _against(matches: list[ComponentMatch]) -> tuple[int, int, float]:
    """Return the sort key of an assignment, the best least: few pairs cost most, then an unsure one, then misfits."""
    misfits = [np.nan_to_num(match.solution.quality.misfit, nan=np.inf) for match in matches]
    sureness = min(match.solution.outcome.sureness for match in matches)
    spread = np.std([np.log(match.pair.source.scale / match.pair.target.scale) for match in matches])
    return -len(matches), -sureness, float(np.maximum(misfits, MISFIT_NOISE).mean() + spread)


def _assignments(n: int, m: int) -> list[list[tuple[int, int]]]:
    """All ways to assign n things to m, or the other way round if these are fewer."""
    if n > m:
        return [[(i, j) for j, i in pairs] for pairs in _assignments(m, n)]
    return [list(enumerate(chosen)) for chosen in permutations(range(m), n)]
