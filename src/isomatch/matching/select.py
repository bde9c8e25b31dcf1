"""The selector: from candidates and their evidence, plain numbers, to those worth refining, a winner and its rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from isomatch.settings import Orientation, OutcomeSettings, SelectionSettings
from isomatch.values.arrays import FloatArray


class Evidence(Protocol):
    """What is known of a candidate before it is refined."""

    @property
    def energy(self) -> float:
        """Descriptor residual × curvature mismatch²; lower is better."""

    @property
    def orientation(self) -> float:
        """Mean cosine between normals: 1 preserves the orientation of the faces, −1 reverses it."""

    @property
    def landmark_error(self) -> float:
        """Mean error at the landmarks; 0 without any."""

    @property
    def hint_error(self) -> float:
        """How far the map is from what hints say; 0 without any."""


class RefinedEvidence(Protocol):
    """What is known of a refined candidate."""

    @property
    def misfit(self) -> float:
        """Mean distance from the images in the last coordinates; lower is better."""

    @property
    def score(self) -> float:
        """What speaks against the map: misfit × a power of the energy; nan before the end."""

    @property
    def residual(self) -> float:
        """Descriptor residual of the hypothesis, before any refinement."""

    @property
    def side(self) -> float:
        """1 if the map preserves orientation, −1 if it reverses it."""

    @property
    def landmark_error(self) -> float:
        """That of the candidate, before the refinement."""

    @property
    def hint_error(self) -> float:
        """That of the candidate, before the refinement."""

    @property
    def orientation(self) -> float:
        """That of the candidate, before the refinement."""


class Hinted(Protocol):
    """What can be compared with hints."""

    @property
    def hint_error(self) -> float:
        """How far a map is from what hints say, in √area; 0 without hints."""


H = TypeVar("H", bound=Hinted)
C = TypeVar("C", bound=Evidence)
R = TypeVar("R", bound=RefinedEvidence)


def ranked(
    candidates: Sequence[C], orientation: Orientation, settings: SelectionSettings, landmarks: bool = False
) -> list[C]:
    """Order candidates, best first; with landmarks, drop those that contradict them.

    First come those of the wanted orientation, then those not clearly of the other, then the rest; within each, the
    least energy. Landmarks may ask for the other orientation: with them, the wanted one comes first only where its energy
    is near the least.
    """

    def rank(candidate: C) -> int:
        return _orientation_rank(candidate.orientation, orientation, settings.orientation_threshold)

    if not landmarks:
        return sorted(candidates, key=lambda c: (rank(c), c.energy))
    slack = min((c.landmark_error for c in candidates), default=0.0) + settings.landmark_slack
    agreeing = sorted((c for c in candidates if c.landmark_error <= slack), key=lambda c: (rank(c), c.energy))
    limit = settings.same_energy * min((c.energy for c in agreeing), default=0.0)

    def clear(candidate: C) -> int:
        return _orientation_rank(candidate.orientation, "any", settings.orientation_threshold)

    return sorted(agreeing, key=lambda c: (rank(c) > 0 or c.energy > limit, clear(c), c.energy))


def contenders(order: Sequence[C], orientation: Orientation, settings: SelectionSettings) -> list[C]:
    """Keep those near enough to the best to deserve a refinement: comparable energy, not of the other orientation.

    Comparable is meant to the least energy among them, which the first of the ranking need not have. Where limbs touch,
    the orientation of a right map through few functions can be small. The refinement compares normals
    everywhere, so all that lean to the wanted side are let in. One that agrees better with hints than any of these is let
    in as well, on either side.
    """
    if not order:
        return []
    side = max(1, _orientation_rank(order[0].orientation, orientation, settings.orientation_threshold))
    leaning = [
        c
        for c in order
        if _orientation_rank(c.orientation, orientation, settings.orientation_threshold) <= side
    ]
    leaning.sort(key=lambda candidate: candidate.energy)
    limit = settings.energy_limit * max(leaning[0].energy, settings.energy_noise)
    kept = [c for c in leaning if c.energy <= limit][: settings.most_contenders]
    nearest = nearest_to_hints(order, settings)
    if not any(c in kept for c in nearest):
        kept.append(min(nearest, key=lambda c: c.energy))
    return kept


def nearest_to_hints(found: Sequence[H], settings: SelectionSettings) -> list[H]:
    """Keep those that agree with the hints as well as any, but for a slack; all of them without hints."""
    limit = min(c.hint_error for c in found) + settings.landmark_slack
    return [c for c in found if c.hint_error <= limit]


def _orientation_rank(cosine: float, wanted: Orientation, oriented: float) -> int:
    kept = {"preserve": cosine, "reverse": -cosine, "any": abs(cosine)}[wanted]
    return 0 if kept > oriented else 1 if kept > 0 else 2


def survivors(
    fits: Sequence[R], apart: FloatArray, settings: SelectionSettings, with_normals: bool, both_sides: bool
) -> list[tuple[int, int]]:
    """Choose what is refined further after a stage of the refinement.

    Parameters
    ----------
    fits : sequence of q refined candidates
    apart : (q, q) array of float
        Mean distance between the images of each two, in √area.
    settings : SelectionSettings
    with_normals : bool
        Whether normals took part in the stage. While they do not, a twisted map may fit well: it neither sets the
        standard nor replaces another.
    both_sides : bool
        Whether to keep the best of each orientation, however badly it fits. So is the best of those nearest to the hints.

    Returns
    -------
    list of (int, int)
        Indices of those kept, best first; and of the fit whose hypothesis each stands for. Of fits that coincide the best
        is kept, for the hypothesis of least residual among those of its orientation: what comes after the joint
        refinement does not depend on the start, but the other refinements do.
    """
    q = range(len(fits))
    clear = [
        i for i in q if with_normals or abs(fits[i].orientation) > settings.orientation_threshold
    ] or list(q)
    limit = settings.misfit_limit * max(min(fits[i].misfit for i in clear), settings.misfit_noise)
    order = sorted(q, key=lambda i: (i not in clear, fits[i].misfit))
    spared = [i for i in order if fits[i] in nearest_to_hints(fits, settings)][:1]
    if both_sides:
        spared += {fits[i].side: i for i in reversed(order)}.values()
    kept: list[tuple[int, int]] = []
    for i in order:
        if fits[i].misfit > limit and i not in spared:
            continue
        same = next((n for n, (j, _) in enumerate(kept) if apart[i, j] <= settings.same_map), None)
        if same is None:
            kept.append((i, i))
        else:
            j, standing_for = kept[same]
            if fits[i].side == fits[standing_for].side and fits[i].residual < fits[standing_for].residual:
                kept[same] = j, i
    return kept


@dataclass(frozen=True)
class Selection(Generic[R]):
    """What was selected, and why.

    Parameters
    ----------
    winner : refined candidate
    rivals : tuple of refined candidates
        All others, best first.
    rival, mirrored : float
        Score of the best rival that is another map, and of the best of the other orientation, over that of the winner;
        1 is a tie, below 1 it fits better but was not eligible; inf if no other came near; nan if only one was tried.
    reason : str
        One sentence.
    against : refined candidate, optional
        That rival.
    """

    winner: R
    rivals: tuple[R, ...]
    rival: float
    mirrored: float
    reason: str
    against: R | None = None


def select(
    fits: Sequence[R],
    eligible: Sequence[bool],
    apart: FloatArray,
    elsewhere: FloatArray,
    settings: SelectionSettings,
    bounds: OutcomeSettings,
    n_tried: int,
) -> Selection[R]:
    """Select the eligible candidate of least score; of those that tie with it, the one nearest to the hints.

    Parameters
    ----------
    fits : sequence of q refined candidates, at least one
    eligible : sequence of q bool
        Which of them may win. Others are rivals only.
    apart : (q, q) array of float
        Mean distance between the images of each two, in √area.
    elsewhere : (q, q) array of float
        Share of vertices that each two send to places far apart.
    settings : SelectionSettings
        ``rival_distance`` tells a rival from a variant of the winner; of those that fit as well, ``elsewhere_share``
        does, too. A variant that was not eligible, or a map that contradicts the landmarks more than the winner, counts
        where it is ``clearly_better``.
    bounds : OutcomeSettings
        ``tie`` and ``mirror_tie`` say what a tie is.
    n_tried : int
        Candidates that were compared at all, refined or not.

    Returns
    -------
    Selection
    """
    scores = [max(fit.score, settings.score_noise) for fit in fits]
    may_win = [i for i in range(len(fits)) if eligible[i]]
    best = min(may_win, key=lambda i: fits[i].score)
    tied = [
        i
        for i in may_win
        if scores[i] <= (bounds.tie if fits[i].side == fits[best].side else bounds.mirror_tie) * scores[best]
    ]
    nearest = nearest_to_hints([fits[i] for i in tied], settings)
    winner = min((i for i in tied if fits[i] in nearest), key=lambda i: fits[i].score)
    others = sorted((i for i in range(len(fits)) if i != winner), key=lambda i: fits[i].score)

    def ratio(rivals: list[int]) -> float:
        if n_tried < 2:
            return np.nan
        if not rivals:
            return np.inf
        ratio = scores[rivals[0]] / scores[winner]
        return max(1.0, ratio) if eligible[rivals[0]] else ratio  # one that lost to hints ties

    def speaks_against(i: int) -> bool:
        as_good = fits[i].score <= settings.elsewhere_tie * fits[winner].score  # below the noise, too
        exchanged = as_good and elsewhere[i, winner] >= settings.elsewhere_share
        differs = exchanged or apart[i, winner] > settings.rival_distance
        agrees = fits[i].landmark_error <= fits[winner].landmark_error + settings.landmark_slack
        better = settings.clearly_better * scores[i] < scores[winner] and apart[i, winner] > settings.same_map
        return (differs and agrees) or better

    rivals = [i for i in others if speaks_against(i)]
    rival = ratio(rivals)
    mirrored = ratio([i for i in others if fits[i].side != fits[winner].side])
    reason = f"least misfit × energy^{settings.energy_exponent:g}; {n_tried} candidates, {len(fits)} refined to the end"
    if winner != best:
        reason += "; of those that tie, it agrees best with the hints"
    if rival < np.inf:
        reason += f"; the best rival scores {rival:.2f} times as much"
    against = fits[rivals[0]] if rivals else None
    return Selection(fits[winner], tuple(fits[i] for i in others), rival, mirrored, reason, against)
