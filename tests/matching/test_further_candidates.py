"""Further candidates: found where the search missed the right map, and compared with a winner that is not sure."""

import numpy as np
import pytest

from isomatch.correspondence import iterative_closest_points
from isomatch.matching import Hypothesis, Isometry, Priors, prepare_pair
from isomatch.matching.candidates import Screening, best_of, further_candidates
from isomatch.runtime.stage_timer import StageTimer
from isomatch_lab.procedural import creature


@pytest.fixture(scope="module")
def matched():
    """Two bipeds, what their match selected, and both maps that are its winner on one half and mirrored on the other."""
    source, target = (creature(2000, kind="biped", pose=i, triangulation=i) for i in (1, 2))
    pair = prepare_pair(source.mesh, target.mesh)
    relation = Isometry().on(pair, Priors.of(pair, None, None, None))
    match = relation.match(StageTimer())
    mirrored = min(match.eligible, key=lambda candidate: candidate.orientation)
    two = match.selection.winner.candidate.target_row, mirrored.target_row
    half = pair.source.laplace.vectors[pair.source_vertices, 1] > 0
    rows = np.array([np.where(half, *two), np.where(half, *two[::-1])])
    moved = iterative_closest_points(*pair.search_points, rows, 0)
    mixed = Screening(pair, relation.priors)([Hypothesis(alignment, "mixed") for alignment in moved])
    return relation, match.selection, mixed, list(rows)


@pytest.mark.long
def test_the_right_map_is_among_the_further_candidates_of_mixed_ones(matched):
    relation, selection, mixed, known = matched
    pair, right = relation.pair, selection.winner.candidate.target_row
    assert min(pair.distances_between_maps(right, known)) > 0.1
    energy = min(candidate.energy for candidate in mixed)
    screen = Screening(pair, relation.priors)
    found = further_candidates(pair, screen, known, 1, energy)
    assert min(pair.distances_between_maps(right, [c.target_row for c in found])) < 0.03


@pytest.mark.long
def test_the_right_map_beats_mixed_ones_and_is_not_beaten(matched):
    relation, selection, mixed, _ = matched
    right = selection.winner
    wrong = [relation.measured(fit, fit.image) for fit in relation.begun(mixed)]
    assert best_of(relation, right, wrong) is right
    assert best_of(relation, wrong[0], [wrong[1], right]) is right
    assert best_of(relation, right, []) is right
