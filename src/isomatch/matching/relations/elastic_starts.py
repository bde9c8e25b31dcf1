"""First maps between shapes that are far from isometric: a beam search over anchors with a cost that forgives stretch."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import IntervalCost, assign_points, pin_first
from isomatch.matching.pair import ShapePair
from isomatch.matching.relations.elastic_shape import ElasticShape
from isomatch.shapes import PreparedShape, farthest_rows
from isomatch.values.arrays import FloatArray, IntArray

# bound of the cost of a distance, see `IntervalCost`; chosen on pairs of animals, not one by one
MOST_COST = 0.6

SOFT = 0.2  # of the same cost; chosen, not measured

BEAM = 600  # partial assignments that are kept; chosen on pairs of animals, not one by one

APART = 0.12  # mean distance, in average distances, by which they differ; as in parts

# starts that do not compare distances from the mirror image, where both shapes have one;
# docs/lab/robustness.md, other species
N_PLAIN_STARTS = 30

# weight of differences of the distance from the mirror image; chosen: as much as the average distance; not measured
ASIDE_COST = 1.0

# largest such distance that counts, in average distances; chosen: as much as the average distance; not measured
MOST_ASIDE = 1.0

# weight of the share of the area that is less remote; chosen on pairs of animals, not one by one
REMOTENESS_COST = 0.5

SIGNATURE_COST = 0.1  # weight of the signatures; chosen on pairs of animals, not one by one

# points of the target among which images are sought; chosen: spacing 0.09, less than APART
N_CANDIDATES = 150

N_ANCHORS = 12  # points of the source that are assigned; chosen on pairs of animals, not one by one


def anchor_starts(
    pair: ShapePair, landmarks: IntArray, shapes: tuple[ElasticShape, ElasticShape] | None = None
) -> list[IntArray]:
    """Assign anchors of the source to points of the target: arrays (m, 2) of vertices.

    Distances, in units of the average, may differ by a factor before they cost anything, and cost no more than a bound:
    a tail that is twice as long must not outweigh everything else. Anchors are landmarks, extremities, then points far
    from these. Where both ``shapes`` have mirror images, most starts also compare how far points are from theirs: heads
    and tails lie in the plane of symmetry, legs do not. Some do without, as mirror images may be wrong in places.
    """
    source, target, settings = pair.source, pair.target, pair.config.elastic
    anchors, between = _anchors(source, landmarks[:, 0], N_ANCHORS)
    candidates = np.unique(
        np.concatenate([landmarks[:, 1], target.extremities, target.sample_vertices[:N_CANDIDATES]])
    )
    of_source, of_target = pair.signatures
    unlike = np.abs(of_source[anchors, None] - of_target[candidates]).mean(axis=2)
    unary = SIGNATURE_COST * np.minimum(unlike / max(unlike.mean(), 1e-12), 2.0)
    remote = _remoteness(source)[anchors, None], _remoteness(target)[candidates]
    unary += REMOTENESS_COST * np.abs(remote[0] - remote[1])
    kinds = [(unary, settings.n_starts)]
    if shapes and all(shape.mirrored is not None for shape in shapes):
        aside = [np.minimum(shape.aside / shape.prepared.intrinsic_scale, MOST_ASIDE) for shape in shapes]
        unlike = np.abs(aside[0][anchors, None] - aside[1][candidates])
        kinds = [(unary + ASIDE_COST * unlike, settings.n_starts), (unary, N_PLAIN_STARTS)]

    def assigned(cost: FloatArray, count: int) -> IntArray:
        pin_first(cost, np.searchsorted(candidates, landmarks[:, 1]))
        rows, _ = assign_points(
            target.distances_between(candidates) / target.intrinsic_scale,
            between,
            between,
            cost,
            IntervalCost(settings.forgiven, settings.inside, MOST_COST, SOFT),
            BEAM,
            APART,
        )
        return rows[:count]

    return [np.column_stack([anchors, candidates[row]]) for kind in kinds for row in assigned(*kind)]


def _anchors(shape: PreparedShape, first: IntArray, count: int) -> tuple[IntArray, FloatArray]:
    """Vertices far from each other, and their distances in units of the average."""
    wanted = np.concatenate([first, shape.extremities, shape.column_vertices])
    wanted = wanted[np.sort(np.unique(wanted, return_index=True)[1])]
    distances = shape.distances_between(wanted)
    n_first = min(len(np.union1d(first, shape.extremities)), max(count, len(first)))
    kept = farthest_rows(distances, count, range(n_first))
    return wanted[kept], distances[np.ix_(kept, kept)] / shape.intrinsic_scale


def _remoteness(shape: PreparedShape) -> FloatArray:
    """(n,) share of the area that is less remote than each vertex: it does not depend on how long limbs are."""
    order = np.argsort(shape.average_distance, kind="stable")
    share = np.zeros(len(order))
    share[order] = np.cumsum(shape.body.vertex_areas[order]) / shape.body.area
    return share
