"""Hypotheses of an isometry: first maps after iterative closest points, and flips."""

from __future__ import annotations

from collections.abc import Sequence

from isomatch.correspondence import iterative_closest_points
from isomatch.matching.maps import Candidate
from isomatch.matching.parameters import SCREENING
from isomatch.matching.problem import Problem, Start, name_of
from isomatch.matching.proposals.anchors import starts_from_anchors
from isomatch.matching.proposals.flips import Pool, find_flips
from isomatch.matching.proposals.from_priors import start_from_pairs, starts_from_priors
from isomatch.matching.proposals.starts import default_starts, first_maps_of


def hypotheses_from_priors(pair: Problem) -> list[Candidate]:
    """Hypotheses from priors, improved by iterative closest points."""
    # landmarks at extremities do not separate front and back of a thin body: with hypotheses =
    # "given", flips of the map from landmarks contend, otherwise automatic hypotheses do
    settings = pair.config.search
    from_priors = [
        Candidate(
            iterative_closest_points(*pair.search_points, start[None], SCREENING.n_prior_steps)[0], origin
        )
        for start, origin in starts_from_priors(pair)
    ]
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
        # closest points do not converge reliably on round shapes, and `relax_spectrally` has
        # already improved the maps from anchors
        pool.add(rows, 0 if start is starts_from_anchors else settings.start_steps, name_of(start))
    if any(start in default_starts for start in starts):  # a user's own starts are not flipped
        pool.flip(pool.hypotheses[: settings.flipped], "flip")
    return pool.hypotheses
