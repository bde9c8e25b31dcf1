"""Nearest rows in high dimension: blocked matrix products, with near ties settled in double precision."""

from __future__ import annotations

import numba
import numpy as np

from isomatch._arrays import Float32Array, FloatArray, IntArray
from isomatch._threads import parallel_map

BLOCK = 512  # queries at once; fixed, so that results do not depend on the number of threads
TIE = 1e-6  # score differences below this share of the largest squared norm are compared again in float64


def nearest_rows(candidates: FloatArray, queries: FloatArray) -> IntArray:
    """For each query row, the index of the nearest candidate row; the first of equals.

    Parameters
    ----------
    candidates : (n, d) array of float
    queries : (m, d) array of float

    Returns
    -------
    (m,) array of int

    Notes
    -----
    2 n m d operations in single precision. The nearest candidate has the largest y·x − |x|²/2; all candidates whose
    score is within the rounding error of the best are ranked by their true distance in double precision.
    """
    centre = candidates.mean(axis=0)
    x, y = candidates - centre, queries - centre
    norms = np.einsum("ij,ij->i", x, x)
    table = np.empty((x.shape[1] + 1, len(x)), dtype=np.float32)  # filled by the next two lines
    table[:-1] = x.T
    table[-1] = -0.5 * norms
    probes = np.ones((len(y), y.shape[1] + 1), dtype=np.float32)
    probes[:, :-1] = y
    slack = TIE * float(max(norms.max(initial=0.0), np.einsum("ij,ij->i", y, y).max(initial=0.0)))

    def block(first: int) -> IntArray:
        rows = slice(first, first + BLOCK)
        best = np.zeros(len(probes[rows]), dtype=np.int64)
        _settle(probes[rows] @ table, x, y[rows], slack, best)
        return best

    parts = parallel_map(block, range(0, len(y), BLOCK))
    return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)


@numba.njit(cache=True, nogil=True, fastmath={"nnan", "nsz", "reassoc", "contract"})
def _settle(
    scores: Float32Array, x: FloatArray, y: FloatArray, slack: float, best: IntArray
) -> None:  # pragma: no cover - compiled
    n = scores.shape[1]
    for i in range(len(scores)):
        row = scores[i]
        top = row[0]
        for j in range(1, n):
            top = max(top, row[j])
        bar = top - np.float32(slack)
        winner, nearest = -1, np.inf
        for j in range(n):
            if row[j] >= bar:
                distance = 0.0
                for d in range(x.shape[1]):
                    difference = x[j, d] - y[i, d]
                    distance += difference * difference
                if distance < nearest:
                    winner, nearest = j, distance
        best[i] = winner
