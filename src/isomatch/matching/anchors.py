"""First maps of shapes without limbs: points far from each other, and then the signatures of all."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import assign_points, nearest_rows
from isomatch.matching.pair import ShapePair
from isomatch.runtime.threads import parallel_map
from isomatch.shapes import EXACTLY, farthest_rows
from isomatch.values.arrays import IntArray

SLIDE_STEPS = 10  # steps by which they move it; docs/lab/robustness.md, shapes without limbs

SLIDE_FUNCTIONS = 20  # functions by which signatures move a first map; the first before a judgement

BEAM = 200  # partial assignments that are kept; chosen, not measured

# of differences of signatures in the cost of an assignment; docs/lab/robustness.md, shapes without limbs
SIGNATURE_WEIGHT = 0.25

# points of the source, far from each other, that are assigned;
# three points determine an isometry, three more its errors
N_ANCHORS = 6

N_CANDIDATES = 200  # search vertices of the target among which their images are sought; as for symmetries

# mean distance, in units of the average distance, by which partial assignments that are kept differ;
# chosen, near selection.rival_distance; 0.1 with 80 starts is no better
APART = 0.15

N_STARTS = 48  # best assignments that become first maps; chosen: of the most that extremities give

# of differences of average distance in the cost of an assignment; as search.eccentricity_weight
ECCENTRICITY_WEIGHT = 0.3


def starts_from_anchors(pair: ShapePair) -> list[IntArray]:
    """First maps that need no extremities: target rows (m_s,) of the search vertices.

    Points of the source that are far from each other are assigned to target points, one after the other, so that
    distances and signatures agree. All other vertices go where their distances to these fit best. Such a map is then
    slid to where the signatures agree; see `slid`.
    """
    source, target = pair.source, pair.target
    here = source.distances_between(pair.source_vertices) / source.intrinsic_scale
    there = target.distances_between(pair.target_vertices) / target.intrinsic_scale
    signatures = pair.search_signatures
    n = N_CANDIDATES
    anchors = farthest_rows(here[:n, :n], N_ANCHORS)
    exact = here[np.ix_(anchors, anchors)]
    remoteness = np.abs(there.mean(axis=1)[:n] - here.mean(axis=1)[anchors, None])
    unlike = np.linalg.norm(signatures.target[:n] - signatures.source[anchors, None], axis=2)
    unary = ECCENTRICITY_WEIGHT * remoteness + SIGNATURE_WEIGHT * unlike
    assigned, _ = assign_points(there[:n, :n], exact, exact, unary, EXACTLY, BEAM, APART)
    starts = [nearest_rows(there[:, images], here[:, anchors]) for images in assigned[:N_STARTS]]
    return parallel_map(lambda start: slid(pair, start), starts)


def slid(pair: ShapePair, target_row: IntArray) -> IntArray:
    """Let the signatures move a map (m_s,) of the search vertices.

    Of a shape that is round, many maps keep distances, and iterative closest points stop at any of them. Few functions
    leave a map free to move along these directions; in each step, images are nearest neighbours in these functions and
    the signatures together.
    """
    spectra, signatures = pair.search_spectra, pair.search_signatures
    k = min(SLIDE_FUNCTIONS, pair.n_functions)
    for _ in range(SLIDE_STEPS):
        carried = spectra.target[:, :k] @ spectra.functional_map(target_row, k).T
        target_row = nearest_rows(
            np.hstack([carried / np.sqrt(k), signatures.target]),
            np.hstack([spectra.source.at_samples[:, :k] / np.sqrt(k), signatures.source]),
        )
    return target_row
