"""What a map carries: labels by nearest, floats interpolated, forward by the adjoint."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isomatch import Correspondence, DescriptorError


@pytest.fixture
def precise():
    """Four source vertices on a target of five: inside a face, on an edge, at a vertex, unmatched."""
    faces = [[0, 1, 2], [3, 2, 4], [4, 4, 4], [-1, -1, -1]]
    weights = [[0.5, 0.3, 0.2], [0.6, 0.4, 0.0], [1, 0, 0], [1, 0, 0]]
    return Correspondence([0, 3, 4, -1], 5, faces, weights)


@st.composite
def precise_maps(draw):
    n_source, n_target = draw(st.integers(0, 9)), draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    faces = rng.integers(0, n_target, (n_source, 3))
    weights = rng.dirichlet([1, 1, 1], n_source).reshape(n_source, 3)
    image = np.where(rng.random(n_source) < 0.3, -1, faces[:, 0])
    return Correspondence(image, n_target, faces, weights)


@pytest.mark.parametrize(
    ("labels", "carried"),
    [
        (np.array([1, 2, 3, 4, 6], dtype=np.int16), [1, 4, 6, -1]),
        ([True, False, True, True, False], [True, True, False, False]),
        (["head", "arm", "leg", "toe", "tail"], ["head", "toe", "tail", ""]),
    ],
)
def test_labels_are_never_averaged(precise, labels, carried):
    found = precise.pull_back(labels)
    assert found.dtype == np.asarray(labels).dtype
    np.testing.assert_array_equal(found, carried)


def test_labels_of_several_columns(precise):
    table = np.arange(30).reshape(5, 3, 2)
    np.testing.assert_array_equal(precise.pull_back(table)[:3], table[[0, 3, 4]])
    assert (precise.pull_back(table)[3] == -1).all()


@given(precise_maps())
def test_the_labels_of_vertices_are_the_map_itself(f):
    np.testing.assert_array_equal(f.pull_back(np.arange(f.n_target)), f.vertices)


def test_what_stands_for_unmatched_can_be_chosen(precise):
    assert precise.pull_back(np.arange(5, dtype=np.uint8), fill=255)[3] == 255
    assert precise.pull_back(["a", "b", "c", "d", "e"], fill="unmatched")[3] == "unmatched"
    assert precise.pull_back(np.zeros(5), fill=7)[3] == 7.0
    assert np.isnan(precise.pull_back(np.zeros(5, dtype=np.float32))[3])
    assert Correspondence([1, 0], 2).pull_back(np.array([3, 4], dtype=np.uint8)).tolist() == [4, 3]


@pytest.mark.parametrize(
    ("values", "fill", "message"),
    [
        (np.zeros(5, dtype=np.uint8), None, "1 source vertices are unmatched, .* uint8; give fill"),
        (np.zeros(5, dtype=np.uint8), -1, "fill = -1 is no value of type uint8"),
        (np.zeros(5, dtype=int), 0.5, r"fill = 0\.5 is no value of type int64"),
        (np.zeros(5, dtype=int), np.nan, "fill = nan is no value of type int64"),
        (np.zeros(5, dtype=int), 10**30, "fill = 10{30} is no value of type int64"),
        (np.zeros(5, dtype=int), "none", "fill = 'none' is no value of type int64"),
        (np.zeros(5, dtype=int), [1, 2], r"fill = \[1, 2\] is no value"),
    ],
)
def test_what_cannot_stand_for_unmatched(precise, values, fill, message):
    with pytest.raises(DescriptorError, match=message):
        precise.pull_back(values, fill)


@given(precise_maps(), st.integers(0, 10**6))
def test_the_matrix_and_its_transpose(f, seed):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=f.n_target), rng.normal(size=f.shape[0])
    matrix = f.to_sparse()
    assert matrix.shape == f.shape
    np.testing.assert_allclose(matrix.sum(axis=1), f.matched)
    np.testing.assert_allclose(matrix @ x, np.where(f.matched, f @ x, 0.0), atol=1e-12)
    np.testing.assert_allclose((matrix @ x) @ y, x @ (f.T @ y), atol=1e-12)


@given(precise_maps(), st.integers(0, 10**6))
def test_pushing_densities_is_the_adjoint_in_areas_and_preserves_integrals(f, seed):
    rng = np.random.default_rng(seed)
    f_values, g = rng.normal(size=f.n_target), rng.normal(size=f.shape[0])
    a_source, a_target = rng.random(f.shape[0]) + 0.1, rng.random(f.n_target) + 0.1
    pushed = f.push_forward(g, a_source, a_target)
    np.testing.assert_allclose(
        (a_source * (f.to_sparse() @ f_values)) @ g, (a_target * f_values) @ pushed, atol=1e-12
    )
    np.testing.assert_allclose(a_target @ pushed, (a_source * g)[f.matched].sum(), atol=1e-12)


@given(precise_maps(), st.integers(0, 10**6))
def test_pushing_means_preserves_constants_and_bounds(f, seed):
    rng = np.random.default_rng(seed)
    areas, g = rng.random(f.shape[0]) + 0.1, rng.normal(size=(f.shape[0], 2))
    reached = f.T @ f.matched > 0
    np.testing.assert_allclose(f.push_forward(np.full(f.shape[0], 3.0), areas)[reached], 3.0)
    pushed = f.push_forward(g, areas)
    np.testing.assert_array_equal(np.isnan(pushed).all(axis=1), ~reached)
    assert (np.abs(pushed[reached]) <= np.abs(g).max(initial=0) + 1e-12).all()


def test_unmatched_values_are_not_pushed():
    assert Correspondence([0, -1], 1).push_forward([2.0, np.nan], [1.0, 1.0]).tolist() == [2.0]


def test_where_no_image_lies_an_integral_is_0_even_without_area():
    f = Correspondence([0, 0], 3)
    assert f.push_forward([1.0, 2.0], [1.0, 1.0], target_areas=[2.0, 1.0, 0.0]).tolist() == [1.5, 0.0, 0.0]


@pytest.mark.parametrize(
    ("values", "source_areas", "target_areas", "message"),
    [
        ([1, 2], [1.0, 1.0], None, "labels have no mean; carry them with reversed"),
        ([1.0], [1.0, 1.0], None, r"values have shape \(1,\), expected \(2,\): one for each vertex"),
        ([1.0, 2.0], [1.0], None, r"source areas have shape \(1,\)"),
        ([1.0, 2.0], [1.0, 1.0], [1.0], r"target areas have shape \(1,\), expected \(3,\)"),
        ([1.0, 2.0], [1.0, "a"], None, "source areas have type"),
    ],
)
def test_what_cannot_be_pushed(values, source_areas, target_areas, message):
    with pytest.raises(DescriptorError, match=message):
        Correspondence([0, 2], 3).push_forward(values, source_areas, target_areas)
