"""Hypotheses of an isometry, and candidates: with energy, orientation and agreement with priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from isomatch._core.arrays import BodyVertices, Int, IntArray, SearchRows
from isomatch._core.threads import parallel_map
from isomatch.correspondence import (
    Embedding,
    alignment_residual,
    iterative_closest_points,
    signed_procrustes,
    spectral_embedding,
)
from isomatch.matching.assessment.quality import mean_known
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.model import MatchingModel, RefiningModel
from isomatch.matching.parameters import SCREENING
from isomatch.matching.problem import Problem, Start, name_of
from isomatch.matching.proposals.flips import Pool, find_flips
from isomatch.matching.proposals.starts import (
    default_starts,
    first_maps_of,
    start_from_pairs,
    starts_from_anchors,
    starts_from_pose,
    starts_from_priors,
)
from isomatch.matching.selection import Ranking, rank_candidates
from isomatch.settings import Orientation
from isomatch.shapes import CURVATURE_WEIGHT, orientation_of


def hypotheses_from_priors(pair: Problem) -> list[Candidate]:
    """Hypotheses from priors, improved by iterative closest points."""
    # Landmarks at extremities do not tell the front of a thin body from its back. So further maps contend
    # with the map from landmarks: flips of it with hypotheses = "given", automatic hypotheses otherwise.
    settings = pair.config.search
    from_priors = []
    for start, origin in starts_from_priors(pair):
        moved = iterative_closest_points(*pair.search_points, start[None], SCREENING.n_prior_steps)
        from_priors.append(Candidate(moved[0], origin))
    from_landmarks = [start for start in from_priors if start.origin == "landmarks"]
    if not from_landmarks or not settings.flip_landmarks or pair.config.hypotheses == "all":
        return from_priors
    best = min(from_landmarks, key=lambda start: start.alignment.residual)
    return [*from_priors, *find_flips(pair, best, from_priors)]


def search(
    pair: Problem, from_priors: list[Candidate], starts: Sequence[Start] | None = None
) -> list[Candidate]:
    """Collect distinct hypotheses from priors, starts and flips; least residual first."""
    settings, starts = pair.config.search, default_starts if starts is None else starts
    pool = Pool(pair, SCREENING.max_hypotheses_without_limbs if pair.limbless else settings.n_hypotheses)
    pool.merge(from_priors)
    for start in starts:
        rows = [start_from_pairs(pair, pairs) for pairs, _ in first_maps_of([start], pair)]
        # Starts from anchors, on shapes without limbs, take no steps: closest points do not converge there,
        # and `relax_spectrally` has improved these starts.
        pool.add(rows, 0 if start is starts_from_anchors else settings.start_steps, name_of(start))
    if any(start in default_starts for start in starts):  # a user's own starts are not flipped
        pool.flip(pool.hypotheses[: settings.flipped], "flip")
    return pool.hypotheses


class Screening:
    """Makes candidates of hypotheses; the measures of equal maps are computed once."""

    def __init__(self, pair: Problem) -> None:
        self._pair, priors = pair, pair.priors
        self._known_maps: list[SearchRows] = []
        if len(priors.initial_pairs):
            self._known_maps = [start_from_pairs(pair, priors.initial_pairs)]
        elif pair.config.start == "pose" and not len(priors.landmarks):
            self._known_maps = starts_from_pose(pair)
        self._screened: dict[bytes, Candidate] = {}

    def __call__(self, hypotheses: list[Candidate]) -> list[Candidate]:
        """Make a candidate of each hypothesis, in order."""
        keys = [hypothesis.alignment.target_row.tobytes() for hypothesis in hypotheses]
        new = {key: h for key, h in zip(keys, hypotheses) if key not in self._screened}
        self._screened |= zip(new, parallel_map(self._candidate, new.values()))
        return [
            replace(self._screened[key], alignment=h.alignment, origin=h.origin)
            for key, h in zip(keys, hypotheses)
        ]

    def _candidate(self, hypothesis: Candidate) -> Candidate:
        pair, settings = self._pair, self._pair.config.selection
        spectra = pair.search_spectra
        upsampled = spectra.fit_and_upsample(hypothesis.target_row, SCREENING.upsampling_sizes)
        target_row = SearchRows(spectra.image(upsampled))
        target_vertex = BodyVertices(pair.target_vertices[target_row])
        energy = energy_of(pair, pair.source_vertices, target_vertex, pair.config.search.rank)
        basis, n = spectra.source, settings.normal_functions
        orientation = orientation_of(pair.source, basis, pair.target, target_vertex, n)
        measures = target_row, energy, orientation, *self._errors(target_row)
        return Candidate(hypothesis.alignment, hypothesis.origin, *measures)

    def _errors(self, target_row: Int[SearchRows, "m_s"]) -> tuple[float, float]:
        """Return ``landmark_error`` and ``prior_error`` of a map, see `Candidate`."""
        pair, landmarks = self._pair, self._pair.priors.landmarks
        mean, worst = 0.0, min(pair.distances_between_maps(target_row, self._known_maps), default=0.0)
        if len(landmarks):
            image = extend_map(pair, target_row, BodyVertices(landmarks[:, 0]))
            errors = pair.target.distance(image, landmarks[:, 1])
            mean, worst = float(errors.mean()), max(worst, errors.max())
        return mean, float(worst)


def energy_of(
    pair: Problem,
    source_vertex: Int[BodyVertices, "q"],
    target_vertex: Int[BodyVertices, "q"],
    rank: int | None = None,
) -> float:
    """Energy of a map of body vertices: descriptor residual × curvature difference²."""
    # E = R · M² for a map f. The residual R = min_C ‖X_s − X_t(f) C‖ of the distance descriptors X (Shamai &
    # Kimmel 2017) finds every error except near-symmetries, which keep distances. Those are found by
    #   M = mean |H_t(f(i)) − H_s(i)| + mean ‖known_t(f(i)) − known_s(i)‖₁ / CURVATURE_WEIGHT,
    # where H is the standardised signed mean curvature, because a mirror image or a twist puts hollows on
    # bumps. Without curvature, the first term is 1. The second term compares functions known on both shapes.
    source, target = pair.source, pair.target
    residual = residual_of(pair, source_vertex, target_vertex, rank)
    difference = 1.0
    if pair.oriented:
        difference = np.abs(target.curvature[target_vertex] - source.curvature[source_vertex]).mean()
    known = pair.known.target[target_vertex] - pair.known.source[source_vertex]
    difference += np.abs(known).sum(axis=1).mean() / CURVATURE_WEIGHT
    return float(residual * difference**pair.config.selection.curvature_exponent)


def residual_of(
    pair: Problem,
    source_vertex: Int[BodyVertices, "q"],
    target_vertex: Int[BodyVertices, "q"],
    rank: int | None = None,
) -> float:
    """Descriptor residual of a map of body vertices; small if the map keeps distances."""
    points = pair.source.points.at(source_vertex, rank), pair.target.points.at(target_vertex, rank)
    return alignment_residual(*points, signed_procrustes(*points))


def extend_map(
    pair: Problem, target_row: Int[SearchRows, "m_s"], source_vertex: Int[BodyVertices, "q"]
) -> Int[BodyVertices, "q"]:
    """Extend a map of the search vertices to given source vertices, through a few functions."""
    # F = Φ_s⁺ Φ_t(f) (k, k) on the search vertices; vertex i goes to the row of Φ_t Fᵀ nearest to Φ_s(i)
    k = min(pair.config.selection.extension_functions, pair.n_functions)
    functional_map = pair.search_spectra.functional_map(target_row, k)
    functions = pair.source.laplace.vectors[source_vertex], pair.target.laplace.vectors
    of_source, of_target = spectral_embedding(functional_map, *functions)
    return BodyVertices(pair.target.index.vertices(of_target, of_source))


def first_map(
    pair: Problem, source_vertex: Int[IntArray, "q"], orientation: Orientation
) -> tuple[Int[BodyVertices, "q"], str]:
    """Map source vertices by the best hypothesis, from priors if there are any; also return its origin."""
    hypotheses = hypotheses_from_priors(pair) if pair.priors.any else search(pair, [])
    candidates, with_landmarks = Screening(pair)(hypotheses), bool(len(pair.priors.landmarks))
    order = rank_candidates(candidates, orientation, pair.config.selection, with_landmarks)
    image = extend_map(pair, order[0].target_row, BodyVertices(source_vertex))
    return image, order[0].origin


def is_sure(model: RefiningModel[Fit, Embedding], ranking: Ranking[Fit]) -> bool:
    """Whether no map ties with the best map, and three measures of the best map are far from poor."""
    winner, bounds = ranking.best, model.pair.config.outcome
    areas = model.source.body.vertex_areas[model.vertices]
    return (
        ranking.runner_up > bounds.tie
        and winner.spectral_residual < SCREENING.sure_fraction * bounds.poor_spectral_residual
        and residual_of(model.pair, model.vertices, winner.image)
        < SCREENING.sure_fraction * bounds.poor_residual
        and mean_known(model.descriptor_distance(winner), areas)
        < SCREENING.sure_fraction * bounds.poor_descriptor_distance
    )


def is_another(model: MatchingModel[Any, Any], fit: Fit, other: Fit) -> bool:
    """Whether two maps differ by more than variants of one map."""
    distance = model.target.mean_distance(fit.image, other.image)
    return distance > model.pair.config.selection.runner_up_distance
