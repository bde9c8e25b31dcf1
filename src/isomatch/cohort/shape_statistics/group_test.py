"""Hotelling's test of the difference of two groups of shapes at every vertex."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import f, false_discovery_control

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.errors import InputError, SettingError
from isomatch._core.settings import generator, require_one_of
from isomatch._core.threads import serial_blas
from isomatch.cohort.shape_statistics.linear_model import N_PERMUTATIONS

TestMethod = Literal["permutation", "parametric"]  # method that gives the p-values of a test
MAX_NUMBERS = 2**22  # largest number of floats (32 MiB) in the permuted differences of one block; chosen


@dataclass(frozen=True, eq=False)
class GroupTest:
    """Difference of the means of two groups at each of n vertices."""

    groups: tuple[str, str]  #: names of the groups, in alphabetical order
    counts: tuple[int, int]  #: number of shapes in each group
    difference: FloatArray  #: (n, d) mean of the second group minus mean of the first
    t_squared: FloatArray  #: (n,) statistic of Hotelling; ``inf`` if the groups are separated completely
    p_values: FloatArray  #: (n,) probability of as large a T² if the groups have one distribution
    #: (n,) least false discovery rate (Benjamini & Hochberg 1995) at which a vertex differs
    q_values: FloatArray

    def significant(self, false_discovery_rate: float = 0.05) -> BoolArray:
        """(n,) vertices that differ, with an expected share of false ones among them."""
        return np.asarray(self.q_values <= false_discovery_rate)


def group_test(
    aligned: FloatArray,
    groups: Sequence[str],
    *,
    method: TestMethod = "permutation",
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
    measured: BoolArray | None = None,
) -> GroupTest:
    """Test at every vertex whether two groups have the same mean.

    Parameters
    ----------
    aligned : (m, n, d) array of float
        Shapes moved onto their mean, such as ``generalised_procrustes(...).aligned``.
    groups : sequence of str
        The group of each of the m shapes; two different names, of two shapes or more.
    method : {"permutation", "parametric"}
        Whether p-values come from random exchanges of the group labels, which assumes nothing about
        the distribution, or from Hotelling's F distribution, which assumes a normal one and the
        same covariance in both groups.
    n_permutations, seed : int
        Number of random exchanges, and what draws them; no p-value is below
        1 / (n_permutations + 1).
    measured : (m, n) array of bool, optional
        Which vertices were measured; by default all. A vertex that fewer than two shapes of a group
        measured is left out: its p- and q-values are 1. Elsewhere, shapes that lack a vertex have
        it on the mean of all, see `filled`, which makes no difference larger.

    Notes
    -----
    T² = (m − 2) q / (1 − q), where q = (m₁ m₂ / m) dᵀ S⁻¹ d, with the difference d of the group
    means and the total scatter S of all shapes about their mean. O(n_permutations m n) time. Where a
    vertex varies in fewer than three directions, only these are tested.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> shapes = rng.normal(size=(20, 5, 3))
    >>> shapes[10:, 3] += 3
    >>> np.flatnonzero(group_test(shapes, ["a"] * 10 + ["b"] * 10).significant())
    array([3])
    """
    second, names, counts = _labels(groups, len(aligned))
    require_one_of("method", method, TestMethod)
    if n_permutations < 1:
        raise SettingError(f"n_permutations = {n_permutations} is not at least 1")
    m = len(aligned)
    # The total scatter S = L Lᵀ is the same for all labels, so that q = (m₁ m₂ / m) |L⁻¹ d|² needs
    # one product of the whitened positions with the contrast, 1/m₂ in the second group and −1/m₁ in
    # the first, whose product with shapes is d
    white, rank = _whiten(aligned)
    contrast = np.where(second, 1 / counts[1], -1 / counts[0])
    share = counts[0] * counts[1] / m
    q = np.minimum(share * (np.tensordot(contrast, white, 1) ** 2).sum(axis=1), 1.0)
    if method == "permutation":
        p = _permute_groups(white, q, contrast, share, n_permutations, seed)
    else:
        p = _parametric(q, rank, m)
    with np.errstate(divide="ignore"):
        t_squared = (m - 2) * q / np.where(q > 1 - 1e-12, 0.0, 1 - q)
    difference: FloatArray = np.tensordot(contrast, aligned, 1)
    seen = np.ones(white.shape[:2], dtype=bool) if measured is None else measured
    tested = np.minimum(seen[second].sum(axis=0), seen[~second].sum(axis=0)) > 1
    p_values, q_values = np.ones((2, len(p)))
    p_values[tested] = p[tested]
    q_values[tested] = false_discovery_control(p[tested])
    return GroupTest(names, counts, difference, t_squared, p_values, q_values)


def _labels(groups: Sequence[str], m: int) -> tuple[BoolArray, tuple[str, str], tuple[int, int]]:
    """Tell which shapes are in the second group, and the names and sizes of both."""
    if len(groups) != m:
        raise InputError(f"{len(groups)} groups for {m} shapes; give one for each")
    labels, index, counts = np.unique(np.asarray(groups, dtype=str), return_inverse=True, return_counts=True)
    if len(labels) != 2 or counts.min() < 2:
        sizes = ", ".join(f"{str(label)!r} of {count}" for label, count in zip(labels, counts))
        raise InputError(f"groups {sizes}; give two groups with at least two shapes each")
    return index == 1, (str(labels[0]), str(labels[1])), (int(counts[0]), int(counts[1]))


def _whiten(aligned: FloatArray) -> tuple[FloatArray, IntArray]:
    """Give positions (m, n, 3) unit scatter about their mean at each vertex; also its rank (n,)."""
    centred = aligned - aligned.mean(axis=0)
    values, axes = np.linalg.eigh(np.einsum("sij,sik->ijk", centred, centred))
    noise = np.maximum(1e-10 * values[:, -1], 1e-24 * np.ptp(aligned, axis=(0, 1)).max() ** 2)
    kept = values > noise[:, None]
    factors = np.where(kept, 1 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    white: FloatArray = np.einsum("sij,ijk,ik->sik", centred, axes, factors)
    return white, kept.sum(axis=1)


def _permute_groups(
    white: FloatArray, q: FloatArray, contrast: FloatArray, share: float, n_permutations: int, seed: int
) -> FloatArray:
    m, n, dim = white.shape
    labels = generator(seed).permuted(np.tile(contrast, (n_permutations, 1)), axis=1)
    reached = np.ones(n)  # number of labellings with as large a q; the given labelling counts
    width = max(MAX_NUMBERS // (dim * n_permutations), 1)
    with serial_blas():
        for first in range(0, n, width):
            block = slice(first, first + width)
            differences = (labels @ white[:, block].reshape(m, -1)).reshape(n_permutations, -1, dim)
            drawn = share * np.einsum("pij,pij->pi", differences, differences)
            reached[block] += (drawn >= q[block] * (1 - 1e-9)).sum(axis=0)
    return reached / (n_permutations + 1)


def _parametric(q: FloatArray, rank: IntArray, m: int) -> FloatArray:
    free = m - 1 - rank
    if free.min() < 1:
        raise InputError(f"{m} shapes are too few for the parametric test; use method='permutation'")
    with np.errstate(divide="ignore"):
        ratio = q / (1 - q) * free / np.maximum(rank, 1)
    return np.where(rank > 0, f.sf(ratio, np.maximum(rank, 1), free), 1.0)
