"""Extremal points of one shape assigned to those of another."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import permutations

import numpy as np

from isomatch.settings import SearchSettings
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import IntArray


def extremity_assignments(
    source: PreparedShape, target: PreparedShape, settings: SearchSettings
) -> list[IntArray]:
    """Assign extremal points to extremal points so that their distances agree.

    Returns
    -------
    list of (count, 2) arrays of int
        Source and target vertices; the best of every count of points and both directions, repetitions removed.
    """
    found: dict[tuple[tuple[int, int], ...], None] = {}
    for count in settings.extremity_counts:
        for forward in (True, False):
            a, b = (source, target) if forward else (target, source)
            for few, among in _consistent_assignments(a, b, count, settings):
                pairs = zip(few, among) if forward else zip(among, few)
                found.setdefault(tuple(sorted((int(i), int(j)) for i, j in pairs)))
    return [np.array(pairs) for pairs in found]


def _consistent_assignments(
    a: PreparedShape, b: PreparedShape, count: int, settings: SearchSettings
) -> Iterable[tuple[IntArray, IntArray]]:
    """Extremities of a, the most remote first, and those of b that they are assigned to."""
    few, among = a.extremities[:count], b.extremities[: settings.n_candidate_extremities]
    if len(few) < count or len(among) < count:
        return []
    choices = np.array(list(permutations(range(len(among)), count)))  # (c, count)
    d_few = a.extremity_columns[:count][:, few] / a.intrinsic_scale
    d_among = b.extremity_columns[: len(among)][:, among] / b.intrinsic_scale
    remote_few = a.average_distance[few] / a.intrinsic_scale
    remote_among = b.average_distance[among] / b.intrinsic_scale
    cost = np.abs(d_few - d_among[choices[:, :, None], choices[:, None, :]]).mean(axis=(1, 2))
    cost += settings.eccentricity_weight * np.abs(remote_few - remote_among[choices]).mean(axis=1)
    best = np.argsort(cost, kind="stable")[: settings.assignments]
    return [(few, among[choices[c]]) for c in best]
