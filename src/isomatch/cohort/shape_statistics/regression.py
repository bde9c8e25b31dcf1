"""Regression of shape on size or on other variables, with a permutation test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, numbers_of
from isomatch._core.errors import InputError, SettingError
from isomatch._core.settings import generator
from isomatch.cohort.shape_statistics.group_test import N_PERMUTATIONS
from isomatch.cohort.shape_statistics.procrustes import scalar_products, shares_of

FEWEST = 3  # shapes: two differ along any variable
LEAST_SHARE = 1e-9  # of the largest singular value of the variables: one with less depends on the others


@dataclass(frozen=True, eq=False)
class ShapeRegression:
    """Regression of m aligned shapes on q variables: shape = mean + Σ (variable − its mean) · coefficient.

    Parameters
    ----------
    r_squared, p_value : float
        Share of the variance of shape that the variables describe, and the probability of as large a share if they tell
        nothing about shape, from permutations.
    n_permutations, seed : int
        Their number, and what drew them.
    mean : (n, 3) array of float
    coefficients : (q, n, 3) array of float
        Displacement for one unit of each variable.
    scores : (m, q) array of float
        The regression scores of Drake & Klingenberg (2008): how far each shape lies from the mean in the direction of
        each coefficient, in the units of the shapes. Against the variable, they show what it describes.
    """

    r_squared: float
    p_value: float
    n_permutations: int
    seed: int
    mean: FloatArray
    coefficients: FloatArray
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
    n_permutations : int
        Number of random exchanges of the values between shapes; no p-value is below 1 / (n_permutations + 1).
    seed : int
        Draws them.

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
        raise InputError(
            f"variables have shape {values.shape}; give a finite number for each of the {m} shapes"
        )
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
