"""Model selection: which maps differ, which are worth refining, which survive, which wins, and which is its runner-up."""

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
Distances: TypeAlias = Callable[
    [V, Sequence[V]], FloatArray
]  # mean ones, between the images of a map and of others
R = TypeVar("R", bound=Fit)
M = TypeVar("M")
H = TypeVar("H", bound=Candidate | Fit)


def distinct(
    maps: Iterable[T],
    image: Callable[[T], V],
    distances: Distances[V],
    apart: float,
    most: int | None = None,
    before: Sequence[V] = (),
) -> list[T]:
    """Keep the first maps, at most so many, that are farther ``apart`` from those kept and from the images ``before``."""
    kept: list[T] = []
    images = list(before)
    for candidate in maps:
        if len(kept) == most:
            break
        own = image(candidate)
        if not images or (distances(own, images) > apart).all():
            kept.append(candidate)
            images.append(own)
    return kept


def distances_between(images: Sequence[V], distances: Distances[V]) -> Float[FloatArray, "q q"]:
    """Mean distance between the images of each two maps."""
    apart = np.zeros((len(images),) * 2)
    for i, own in enumerate(images):
        apart[i, :i] = apart[:i, i] = distances(own, images[:i]) if i else []
    return apart


def ranked(
    candidates: Sequence[Candidate],
    orientation: Orientation,
    settings: SelectionSettings,
    landmarks: bool = False,
) -> list[Candidate]:
    """Order candidates, best first; with landmarks, drop those that contradict them."""

    def rank(candidate: Candidate, wanted: Orientation = orientation) -> int:
        return _orientation_rank(candidate, wanted, settings)

    # without landmarks: the wanted orientation, then those not clearly of the other, then the rest; each by energy
    if not landmarks:
        return sorted(candidates, key=lambda c: (rank(c), c.energy))
    slack = min((c.landmark_error for c in candidates), default=0.0) + TIES.landmark_slack
    agreeing = sorted((c for c in candidates if c.landmark_error <= slack), key=lambda c: (rank(c), c.energy))
    # landmarks may ask for the other orientation: the wanted one comes first only where its energy is near the least
    limit = TIES.same_energy_ratio * min((c.energy for c in agreeing), default=0.0)
    return sorted(agreeing, key=lambda c: (rank(c) > 0 or c.energy > limit, rank(c, "any"), c.energy))


def contenders(
    order: Sequence[Candidate], orientation: Orientation, settings: SelectionSettings
) -> list[Candidate]:
    """Keep those near enough to the best to deserve a refinement: comparable energy, not of the other orientation."""
    if not order:
        return []
    # where limbs touch, the orientation of a right map through few functions can be small: all that lean to the wanted
    # side are let in, for the refinement compares normals everywhere
    side = max(1, _orientation_rank(order[0], orientation, settings))
    leaning = [c for c in order if _orientation_rank(c, orientation, settings) <= side]
    leaning.sort(key=lambda candidate: candidate.energy)
    # relative to the least energy of these, which the first of the ranking need not have
    limit = settings.energy_limit * max(leaning[0].energy, TIES.energy_noise)
    kept = [c for c in leaning if c.energy <= limit][: settings.most_contenders]
    # and one that agrees better with priors than any of these, on either side
    nearest = nearest_to_priors(order, TIES.landmark_slack)
    if not any(c in kept for c in nearest):
        kept.append(min(nearest, key=lambda c: c.energy))
    return kept


def nearest_to_priors(maps: Sequence[H], slack: float) -> list[H]:
    """Keep those that agree with the priors as well as any, but for a slack; all of them without priors."""
    limit = min(c.prior_error for c in maps) + slack
    return [c for c in maps if c.prior_error <= limit]


def _orientation_rank(candidate: Candidate, wanted: Orientation, settings: SelectionSettings) -> int:
    cosine = candidate.orientation
    kept = {"preserve": cosine, "reverse": -cosine, "any": abs(cosine)}[wanted]
    return 0 if kept > settings.orientation_threshold else 1 if kept > 0 else 2


def survivors(
    fits: Sequence[R], apart: FloatArray, settings: SelectionSettings, with_normals: bool, both_sides: bool
) -> list[tuple[int, int]]:
    """Choose what is refined further: indices of the fits kept, best first, and of those that they stand for."""
    q, oriented = range(len(fits)), settings.orientation_threshold
    # while normals take no part, a twisted map may fit well: it neither sets the standard nor replaces another
    clear = [i for i in q if with_normals or abs(fits[i].orientation) > oriented] or list(q)
    least = min(fits[i].spectral_residual for i in clear)
    limit = settings.spectral_residual_limit * max(least, TIES.spectral_residual_noise)
    order = sorted(q, key=lambda i: (i not in clear, fits[i].spectral_residual))
    # the best of those nearest to the priors goes on however badly it fits, and the best of each orientation if asked
    spared = [i for i in order if fits[i] in nearest_to_priors(fits, TIES.landmark_slack)][:1]
    if both_sides:
        spared += {fits[i].side: i for i in reversed(order)}.values()
    kept: list[tuple[int, int]] = []
    for i in order:
        if fits[i].spectral_residual > limit and i not in spared:
            continue
        same = next((n for n, (j, _) in enumerate(kept) if apart[i, j] <= settings.same_map), None)
        if same is None:
            kept.append((i, i))
        else:
            # of fits that coincide the best stays, for the hypothesis of least residual among those of its orientation:
            # the joint refinement does not depend on the start from here on, but the other refinements do
            j, standing_for = kept[same]
            if fits[i].side == fits[standing_for].side and fits[i].residual < fits[standing_for].residual:
                kept[same] = j, i
    return kept


def weighed(
    costs: Sequence[float],
    images: Sequence[Int[BodyVertices, "r"]],
    descriptor_distances: Sequence[Float[FloatArray, "r"]],
    distance: Callable[[BodyVertices, BodyVertices], FloatArray],
    eligible: Sequence[bool],
    weight: float,
) -> list[float]:
    """Multiply the costs of maps by the descriptor distance of their images where they differ from the best map."""
    # Two maps i, j that differ in a region R (where their images are > MAP_DISTANCE.other_place apart) are compared by
    #   c_i / c_j · exp(w (m̄_i − m̄_j)),   m̄ the mean over R of the descriptor distance:
    # the exponential makes the comparison of j with i the inverse of that of i with j. decisions.md, descriptor weight
    n = len(costs)
    lead = np.zeros((n, n))  # w (m̄_i − m̄_j), antisymmetric
    for i in range(n):
        for j in range(i):
            differences = descriptor_distances[i] - descriptor_distances[j]
            region = np.isfinite(differences) & (distance(images[i], images[j]) > MAP_DISTANCE.other_place)
            if region.mean() >= TIES.min_region_share:
                lead[i, j] = weight * differences[region].mean()
                lead[j, i] = -lead[i, j]
    # As R differs from pair to pair, three maps may beat each other in a ring. The best is the eligible one that loses
    # least to any other, min_i max_j c_i exp(lead_ij) / c_j; all costs are then those against it.
    against = np.array(costs)[:, None] * np.exp(lead)
    lost = against / np.maximum(costs, np.finfo(float).tiny)
    may_win = sorted(np.flatnonzero(eligible).tolist(), key=lambda i: costs[i])
    best = min(may_win, key=lambda i: lost[i, may_win].max())
    # another that may win never costs less than the best
    least = np.nextafter(costs[best], np.inf)
    return [
        costs[best] if i == best else float(max(cost, least) if eligible[i] else cost)
        for i, cost in enumerate(against[:, best])
    ]


@dataclass(frozen=True, kw_only=True)
class Rules:
    """What decides between refined maps."""

    # mean distance between images, in √area, from which a map is another, no variant
    runner_up_distance: float
    tie: float = 1.0  # score, against the least, up to which a map of its side ties with the best
    mirror_tie: float = 1.0  # the same for one of the other side
    landmark_slack: float = 0.0  # difference of prior errors, in √area, that counts for nothing
    score_noise: float = 0.0  # scores below this are equal
    # share of vertices sent far away, from which a nearer map is another, too,
    elsewhere_share: float = np.inf
    elsewhere_tie: float = 1.0  # if its score is at most so many times the winner's
    # a map whose score × this is below the winner's counts whatever priors say,
    clearly_better: float = np.inf
    same_map: float = 0.0  # unless it is nearer than this

    @classmethod
    def of(cls, settings: SelectionSettings, bounds: OutcomeSettings) -> Self:
        """Return the rules that settings state."""
        return cls(
            tie=bounds.tie,
            mirror_tie=bounds.mirror_tie,
            runner_up_distance=settings.runner_up_distance,
            landmark_slack=TIES.landmark_slack,
            score_noise=TIES.score_noise,
            elsewhere_share=TIES.exchanged_share,
            elsewhere_tie=TIES.exchanged_ratio,
            clearly_better=TIES.clearly_better_ratio,
            same_map=settings.same_map,
        )


@dataclass(frozen=True)
class Ranking(Generic[M]):
    """What was selected, and why."""

    best: M
    others: tuple[M, ...]  # all others, best first
    runner_up: float  # score of the runner-up over the winner's; 1: tie, inf: none came near, nan: none tried
    mirrored: float  # the same of the best map of the other orientation
    against: M | None = None  # the runner-up: the best other map, no variant
    priors_decided: bool = False  # whether another fits better, but ties, and agrees less with the priors
    distinct: tuple[
        M, ...
    ] = ()  # those of the runners-up that are told as alternatives, where ranking chose them


def select(
    fits: Sequence[R],
    apart: Float[FloatArray, "q q"],  # mean distances of images
    rules: Rules,
    *,
    scores: Sequence[float] | None = None,
    eligible: Sequence[bool] | None = None,
    elsewhere: Float[FloatArray, "q q"] | None = None,  # shares of vertices that two maps send far apart
    n_tried: int = 2,
) -> Ranking[R]:
    """Select the eligible map of least score; of those that tie with it, the one nearest to the priors."""
    costs = [fit.score for fit in fits] if scores is None else list(scores)
    noisy = [max(cost, rules.score_noise) for cost in costs]
    may_win = [i for i in range(len(fits)) if eligible is None or eligible[i]]
    best = min(may_win, key=lambda i: costs[i])

    def ties(i: int) -> bool:
        factor = rules.tie if fits[i].side == fits[best].side else rules.mirror_tie
        return noisy[i] <= factor * noisy[best]

    # winner = arg min cost over {i : c_i ≤ tie · c_best} whose prior errors are the least: priors decide ties,
    # nothing else
    tied = [i for i in may_win if ties(i)]
    nearest = nearest_to_priors([fits[i] for i in tied], rules.landmark_slack)
    winner = min((i for i in tied if fits[i] in nearest), key=lambda i: costs[i])
    others = sorted((i for i in range(len(fits)) if i != winner), key=lambda i: costs[i])

    # the ratio test: cost of the runner-up over that of the winner (Lowe 2004, § 7.1, with the roles turned)
    def ratio(runners_up: list[int]) -> float:
        if n_tried < 2:
            return np.nan
        if not runners_up:
            return np.inf
        ratio = noisy[runners_up[0]] / noisy[winner]
        return max(1.0, ratio) if runners_up[0] in may_win else ratio  # one that lost to priors ties

    def is_runner_up(i: int) -> bool:
        as_good = costs[i] <= rules.elsewhere_tie * costs[winner]  # below the noise, too
        exchanged = as_good and elsewhere is not None and elsewhere[i, winner] >= rules.elsewhere_share
        differs = exchanged or apart[i, winner] > rules.runner_up_distance
        agrees = fits[i].landmark_error <= fits[winner].landmark_error + rules.landmark_slack
        better = rules.clearly_better * noisy[i] < noisy[winner] and apart[i, winner] > rules.same_map
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
