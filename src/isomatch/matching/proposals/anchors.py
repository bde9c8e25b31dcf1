"""First maps from points far from each other, for shapes without limbs."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import BodyVertices, Int, SearchRows
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Intervals, assign_points, nearest_rows
from isomatch.matching.parameters import ANCHORS
from isomatch.matching.problem import Problem, search_pairs
from isomatch.shapes import EXACTLY, farthest_rows


def starts_from_anchors(pair: Problem) -> list[Int[BodyVertices, "m_s 2"]]:
    """First maps from points far from each other, if a shape has no limbs."""
    # A beam search assigns anchors a_1 … a_6 to points b_1 … b_6 of the target, one after the
    # other. Its cost is the error of d(b_p, b_q) = d(a_p, a_q), see `IntervalCost`, plus for each
    # point p
    #   w_e |ē(a_p) − ē(b_p)| + w_σ ‖σ(a_p) − σ(b_p)‖,
    # d in units of the average distance, ē the mean of d (eccentricity), σ the signatures. Each
    # other vertex goes where its distances to the anchors fit best; the map is then relaxed.
    if not pair.limbless:
        return []
    source, target = pair.source, pair.target
    on_source = source.distances_between(pair.source_vertices) / source.intrinsic_scale
    on_target = target.distances_between(pair.target_vertices) / target.intrinsic_scale
    signatures = pair.search_signatures
    n = ANCHORS.n_candidates
    anchors = farthest_rows(on_source[:n, :n], ANCHORS.n_anchors)
    of_anchors, of_candidates = on_source[np.ix_(anchors, anchors)], on_target[:n, :n]
    sides = Intervals(of_anchors, of_anchors), Intervals(of_candidates, of_candidates)
    remoteness = np.abs(on_target.mean(axis=1)[:n] - on_source.mean(axis=1)[anchors, None])
    unlike = np.linalg.norm(signatures.target[:n] - signatures.source[anchors, None], axis=2)
    unary = pair.config.search.eccentricity_weight * remoteness + ANCHORS.signature_weight * unlike
    assigned, _ = assign_points(*sides, unary, EXACTLY, ANCHORS.beam_width, ANCHORS.same_assignment_distance)
    starts = [
        SearchRows(nearest_rows(on_target[:, x], on_source[:, anchors])) for x in assigned[: ANCHORS.n_starts]
    ]
    return [
        search_pairs(pair, start)
        for start in parallel_map(lambda start: relax_spectrally(pair, start), starts)
    ]


def relax_spectrally(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Int[SearchRows, "m_s"]:
    """Improve a map of the search vertices by signatures and a few functions."""
    # Many maps between round shapes keep distances, and iterative closest points stop at any of
    # them. A few functions leave a map free to move towards agreeing signatures: the image of i is
    # the nearest row of (Φ_t Fᵀ / √k, σ_t) to row i of (Φ_s / √k, σ_s).
    spectra, signatures = pair.search_spectra, pair.search_signatures
    k = min(ANCHORS.n_relaxation_functions, pair.n_functions)
    for _ in range(ANCHORS.n_relaxation_steps):
        carried = spectra.target[:, :k] @ spectra.functional_map(target_row, k).T
        of_target = np.hstack([carried / np.sqrt(k), signatures.target])
        of_source = np.hstack([spectra.source.at_samples[:, :k] / np.sqrt(k), signatures.source])
        target_row = SearchRows(nearest_rows(of_target, of_source))
    return target_row
