"""Cycle consistency: how far each map of a collection is from the compositions of the others."""

from __future__ import annotations

from itertools import permutations

import numpy as np
from scipy.sparse.csgraph import connected_components

from isomatch.values.arrays import FloatArray, IntArray

CONTRADICTED = 0.1  # √area: a mean error from which a map counts as a failure; right maps reach half of it
SHARPNESS = 1.3 ** np.arange(15)  # 1 to 39, in 1/√area


def inconsistency(readings: FloatArray, prior: FloatArray | None = None) -> FloatArray:
    """Estimate how far each map of a collection is from the right one.

    Parameters
    ----------
    readings : (n, n, n) array of float
        At (a, b, c): mean distance, in √(area of c), between the images of samples of a under a → b → c and under a → c;
        nan where a map is missing.
    prior : (n, n) array of float, optional
        Weight of the maps of each pair beforehand, symmetric; by default all are equal.

    Returns
    -------
    (n, n) array of float
        For each pair, both directions together, in √area; symmetric, nan where the pair is in no triangle.

    Notes
    -----
    A right map disagrees with the composition of two others exactly if one of these is wrong. So the disagreements of a
    map are averaged with the weight exp(−β × inconsistencies) of the two other maps of each triangle, in rounds of
    rising β: cycle-edge message passing (Lerman & Shi, *Robust Group Synchronization via Cycle-Edge Message Passing*,
    FoCM 2022). O(n³) time and memory. Maps that are wrong in the same way, such as all maps of one shape that is
    mirrored, are consistent.
    """
    triangles = _triangles(readings)
    measured = np.isfinite(triangles)
    errors = np.where(measured, triangles, 0.0)
    inconsistencies: FloatArray = np.full(errors.shape[:2], np.nan)
    prior_trust = np.ones_like(inconsistencies) if prior is None else prior
    trust = prior_trust
    for sharpness in SHARPNESS:
        weights = np.where(measured, trust[:, :, None] * trust[None, :, :], 0.0)
        total = weights.sum(axis=1)
        with np.errstate(invalid="ignore"):
            inconsistencies = (weights * errors).sum(axis=1) / total
        trust = prior_trust * trust_in(np.nan_to_num(inconsistencies, nan=np.inf), sharpness)
    symmetric: FloatArray = (inconsistencies + inconsistencies.T) / 2  # up to rounding it was
    return symmetric


def trust_in(inconsistencies: FloatArray, sharpness: float = SHARPNESS[-1]) -> FloatArray:
    """Weight exp(−sharpness × inconsistency) of maps, from 1 down to 0."""
    weights: FloatArray = np.exp(-sharpness * inconsistencies)
    return weights


def turned_shapes(orientations: FloatArray) -> IntArray:
    """Find the shapes that are mirrored against the others, as far as the maps' orientations tell.

    Parameters
    ----------
    orientations : (n, n) array of float
        Orientation of the map of each pair, symmetric: near 1 or −1; nan where not known.

    Returns
    -------
    array of int
        If maps between two groups of shapes reverse the orientation and maps within them do not, the smaller group. Where
        maps do not connect all shapes, those of each connected set.
    """
    links = np.nan_to_num(orientations)
    np.fill_diagonal(links, 1.0)
    count, group = connected_components(links != 0, directed=False)
    sides = [_smaller_side(links, np.flatnonzero(group == i)) for i in range(count)]
    return np.sort(np.concatenate(sides))


def _smaller_side(links: FloatArray, members: IntArray) -> IntArray:
    side = np.linalg.eigh(links[np.ix_(members, members)])[1][:, -1]
    return min(members[side < 0], members[side >= 0], key=len)


def _triangles(readings: FloatArray) -> FloatArray:
    """Mean over the six readings of each triangle that are known; nan if none is, or two of its shapes are one."""
    turned = [readings.transpose(order) for order in permutations(range(3))]
    n_measured = sum(np.isfinite(reading).astype(np.int64) for reading in turned)
    total = sum(np.nan_to_num(reading) for reading in turned)
    i = np.arange(len(readings))
    mean: FloatArray = np.where(n_measured > 0, total / np.maximum(n_measured, 1), np.nan)
    mean[i, i, :] = mean[i, :, i] = mean[:, i, i] = np.nan
    return mean
