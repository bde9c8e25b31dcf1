"""Matching of eigenfunctions: which of one shape corresponds to which of the other, and with which sign, by moments."""

from __future__ import annotations

from itertools import combinations, product
from operator import itemgetter

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.matching import Problem
from isomatch.settings import Orientation
from isomatch.shapes import PreparedShape
from isomatch_lab.baselines.functional_maps import orientations, products

WAVE_KERNELS = 20  # number of wave kernels, the first columns of the signatures; the others are curvatures

MAX_MATCHED = 14  # largest number of functions whose combinations of signs can all be tried
MAX_EXCHANGE_DISTANCE = 2  # difference of the numbers of exchanged eigenfunctions, at most; chosen

# sign of the orientation that a map shall have, 0 for any
ORIENTATION_SIGN: dict[Orientation, float] = {"preserve": 1.0, "reverse": -1.0, "any": 0.0}


def signed_permutation(pair: Problem, m: int, side: float) -> FloatArray:
    """Match each of the first m functions but the constant to one of the other shape, up to sign: (m + 1, m + 1)."""
    # Shtern & Kimmel, Matching the LBO Eigenspace of Non-Rigid Shapes via High Order Statistics, Axioms 2014: on
    # isometric shapes the third moments ∫ φ_i φ_j φ_k agree, and so do ∫ φ_k ⟨∇φ_i × ∇φ_j, N⟩ up to orientation. First
    # moments with wave kernels, ∫ w φ_i, are added here. Because signs have square 1, the squared differences are least
    # where the correlation Σ s_i a_i b_i + Σ s_i s_j s_k A_ijk B_ijk is largest. For one order of the functions all 2^m
    # combinations of signs are tried. Starting from the order of the spectrum, the two nearby functions whose exchange
    # helps most change places, until no exchange helps. ``side`` is 1 if the orientation should be preserved, −1 if
    # reversed, 0 if either
    of_source, of_target = (_moments(shape, m) for shape in (pair.source, pair.target))
    signs = np.array(list(product((1.0, -1.0), repeat=m)))  # (2^m, m)

    def best(order: IntArray) -> tuple[float, FloatArray]:
        """Largest correlation for an order of the target's functions, and its signs."""
        first = np.einsum("iq,iq->i", of_source[0], of_target[0][order])
        exchanged = np.ix_(order, order, order)
        third = np.zeros((m, m, m))
        for weight, a, b in zip((1.0, side), of_source[1:], of_target[1:]):
            third += weight * a * b[exchanged]
        scores = signs @ first + np.einsum(
            "nij,ni,nj->n", (signs @ third.reshape(m, -1)).reshape(-1, m, m), signs, signs
        )
        return float(scores.max()), signs[scores.argmax()]

    order = np.arange(m)
    score, sign = best(order)
    exchanges = np.array(
        [_exchange(m, i, j) for i, j in combinations(range(m), 2) if j - i <= MAX_EXCHANGE_DISTANCE]
    )
    while True:
        trials = [(*best(order[exchange]), order[exchange]) for exchange in exchanges]
        trial = max(trials, key=itemgetter(0))
        if trial[0] <= score:
            break
        score, sign, order = trial
    functional_map = np.zeros((m + 1, m + 1))
    functional_map[0, 0] = 1.0
    functional_map[np.arange(m) + 1, order + 1] = sign
    return functional_map


def _exchange(m: int, i: int, j: int) -> IntArray:
    """Order of m items with items i and j exchanged."""
    order = np.arange(m)
    order[[i, j]] = j, i
    return order


def _moments(shape: PreparedShape, m: int) -> tuple[FloatArray, ...]:
    """First moments with wave kernels (m, q), third moments and gradient moments (m, m, m), each of norm 1."""
    basis, nonconstant = shape.laplace, np.eye(m + 1)[:, 1:]
    moments = [
        basis.coefficients(shape.signatures[:, :WAVE_KERNELS], m + 1)[1:],
        products(basis, nonconstant)[:, 1:, 1:],
    ]
    if shape.triangles:
        moments.append(orientations(basis, shape.triangles, nonconstant)[:, 1:, 1:])
    return tuple(x / np.maximum(np.linalg.norm(x), 1e-300) for x in moments)
