"""Selection among maps: which differ, which are refined, which wins, and the runner-up."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, Self, TypeAlias, TypeVar

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.parameters import MAP_DISTANCE, TIES
from isomatch.settings import Orientation, OutcomeSettings, SelectionSettings

T = TypeVar("T")
V = TypeVar("V", bound=IntArray)  # images, in any index space
Distances: TypeAlias = Callable[[V, Sequence[V]], FloatArray]  # mean distances from one map to several maps
R = TypeVar("R", bound=Fit)
M = TypeVar("M")
H = TypeVar("H", bound=Candidate | Fit)


def keep_distinct(
    maps: Iterable[T],
    image_of: Callable[[T], V],
    distances: Distances[V],
    min_distance: float,
    most: int | None = None,
    before: Sequence[V] = (),
) -> list[T]:
    """Keep the first maps, at most ``most``, that differ from each other and ``before``."""
    kept: list[T] = []
    images = list(before)
    for candidate in maps:
        if len(kept) == most:
            break
        image = image_of(candidate)
        if not images or (distances(image, images) > min_distance).all():
            kept.append(candidate)
            images.append(image)
    return kept


def distances_between(images: Sequence[V], distances: Distances[V]) -> Float[FloatArray, "q q"]:
    """Mean distance between the images of each two maps."""
    matrix = np.zeros((len(images),) * 2)
    for i, image in enumerate(images):
        matrix[i, :i] = matrix[:i, i] = distances(image, images[:i]) if i else []
    return matrix


def rank_candidates(
    candidates: Sequence[Candidate],
    orientation: Orientation,
    settings: SelectionSettings,
    landmarks: bool = False,
) -> list[Candidate]:
    """Order candidates, best first; with landmarks, drop candidates that contradict them."""

    def rank(candidate: Candidate, wanted: Orientation = orientation) -> int:
        return _orientation_rank(candidate, wanted, settings)

    # without landmarks, candidates of the wanted orientation come first, then unclear ones, then candidates
    # of the other orientation; within each group, they are ordered by energy
    if not landmarks:
        return sorted(candidates, key=lambda c: (rank(c), c.energy))
    slack = min((c.landmark_error for c in candidates), default=0.0) + TIES.landmark_slack
    agreeing = sorted((c for c in candidates if c.landmark_error <= slack), key=lambda c: (rank(c), c.energy))
    # landmarks may require the other orientation: candidates of the wanted one come first only if their
    # energy is close to the least
    limit = TIES.same_energy_ratio * min((c.energy for c in agreeing), default=0.0)
    return sorted(agreeing, key=lambda c: (rank(c) > 0 or c.energy > limit, rank(c, "any"), c.energy))


def select_contenders(
    order: Sequence[Candidate], orientation: Orientation, settings: SelectionSettings
) -> list[Candidate]:
    """Select candidates for refinement: comparable in energy, not of the other orientation."""
    if not order:
        return []
    # Where limbs touch, few functions may give a right map a small mean cosine of normals. So a positive
    # cosine is enough here: the refinement compares normals everywhere.
    max_rank = max(1, _orientation_rank(order[0], orientation, settings))
    oriented = [c for c in order if _orientation_rank(c, orientation, settings) <= max_rank]
    oriented.sort(key=lambda candidate: candidate.energy)
    limit = settings.energy_limit * max(oriented[0].energy, TIES.energy_noise)
    kept = [c for c in oriented if c.energy <= limit][: settings.most_contenders]
    # a candidate that agrees better with the priors than the kept ones is added, whatever its orientation
    nearest = nearest_to_priors(order, TIES.landmark_slack)
    if not any(c in kept for c in nearest):
        kept.append(min(nearest, key=lambda c: c.energy))
    return kept


def nearest_to_priors(maps: Sequence[H], slack: float) -> list[H]:
    """Keep the maps whose prior error is the least, up to a slack; all of them without priors."""
    limit = min(c.prior_error for c in maps) + slack
    return [c for c in maps if c.prior_error <= limit]


def _orientation_rank(candidate: Candidate, wanted: Orientation, settings: SelectionSettings) -> int:
    cosine = candidate.orientation
    kept = {"preserve": cosine, "reverse": -cosine, "any": abs(cosine)}[wanted]
    return 0 if kept > settings.orientation_threshold else 1 if kept > 0 else 2


def select_survivors(
    fits: Sequence[R],
    distances: FloatArray,
    settings: SelectionSettings,
    with_normals: bool,
    both_sides: bool,
) -> list[tuple[int, int]]:
    """Select the fits to refine further: index of each, and of the candidate it represents."""
    indices, oriented = range(len(fits)), settings.orientation_threshold
    # Without normals, a twisted map may fit well. So maps of unclear orientation set no limit and replace no
    # map.
    clear = [i for i in indices if with_normals or abs(fits[i].orientation) > oriented] or list(indices)
    least = min(fits[i].spectral_residual for i in clear)
    limit = settings.spectral_residual_limit * max(least, TIES.spectral_residual_noise)
    order = sorted(indices, key=lambda i: (i not in clear, fits[i].spectral_residual))
    # of the fits nearest to the priors, the best is kept, and with ``both_sides`` the best of each
    # orientation
    spared = [i for i in order if fits[i] in nearest_to_priors(fits, TIES.landmark_slack)][:1]
    if both_sides:
        spared += {fits[i].side: i for i in reversed(order)}.values()
    kept: list[tuple[int, int]] = []
    for i in order:
        if fits[i].spectral_residual > limit and i not in spared:
            continue
        same = next((n for n, (j, _) in enumerate(kept) if distances[i, j] <= settings.same_map), None)
        if same is None:
            kept.append((i, i))
        else:
            # Of fits that coincide, the best is kept. It represents the candidate of least residual among
            # those of its orientation, because later refinements may begin from a candidate.
            j, represented = kept[same]
            if fits[i].side == fits[represented].side and fits[i].residual < fits[represented].residual:
                kept[same] = j, i
    return kept


def weigh_costs(
    costs: Sequence[float],
    images: Sequence[Int[BodyVertices, "r"]],
    descriptor_distances: Sequence[Float[FloatArray, "r"]],
    distance: Callable[[BodyVertices, BodyVertices], FloatArray],
    eligible: Sequence[bool],
    weight: float,
) -> list[float]:
    """Weigh costs of maps by descriptor distances where they differ from the best map."""
    # Let two maps i, j differ in a region R, where their images are farther apart than
    # MAP_DISTANCE.other_place. With their costs c_i, c_j, and their mean descriptor distances m̄_i, m̄_j over
    # R, they are compared by c_i / c_j · exp(weight · (m̄_i − m̄_j)); comparing j with i gives the inverse:
    # decisions.md, descriptor weight.
    n = len(costs)
    exponent = np.zeros((n, n))  # w (m̄_i − m̄_j), antisymmetric
    for i in range(n):
        for j in range(i):
            differences = descriptor_distances[i] - descriptor_distances[j]
            region = np.isfinite(differences) & (distance(images[i], images[j]) > MAP_DISTANCE.other_place)
            if region.mean() >= TIES.min_region_share:
                exponent[i, j] = weight * differences[region].mean()
                exponent[j, i] = -exponent[i, j]
    # R depends on the pair of maps, so three maps may beat each other in a cycle. The best map is the
    # eligible map i whose largest ratio, max_j c_i exp(exponent_ij) / c_j, is least; all costs are weighed
    # against this map.
    weighed = np.array(costs)[:, None] * np.exp(exponent)
    ratios = weighed / np.maximum(costs, np.finfo(float).tiny)
    may_win = sorted(np.flatnonzero(eligible).tolist(), key=lambda i: costs[i])
    best = min(may_win, key=lambda i: ratios[i, may_win].max())
    # An eligible map whose weighed cost is not above the cost of the best map gets the number just above that
    # cost, so that the best map has the least cost.
    least = np.nextafter(costs[best], np.inf)
    return [
        costs[best] if i == best else float(max(cost, least) if eligible[i] else cost)
        for i, cost in enumerate(weighed[:, best])
    ]


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Bounds that decide between refined maps."""

    runner_up_distance: float  # √area, mean; two maps whose images are farther apart are different
    # a map of the best map's orientation ties with it if the ratio of their scores is at most this
    tie: float = 1.0
    mirror_tie: float = 1.0  # the same bound for a map of the other orientation
    landmark_slack: float = 0.0  # √area; two prior errors that differ by less are equal
    score_noise: float = 0.0  # lower scores are raised to this
    # A map nearer to the winner is different, too, if it sends at least this share of the vertices far from
    # their images under the winner, and its score is at most this multiple of the winner's.
    exchanged_share: float = np.inf
    exchanged_ratio: float = 1.0
    # score of the winner over a map's, from which this map is a runner-up whatever the priors say
    clearly_better_ratio: float = np.inf
    same_map: float = 0.0  # √area, mean; a map whose images are nearer to the winner's is no such runner-up

    @classmethod
    def of(cls, settings: SelectionSettings, bounds: OutcomeSettings) -> Self:
        """Take the bounds from settings."""
        return cls(
            tie=bounds.tie,
            mirror_tie=bounds.mirror_tie,
            runner_up_distance=settings.runner_up_distance,
            landmark_slack=TIES.landmark_slack,
            score_noise=TIES.score_noise,
            exchanged_share=TIES.exchanged_share,
            exchanged_ratio=TIES.exchanged_ratio,
            clearly_better_ratio=TIES.clearly_better_ratio,
            same_map=settings.same_map,
        )


@dataclass(frozen=True)
class Ranking(Generic[M]):
    """The selected map, the others, and how clearly it leads."""

    best: M
    others: tuple[M, ...]  # all other maps, best first
    # score of the runner-up over the best map's; 1: a tie, inf: no runner-up, nan: no other map was tried
    runner_up: float
    mirrored: float  # score of the best map of the other orientation over the best map's
    against: M | None = None  # the runner-up: the map of least score that differs from the best map
    priors_decided: bool = False  # whether a map of less score lost, because it agrees less with priors
    distinct: tuple[M, ...] = ()  # runners-up that a model selected as alternatives


def select(
    fits: Sequence[R],
    distances: Float[FloatArray, "q q"],  # mean distances between the images of two maps
    rules: Rules,
    *,
    scores: Sequence[float] | None = None,
    eligible: Sequence[bool] | None = None,
    far_shares: Float[FloatArray, "q q"] | None = None,  # share of vertices that two maps send far apart
    n_tried: int = 2,
) -> Ranking[R]:
    """Select the eligible map of least score; priors decide among maps that tie with it."""
    costs = [fit.score for fit in fits] if scores is None else list(scores)
    noisy = [max(cost, rules.score_noise) for cost in costs]
    may_win = [i for i in range(len(fits)) if eligible is None or eligible[i]]
    best = min(may_win, key=lambda i: costs[i])

    def ties(i: int) -> bool:
        factor = rules.tie if fits[i].side == fits[best].side else rules.mirror_tie
        return noisy[i] <= factor * noisy[best]

    # the winner is the map of least cost among the maps of least prior error that tie with the best
    tied = [i for i in may_win if ties(i)]
    nearest = nearest_to_priors([fits[i] for i in tied], rules.landmark_slack)
    winner = min((i for i in tied if fits[i] in nearest), key=lambda i: costs[i])
    others = sorted((i for i in range(len(fits)) if i != winner), key=lambda i: costs[i])

    # cost of the runner-up over the cost of the winner: the ratio test of Lowe 2004, § 7.1, inverted
    def ratio(runners_up: list[int]) -> float:
        if n_tried < 2:
            return np.nan
        if not runners_up:
            return np.inf
        ratio = noisy[runners_up[0]] / noisy[winner]
        # an eligible map that costs less than the winner lost only because of the priors: this is a tie
        return max(1.0, ratio) if runners_up[0] in may_win else ratio

    def is_runner_up(i: int) -> bool:
        # these costs are compared as they are: raised to ``score_noise``, they might be equal
        as_good = costs[i] <= rules.exchanged_ratio * costs[winner]
        exchanged = as_good and far_shares is not None and far_shares[i, winner] >= rules.exchanged_share
        distance = distances[i, winner]
        differs = exchanged or distance > rules.runner_up_distance
        agrees = fits[i].landmark_error <= fits[winner].landmark_error + rules.landmark_slack
        better = rules.clearly_better_ratio * noisy[i] < noisy[winner] and distance > rules.same_map
        return bool((differs and agrees) or better)

    runners_up = [i for i in others if is_runner_up(i)]
    return Ranking(
        fits[winner],
        tuple(fits[i] for i in others),
        ratio(runners_up),
        ratio([i for i in others if fits[i].side != fits[winner].side]),
        fits[runners_up[0]] if runners_up else None,
        winner != best,
    )
