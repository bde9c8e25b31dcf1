"""Challengers: maps from the other side and combinations of candidates, against the winner of the contest."""

from __future__ import annotations

from collections.abc import Sequence

from isomatch.matching.contest import CLEARLY_BETTER, ENERGY_NOISE, SAME_ENERGY, Selection, distinct
from isomatch.matching.fit import Candidate, Fit
from isomatch.matching.pair import ShapePair
from isomatch.matching.quality import mean_known
from isomatch.matching.screening import Screening, residual_of
from isomatch.matching.search import combinations, search_back
from isomatch.matching.stages import Relation
from isomatch.values.arrays import IntArray

MOST_CHALLENGERS = 2  # docs/lab/design_notes.md

# mean cosine between normals from which a challenger is refined; right maps have more, see SelectionSettings
RIGHT_ORIENTATION = 0.54

SURE = 0.75  # share of the bounds of a poor map, below which a map is sure; docs/lab/design_notes.md


def is_sure(relation: Relation, selection: Selection[Fit]) -> bool:
    """Whether no other map ties with the winner and it is far from poor by every measure, so that challengers lose."""
    winner, bounds = selection.winner, relation.pair.config.outcome
    areas = relation.source.body.vertex_areas[relation.vertices]
    return (
        selection.rival > bounds.tie
        and winner.misfit < SURE * bounds.poor_misfit
        and residual_of(relation.pair, relation.vertices, winner.image) < SURE * bounds.poor_residual
        and mean_known(relation.mismatch(winner), areas) < SURE * bounds.poor_mismatch
    )


def challengers(
    pair: ShapePair, screen: Screening, known: Sequence[IntArray], side: int, energy: float
) -> list[Candidate]:
    """Find maps other than those known, from the other side and by combination, that may be better than the winner.

    Parameters
    ----------
    pair : ShapePair
        The two shapes.
    screen : Screening
        Makes candidates of hypotheses.
    known : sequence of (m_s,) arrays of int
        Maps of the search vertices, best first.
    side : {1, -1}
        The orientation that is wanted.
    energy : float
        That of the winner.
    """
    found = distinct(
        [*(search_back(pair) if pair.config.search.both_ways else ()), *combinations(pair, known)],
        lambda hypothesis: hypothesis.target_row,
        pair.distances_between_maps,
        pair.config.search.same_map,
        known=known,
    )
    limit = SAME_ENERGY * max(energy, ENERGY_NOISE)
    hopeful = [
        candidate
        for candidate in screen(found)
        if candidate.energy <= limit and side * candidate.orientation > RIGHT_ORIENTATION
    ]
    return sorted(hopeful, key=lambda candidate: candidate.energy)[:MOST_CHALLENGERS]


def best_of(relation: Relation, winner: Fit, fits: Sequence[Fit]) -> Fit:
    """Compare refined challengers with the winner one after the other, those like it first, and return the best.

    They are many, and of many maps some fit well by chance. So one takes the winner's place only if it is better by
    every measure, or another map and clearly better.
    """
    first = winner
    for fit in sorted(fits, key=lambda fit: relation.target.mean_distance(fit.image, first.image)):
        winner = fit if _beats(relation, fit, winner) else winner
    return winner


def is_another(relation: Relation, fit: Fit, other: Fit) -> bool:
    """Whether a map is another one, and no variant."""
    apart = relation.target.mean_distance(fit.image, other.image)
    return apart > relation.pair.config.selection.rival_distance


def _beats(relation: Relation, challenger: Fit, winner: Fit) -> bool:
    """Whether a map is better by every measure, or another map and clearly better.

    What the surfaces look like counts between other maps only: where variants differ is too small a region.
    """
    fits = [challenger, winner]
    scores = [fit.score for fit in fits]
    if is_another(relation, challenger, winner):
        scores = relation.weighed(fits, scores, [True, True])
        if CLEARLY_BETTER * scores[0] < scores[1]:
            return True
    residuals = [residual_of(relation.pair, relation.vertices, fit.image) for fit in fits]
    return scores[0] < scores[1] and challenger.misfit < winner.misfit and residuals[0] < residuals[1]
