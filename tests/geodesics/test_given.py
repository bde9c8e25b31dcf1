"""Distances given by the user, as a matrix or a function: used as they are, or refused by a named error."""

import numpy as np
import pytest

from isomatch import MeshError, geodesic_distances
from isomatch.geodesics import distance_engine, farthest_point_sampling
from isomatch.geodesics.given import GivenFunction
from shapes import icosphere


@pytest.fixture(scope="module")
def matrix():
    mesh = icosphere(2)
    return geodesic_distances(mesh, range(mesh.n_vertices))


def test_a_matrix_gives_its_rows(matrix):
    engine = distance_engine(matrix)
    assert (engine.name, engine.n_points) == ("matrix", len(matrix))
    given = engine.distances_from([5, 2])
    np.testing.assert_allclose(given, (matrix[[5, 2]] + matrix[:, [5, 2]].T) / 2)
    columns = engine.distances_from(np.arange(len(matrix)))
    assert np.array_equal(columns, columns.T)


def test_a_memory_map_of_single_precision_is_not_copied(matrix, tmp_path):
    on_disk = np.memmap(tmp_path / "d", dtype=np.float32, mode="w+", shape=matrix.shape)
    on_disk[:] = matrix
    columns = distance_engine(on_disk).distances_from([7])
    np.testing.assert_allclose(columns[0], matrix[7], rtol=0.01, atol=1e-6)


def test_inf_is_allowed():
    disconnected = np.array([[0, np.inf], [np.inf, 0]])
    assert geodesic_distances(disconnected, [1]).tolist() == [[np.inf, 0.0]]


def changed(matrix, i, j, value):
    other = matrix.copy()
    other[i, j] = value
    return other


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d[:5], r"shape \(5, 162\) and type float64 cannot be used, expected \(n, n\)"),
        (lambda d: d + 1j, r"type complex128 cannot be used"),
        (lambda d: changed(d, 3, 4, -1e-9), r"negative entries or NaN in the rows of points 3"),
        (lambda d: changed(d, 3, 4, np.nan), r"negative entries or NaN in the rows of points 3"),
        (lambda d: changed(d, 7, 7, 0.1), r"the diagonal of the distance matrix is not 0 at points 7"),
        (lambda d: changed(d, 7, 9, 1e-3), r"not symmetric at points 7, 9; give distances of a metric"),
        (lambda d: changed(d, 7, 9, np.inf), r"not symmetric at points 7, 9"),
    ],
)
def test_bad_distance_matrices_are_refused(matrix, change, message):
    with pytest.raises(MeshError, match=message):
        distance_engine(change(matrix))


def test_a_function_gives_its_columns(matrix):
    engine = distance_engine(lambda sources: matrix[sources])
    assert (engine.name, engine.n_points) == ("function", len(matrix))
    assert np.array_equal(engine.distances_from([3, 1]), matrix[[3, 1]])


def test_sampling_calls_a_function_once_for_each_column(matrix):
    asked = []

    def columns(sources):
        asked.extend(sources)
        return matrix[sources]

    sampling = farthest_point_sampling(GivenFunction(columns, len(matrix)), 20, start=3)
    assert asked == sampling.vertices.tolist()
    assert np.array_equal(sampling.columns, matrix[sampling.vertices])


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda s: np.zeros((len(s), 4)), r"returned shape \(2, 4\) and type float64, expected \(2, 5\)"),
        (lambda s: np.zeros(5), r"returned shape \(5,\)"),
        (lambda s: np.full((len(s), 5), np.nan), r"negative entries or NaN in the rows of points 1, 3"),
        (lambda s: np.ones((len(s), 5)), r"is not 0 from sources 1, 3 to themselves"),
        (lambda s: [["far"] * 5] * len(s), r"type <U3, expected \(2, 5\) real numbers"),
    ],
)
def test_bad_distance_functions_are_refused(function, message):
    with pytest.raises(MeshError, match=message):
        GivenFunction(function, 5).distances_from([1, 3])


def test_a_function_that_does_not_return_rows():
    with pytest.raises(MeshError, match="returned"):
        distance_engine(lambda sources: np.zeros(7))
