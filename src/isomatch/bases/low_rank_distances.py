"""Distances of pairs of points from a low-rank form, in a compiled loop limited by memory bandwidth."""

from __future__ import annotations

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.runtime.threads import n_threads, parallel_map
from isomatch.values.arrays import AnyArray, FloatArray, IntArray

FEWEST_FOR_THREADS = 50_000  # pairs; for fewer, starting threads costs more time than it saves


def low_rank_distances(vectors: AnyArray, values: AnyArray, i: IntArray, j: IntArray) -> FloatArray:
    """Σ_c Λ_c Q_ic Q_jc for pairs (i, j) of rows of Q.

    Parameters
    ----------
    vectors, values : (n, k) and (k,) arrays of float
        Q and the diagonal of Λ.
    i, j : (m,) arrays of int
        Pairs of rows, from 0 to n − 1 or negative from the end. They are not checked.

    Returns
    -------
    (m,) array of float
        Sums, computed in the precision of Q.

    Notes
    -----
    O(m k) time on all threads. Rows are not gathered, so that no memory but the result is needed.
    """
    out = np.zeros(len(i))
    parts = n_threads() if len(i) >= FEWEST_FOR_THREADS else 1
    ends = np.linspace(0, len(i), parts + 1).astype(np.int64)

    def part(a: int) -> None:
        chosen = slice(ends[a], ends[a + 1])
        _sum_pairs(vectors, values, i[chosen], j[chosen], out[chosen])

    parallel_map(part, range(parts))
    return out


@compiled(fastmath=True)
def _sum_pairs(vectors: AnyArray, values: AnyArray, i: IntArray, j: IntArray, out: FloatArray) -> None:
    for a in range(len(i)):
        x, y = vectors[i[a]], vectors[j[a]]
        total = values[0] * x[0] * y[0]
        for c in range(1, len(values)):
            total += values[c] * x[c] * y[c]
        out[a] = total
