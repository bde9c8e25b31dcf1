"""Functions scaled to mean 0 and variance 1."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from isomatch.descriptors import standardised

FUNCTIONS = arrays(np.float64, (7, 2), elements=st.integers(-1000, 1000))
WEIGHTS = arrays(np.float64, 7, elements=st.floats(0.1, 10))


@given(FUNCTIONS, WEIGHTS)
def test_mean_0_and_variance_1_or_0_where_constant(values, weights):
    result = standardised(values, weights)
    share = weights / weights.sum()
    for function, column in zip(values.T, result.T):
        assert share @ column == pytest.approx(0, abs=1e-9)
        assert share @ column**2 == pytest.approx(0.0 if np.ptp(function) == 0 else 1.0)


@given(FUNCTIONS, WEIGHTS, st.floats(-5, 5), st.floats(0.5, 20), st.floats(0.1, 9))
def test_shift_scale_and_unit_of_the_weights_change_nothing(values, weights, shift, scale, unit):
    result = standardised(scale * values + shift, unit * weights)
    np.testing.assert_allclose(result, standardised(values, weights), atol=1e-9)


def test_relabelling():
    rng = np.random.default_rng(0)
    values, weights, order = rng.normal(size=(50, 3)), rng.random(50), rng.permutation(50)
    plain = standardised(values, weights)
    np.testing.assert_allclose(standardised(values[order], weights[order]), plain[order], atol=1e-12)


def test_a_weight_of_two_is_a_vertex_twice():
    values = np.array([[1.0], [2.0], [7.0]])
    twice = standardised(values[[0, 1, 1, 2]], np.ones(4))
    np.testing.assert_allclose(standardised(values, np.array([1.0, 2.0, 1.0])), twice[[0, 1, 3]])


def test_constant_up_to_rounding_is_constant():
    values = np.column_stack([0.1 + 1e-16 * np.arange(5), np.arange(5.0)])
    assert np.array_equal(standardised(values, np.ones(5))[:, 0], np.zeros(5))
