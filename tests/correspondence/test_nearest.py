"""Nearest rows in single precision, against all distances in double precision."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from isomatch.correspondence import VertexCells, nearest_of_few, nearest_rows
from isomatch.correspondence.nearest import nearest_in_cells


def brute_force(candidates, queries):
    """The first of the nearest candidates."""
    return ((candidates[None] - queries[:, None]) ** 2).sum(axis=2).argmin(axis=1)


def scattered(n, m, d, offset=0.0):
    """Candidates (n, d) and queries (m, d); if they are far from 0, each query is beside a candidate."""
    rng = np.random.default_rng(n)
    candidates, queries = rng.normal(size=(n, d)) + offset, rng.normal(size=(m, d))
    return candidates, candidates[rng.integers(n, size=m)] + 0.1 * queries if offset else queries


def two_tight_clusters():
    """No common shift helps here: within a cluster, single precision sees all candidates as equal."""
    rng = np.random.default_rng(2)
    where = np.where(np.arange(600) % 2, 1000.0, -1000.0)[:, None]
    candidates = where + 1e-3 * rng.normal(size=(600, 8))
    return candidates, candidates + 1e-5 * rng.normal(size=(600, 8))


@pytest.mark.parametrize(
    "points",
    [
        *(scattered(*sizes) for sizes in [(1, 1, 1), (3, 0, 2), (7, 3, 2), (200, 600, 50), (300, 300, 223)]),
        *(scattered(500, 300, 20, offset) for offset in (1e3, 1e6, -1e8)),
        two_tight_clusters(),
    ],
    ids=lambda points: str([each.shape for each in points]),
)
def test_same_as_brute_force(points):
    """A common shift does not cost the digits that single precision has."""
    np.testing.assert_array_equal(nearest_rows(*points), brute_force(*points))


@given(st.data(), st.integers(1, 9), st.integers(1, 4))
def test_first_of_equals_on_small_integers(data, n, d):
    """Integers are exact in single precision, so ties are true ties."""
    table = arrays(np.float64, (n + 3, d), elements=st.integers(-3, 3).map(float))
    both = data.draw(table)
    found, expected = nearest_rows(both[:n], both[n:]), brute_force(both[:n], both[n:])
    distances = np.linalg.norm(both[:n][found] - both[n:], axis=1)
    np.testing.assert_array_equal(distances, np.linalg.norm(both[:n][expected] - both[n:], axis=1))


def test_of_repeated_candidates_the_first():
    rows = np.random.default_rng(0).normal(size=(40, 6))
    candidates = np.vstack([rows, rows, rows])
    np.testing.assert_array_equal(nearest_rows(candidates, rows), np.arange(40))


def test_blocks_and_threads_change_nothing(monkeypatch):
    rng = np.random.default_rng(3)
    candidates, queries = rng.normal(size=(300, 30)), rng.normal(size=(2000, 30))
    whole = []
    for threads in ("1", "2"):
        monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
        whole.append(nearest_rows(candidates, queries))
    np.testing.assert_array_equal(*whole)
    np.testing.assert_array_equal(whole[0][700:701], nearest_rows(candidates, queries[700:701]))


@pytest.mark.parametrize("dimension", [2, 40])
def test_cells_give_the_answer_of_brute_force(dimension):
    rng = np.random.default_rng(dimension)
    candidates = rng.standard_normal((900, dimension)) / np.arange(1, dimension + 1) + 1e3
    queries = np.vstack([candidates[::7], rng.standard_normal((200, dimension)) + 1e3])
    centres = rng.choice(900, 30, replace=False)
    cells = VertexCells.of(centres, rng.integers(30, size=900))
    found = nearest_in_cells(candidates, queries, cells)
    distances = ((queries[:, None] - candidates) ** 2).sum(axis=2)
    np.testing.assert_allclose(
        distances[np.arange(len(queries)), found], distances.min(axis=1), rtol=1e-9, atol=1e-9
    )
    assert (found[: len(candidates[::7])] == np.arange(900)[::7]).all()


def test_equal_candidates_in_different_cells_give_the_first():
    candidates = np.repeat(np.random.default_rng(0).standard_normal((50, 5)), 2, axis=0)
    cells = VertexCells.of(np.arange(0, 100, 10), np.random.default_rng(1).integers(10, size=100))
    assert (nearest_in_cells(candidates, candidates, cells) == np.repeat(np.arange(0, 100, 2), 2)).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("n", "m", "d"), [(1, 1, 1), (7, 3, 2), (400, 900, 50)])
def test_of_few_the_nearest_but_for_rounding(n, m, d, dtype):
    rng = np.random.default_rng(n)
    candidates, queries = rng.normal(size=(n, d)).astype(dtype), rng.normal(size=(m, d)).astype(dtype)
    before = candidates.copy(), queries.copy()
    distances = ((candidates[None].astype(float) - queries[:, None]) ** 2).sum(axis=2)
    found = nearest_of_few(candidates, queries)
    np.testing.assert_allclose(distances[np.arange(m), found], distances.min(axis=1), rtol=1e-5, atol=1e-5)
    assert (found == distances.argmin(axis=1)).mean() > 0.99
    np.testing.assert_array_equal(nearest_of_few(candidates, candidates), np.arange(n))
    np.testing.assert_array_equal(candidates, before[0])
    np.testing.assert_array_equal(queries, before[1])


def test_of_few_that_are_equal_the_first():
    rows = np.random.default_rng(0).integers(-3, 4, size=(40, 6)).astype(float)
    _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(nearest_of_few(np.vstack([rows, rows]), rows), first[number.ravel()])
