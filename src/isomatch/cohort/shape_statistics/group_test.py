"""Whether shapes differ by group, at every vertex, or depend on variables, as a whole: tests by permutations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import f, false_discovery_control

from isomatch._core.arrays import BoolArray, FloatArray, IntArray, numbers_of
from isomatch._core.errors import InputError, SettingError
from isomatch._core.settings import generator, require_one_of
from isomatch._core.threads import serial_blas
from isomatch.cohort.shape_statistics.procrustes import scalar_products, shares_of

TestMethod = Literal["permutation", "parametric"]
N_PERMUTATIONS = 4999
BLOCK = 2**22  # numbers in memory at a time
FEWEST = 3  # shapes: two differ along any variable
LEAST_SHARE = 1e-9  # of the largest singular value of the variables: one with less depends on the others


@dataclass(frozen=True, eq=False)
class GroupTest:
    """Difference of the means of two groups at each of n vertices."""

    groups: tuple[str, str]  #: their names, in alphabetical order
    counts: tuple[int, int]  #: numbers of shapes
    difference: (
        FloatArray  #: (n, 3) mean of the second group minus that of the first, in the units of the shapes
    )
    t_squared: FloatArray  #: (n,) of Hotelling; ``inf`` if the groups are separated completely
    #: (n,) probability of a T² at least as large if both groups have the same distribution, and the least false discovery
    #: rate at which the vertex counts as different (Benjamini & Hochberg 1995)
    p_values: FloatArray
    q_values: FloatArray

    def significant(self, false_discovery_rate: float = 0.05) -> BoolArray:
        """(n,) which vertices differ, at an expected share of false ones among them."""
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
    aligned : (m, n, 3) array of float
        Shapes moved onto their mean, such as ``generalised_procrustes(...).aligned``.
    groups : sequence of str
        The group of each of the m shapes; two different names, of two shapes or more.
    method : {"permutation", "parametric"}
        Whether p-values come from random exchanges of the group labels, which assumes nothing about the distribution, or
        from Hotelling's F distribution, which assumes a normal one and the same covariance in both groups.
    n_permutations, seed : int
        Number of random exchanges, and what draws them; no p-value is below 1 / (n_permutations + 1).
    measured : (m, n) array of bool, optional
        Which vertices were measured; by default all. A vertex that fewer than two shapes of a group measured is left
        out: its p- and q-values are 1. Of others, shapes that lack it stand on the mean of all, see `filled`, which
        makes no difference larger.

    Notes
    -----
    T² = (m − 2) q / (1 − q), where q = (m₁ m₂ / m) dᵀ S⁻¹ d of the difference d of the group means and the total scatter
    S of all shapes about their mean. O(n_permutations m n) time. Where a vertex varies in fewer than three directions,
    only these are tested.

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
    # the total scatter S = L Lᵀ is the same for all labels, so that q = (m₁ m₂ / m) |L⁻¹ d|² needs one product of the
    # whitened positions with the contrast, 1/m₂ in the second group and −1/m₁ in the first, whose product with shapes
    # is d
    white, rank = _whitened(aligned)
    contrast = np.where(second, 1 / counts[1], -1 / counts[0])
    share = counts[0] * counts[1] / m
    q = np.minimum(share * (np.tensordot(contrast, white, 1) ** 2).sum(axis=1), 1.0)
    permuted = method == "permutation"
    p = _permuted(white, q, contrast, share, n_permutations, seed) if permuted else _parametric(q, rank, m)
    with np.errstate(divide="ignore"):
        t_squared = (m - 2) * q / np.where(q > 1 - 1e-12, 0.0, 1 - q)
    difference: FloatArray = np.tensordot(contrast, aligned, 1)
    held = np.ones(white.shape[:2], dtype=bool) if measured is None else measured
    tested = np.minimum(held[second].sum(axis=0), held[~second].sum(axis=0)) > 1
    p_values, q_values = np.ones((2, len(p)))
    p_values[tested] = p[tested]
    q_values[tested] = false_discovery_control(p[tested])
    return GroupTest(names, counts, difference, t_squared, p_values, q_values)


def _labels(groups: Sequence[str], m: int) -> tuple[BoolArray, tuple[str, str], tuple[int, int]]:
    """Which shapes are in the second group; the names and sizes of both."""
    if len(groups) != m:
        raise InputError(f"{len(groups)} groups for {m} shapes; give one for each")
    labels, index, counts = np.unique(np.asarray(groups, dtype=str), return_inverse=True, return_counts=True)
    if len(labels) != 2 or counts.min() < 2:
        sizes = ", ".join(f"{str(label)!r} of {count}" for label, count in zip(labels, counts))
        raise InputError(f"groups {sizes}; give two groups with at least two shapes each")
    return index == 1, (str(labels[0]), str(labels[1])), (int(counts[0]), int(counts[1]))


def _whitened(aligned: FloatArray) -> tuple[FloatArray, IntArray]:
    """Positions about their mean with a total scatter of the identity, (m, n, 3), and its rank at each vertex, (n,)."""
    centred = aligned - aligned.mean(axis=0)
    values, axes = np.linalg.eigh(np.einsum("sij,sik->ijk", centred, centred))
    noise = np.maximum(1e-10 * values[:, 2], 1e-24 * np.ptp(aligned, axis=(0, 1)).max() ** 2)
    kept = values > noise[:, None]
    factors = np.where(kept, 1 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    white: FloatArray = np.einsum("sij,ijk,ik->sik", centred, axes, factors)
    return white, kept.sum(axis=1)


def _permuted(
    white: FloatArray, q: FloatArray, contrast: FloatArray, share: float, n_permutations: int, seed: int
) -> FloatArray:
    m, n, _ = white.shape
    labels = generator(seed).permuted(np.tile(contrast, (n_permutations, 1)), axis=1)
    reached = np.ones(n)  # the labels as they are
    width = max(BLOCK // (3 * n_permutations), 1)
    with serial_blas():
        for first in range(0, n, width):
            block = slice(first, first + width)
            differences = (labels @ white[:, block].reshape(m, -1)).reshape(n_permutations, -1, 3)
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


@dataclass(frozen=True, eq=False)
class ShapeRegression:
    """Regression of m aligned shapes on q variables: shape = mean + Σ (variable − its mean) · coefficient."""

    #: share of the variance of shape that the variables describe, and the probability of as large a share if they tell
    #: nothing about shape, from permutations
    r_squared: float
    p_value: float
    n_permutations: int
    seed: int  #: draws them
    mean: FloatArray  #: (n, 3)
    coefficients: FloatArray  #: (q, n, 3) displacement for one unit of each variable
    #: (m, q) regression scores of Drake & Klingenberg (2008): how far each shape lies from the mean in the direction of
    #: each coefficient, in the units of the shapes; against the variable, they show what it describes
    scores: FloatArray


def shape_regression(
    aligned: FloatArray,
    variables: ArrayLike,
    weights: FloatArray | None = None,
    *,
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
) -> ShapeRegression:
    """Regress shapes on variables, such as the logarithm of their centroid size (allometry).

    Parameters
    ----------
    aligned : (m, n, 3) array of float
        Shapes moved onto their mean, such as ``generalised_procrustes(...).aligned``; for allometry with sizes removed.
    variables : (m,) or (m, q) array_like of float
        Their values. Groups are columns of 0 and 1, of all groups but one.
    weights : (n,) array of float, optional
        Weight of each vertex, such as `CorrespondedShapes.area_weights`; by default all are equal.
    n_permutations, seed : int
        Number of random exchanges of the values between shapes, and what draws them; see `group_test`.

    Notes
    -----
    Goodall's Procrustes regression. A permutation takes O(m² q) time.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> size = np.linspace(0, 1, 12)
    >>> shapes = size[:, None, None] * np.ones((5, 3)) + 0.01 * rng.normal(size=(12, 5, 3))
    >>> found = shape_regression(shapes, size)
    >>> round(found.r_squared, 2), found.p_value
    (1.0, 0.0002)
    """
    values = numbers_of(variables, "variables", InputError)
    values = values[:, None] if values.ndim == 1 else values
    m = len(aligned)
    if values.ndim != 2 or len(values) != m or not np.isfinite(values).all():
        remedy = f"give a finite number for each of the {m} shapes"
        raise InputError(f"variables have shape {values.shape}; {remedy}")
    if m < FEWEST:
        raise InputError(f"{m} shapes are too few for a regression; give {FEWEST} or more")
    if n_permutations < 1:
        raise SettingError(f"n_permutations = {n_permutations} is not at least 1")
    centred = values - values.mean(axis=0)
    basis, singular, _ = np.linalg.svd(centred, full_matrices=False)
    scale = np.abs(values).max(initial=0.0) * np.sqrt(m)
    if not len(singular) or singular[-1] <= LEAST_SHARE * max(singular[0], scale):
        raise InputError("the variables do not vary, or one depends on the others; leave it out")
    # sums of squares over vertices and coordinates (Goodall 1991; Anderson 2001): with an orthonormal basis B (m, q) of
    # the centred variables and the scalar products P (m, m) of shapes, those explained are tr(Bᵀ P B), of all tr P. An
    # exchange of values permutes the rows of B: O(m² q), and no vertex
    share = shares_of(aligned, weights)
    mean = aligned.mean(axis=0)
    about_mean = aligned - mean
    coefficients = np.tensordot(np.linalg.pinv(centred), about_mean, 1)
    products = scalar_products(about_mean, share)
    explained = float(np.einsum("iq,ij,jq->", basis, products, basis))
    total = float(np.trace(products))
    reached = 1  # the values as they are
    for order in generator(seed).permuted(np.tile(np.arange(m), (n_permutations, 1)), axis=1):
        permuted = basis[order]
        reached += float(np.einsum("iq,iq->", permuted, products @ permuted)) >= explained * (1 - 1e-9)
    length = np.sqrt(np.einsum("i,qij,qij->q", share, coefficients, coefficients))
    along = coefficients / np.where(length > 0, length, 1.0)[:, None, None]
    scores = np.einsum("i,mij,qij->mq", share, about_mean, along)
    r_squared, p_value = explained / total if total > 0 else 0.0, reached / (n_permutations + 1)
    return ShapeRegression(r_squared, p_value, n_permutations, seed, mean, coefficients, scores)
