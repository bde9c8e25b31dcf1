"""Assignments of the extremities of two shapes to one another."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from itertools import permutations

import numpy as np

from isomatch._core.arrays import BodyVertices, Int, IntArray
from isomatch.settings import SearchSettings
from isomatch.shapes import PreparedShape


def extremity_assignments(
    source: PreparedShape, target: PreparedShape, settings: SearchSettings
) -> list[Int[BodyVertices, "q 2"]]:
    """Assign extremal points of both shapes so that distances agree, best first."""
    # the keys are assignments, for each number of points and in both directions, without repetitions
    assignments: dict[tuple[tuple[int, int], ...], None] = {}
    for count in settings.extremity_counts:
        for forward in (True, False):
            a, b = (source, target) if forward else (target, source)
            for few, among in _consistent_assignments(a, b, count, settings):
                pairs = zip(few, among) if forward else zip(among, few)
                assignments.setdefault(tuple(sorted((int(i), int(j)) for i, j in pairs)))
    return [BodyVertices(np.array(pairs)) for pairs in assignments]


def _consistent_assignments(
    a: PreparedShape, b: PreparedShape, count: int, settings: SearchSettings
) -> Iterable[tuple[Int[IntArray, "count"], Int[IntArray, "count"]]]:
    """Assign the most remote extremities of ``a`` to extremities of ``b``, best first."""
    few, among = a.extremities[:count], b.extremities[: settings.n_candidate_extremities]
    if len(few) < count or len(among) < count:
        return []
    # All injective assignments σ of m points a_i to n points b are compared by
    #   Σ_{i≠j} |d_a(a_i, a_j) − d_b(b_σi, b_σj)| / m² + w Σ_i |ē_a(a_i) − ē_b(b_σi)| / m,
    # where d_a and d_b are distances in units of the average distance, ē_a and ē_b their means from a point,
    # and w is ``eccentricity_weight``. The assignments of least cost are kept.
    choices = _choices(len(among), count)
    d_few = a.extremity_columns[:count][:, few] / a.intrinsic_scale
    d_among = b.extremity_columns[: len(among)][:, among] / b.intrinsic_scale
    remote_few = a.average_distance[few] / a.intrinsic_scale
    remote_among = b.average_distance[among] / b.intrinsic_scale
    remoteness = np.abs(remote_few[:, None] - remote_among)
    cost = settings.eccentricity_weight / count * sum(row[chosen] for row, chosen in zip(remoteness, choices))
    for i, j in permutations(range(count), 2):
        cost += np.abs(d_few[i, j] - d_among)[choices[i], choices[j]] / count**2
    best = np.argsort(cost, kind="stable")[: settings.assignments]
    return [(few, among[choices[:, c]]) for c in best]


@lru_cache
def _choices(n: int, count: int) -> Int[IntArray, "count c"]:
    """All ordered choices of ``count`` out of n numbers."""
    return np.array(list(permutations(range(n), count))).T.copy()
