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
    """First maps of a pair of which a shape has no limbs: from points far from each other."""
    # Assign anchors a_1 … a_6, one after the other, to points b_1 … b_6 of the target by a beam search. The cost is that
    # of violated distances d(b_p, b_q) = d(a_p, a_q), see `IntervalCost`, plus for each point p
    #   w_e |ē(a_p) − ē(b_p)| + w_σ ‖σ(a_p) − σ(b_p)‖,   ē the mean of d (eccentricity), σ the signatures,
    # d over the average distance. All other vertices go where their distances to the anchors fit best; then it is slid.
    if not pair.limbless:
        return []
    source, target = pair.source, pair.target
    here = source.distances_between(pair.source_vertices) / source.intrinsic_scale
    there = target.distances_between(pair.target_vertices) / target.intrinsic_scale
    signatures = pair.search_signatures
    n = ANCHORS.n_candidates
    anchors = farthest_rows(here[:n, :n], ANCHORS.n_anchors)
    exact, among = here[np.ix_(anchors, anchors)], there[:n, :n]
    sides = Intervals(exact, exact), Intervals(among, among)
    remoteness = np.abs(there.mean(axis=1)[:n] - here.mean(axis=1)[anchors, None])
    unlike = np.linalg.norm(signatures.target[:n] - signatures.source[anchors, None], axis=2)
    unary = pair.config.search.eccentricity_weight * remoteness + ANCHORS.signature_weight * unlike
    assigned, _ = assign_points(*sides, unary, EXACTLY, ANCHORS.beam_width, ANCHORS.same_assignment_distance)
    starts = [SearchRows(nearest_rows(there[:, x], here[:, anchors])) for x in assigned[: ANCHORS.n_starts]]
    return [
        search_pairs(pair, start)
        for start in parallel_map(lambda start: relax_spectrally(pair, start), starts)
    ]


def relax_spectrally(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Int[SearchRows, "m_s"]:
    """Let the signatures move a map of the search vertices."""
    # Of a round shape, many maps keep distances, and iterative closest points stop at any of them. Few functions leave
    # a map free to move along these directions: images are nearest neighbours in (Φ_t Fᵀ / √k, σ_t) of (Φ_s / √k, σ_s).
    spectra, signatures = pair.search_spectra, pair.search_signatures
    k = min(ANCHORS.n_relaxation_functions, pair.n_functions)
    for _ in range(ANCHORS.n_relaxation_steps):
        carried = spectra.target[:, :k] @ spectra.functional_map(target_row, k).T
        of_target = np.hstack([carried / np.sqrt(k), signatures.target])
        of_source = np.hstack([spectra.source.at_samples[:, :k] / np.sqrt(k), signatures.source])
        target_row = SearchRows(nearest_rows(of_target, of_source))
    return target_row
