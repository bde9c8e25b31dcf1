"""The test of two groups: its level without an effect, its power with one, and two routes to T²."""

import numpy as np
import pytest
from scipy.stats import kstest

from isomatch._core.errors import InputError, SettingError
from isomatch.cohort.shape_statistics import group_test

LABELS = ["b"] * 9 + ["a"] * 11


def normal(n_vertices, seed=0, n_shapes=20):
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(n_vertices, 3, 3))
    return np.einsum("sij,ijk->sik", rng.normal(size=(n_shapes, n_vertices, 3)), mixing)


@pytest.mark.parametrize("method", ["permutation", "parametric"])
def test_without_an_effect_p_is_uniform(method):
    test = group_test(normal(2000), LABELS, method=method, n_permutations=999)
    assert kstest(test.p_values, "uniform").pvalue > 0.001
    assert test.significant().mean() < 0.005


def test_where_all_is_null_nothing_is_found_in_most_repetitions():
    """With no effect, any discovery is false: their rate is the chance of at least one."""
    found = [
        group_test(normal(50, seed), LABELS, method="parametric").significant().any() for seed in range(200)
    ]
    assert np.mean(found) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 200)


@pytest.mark.parametrize("method", ["permutation", "parametric"])
def test_a_planted_effect_is_found_and_few_others(method):
    shapes = normal(600, seed=1)
    shapes[:9, :100] += 3 * np.abs(shapes).std(axis=0)[:100]
    test = group_test(shapes, LABELS, method=method, n_permutations=1999)
    found = test.significant()
    assert found[:100].mean() > 0.9
    assert found[100:].sum() / found.sum() < 0.12
    assert test.groups == ("a", "b")
    assert test.counts == (11, 9)
    np.testing.assert_allclose(test.difference, shapes[:9].mean(axis=0) - shapes[9:].mean(axis=0))


def test_t_squared_is_that_of_the_textbook():
    shapes = normal(30, seed=2)
    t_squared = group_test(shapes, LABELS, n_permutations=1).t_squared
    for i in range(30):
        b, a = shapes[:9, i], shapes[9:, i]
        pooled = (8 * np.cov(b.T) + 10 * np.cov(a.T)) / 18
        d = b.mean(axis=0) - a.mean(axis=0)
        assert t_squared[i] == pytest.approx(9 * 11 / 20 * d @ np.linalg.solve(pooled, d))


def test_both_methods_agree_on_normal_shapes():
    shapes = normal(300, seed=3)
    one, two = (group_test(shapes, LABELS, method=m).p_values for m in ("permutation", "parametric"))
    np.testing.assert_allclose(one, two, atol=0.04)


def test_linear_changes_of_coordinates_do_not_matter():
    shapes = normal(40, seed=4)
    turned = shapes @ np.random.default_rng(0).normal(size=(3, 3)) + 7
    for one, two in zip(*(vars(group_test(x, LABELS, n_permutations=99)).items() for x in (shapes, turned))):
        if one[0] in ("t_squared", "p_values", "q_values"):
            np.testing.assert_allclose(two[1], one[1], rtol=1e-6)


def test_vertices_that_move_in_fewer_directions():
    shapes = normal(200, seed=5)
    shapes[:, :100, 2] = 4.0
    shapes[:, 100] = 1.0
    test = group_test(shapes, LABELS, method="parametric")
    assert test.p_values[100] == 1
    assert test.t_squared[100] == 0
    assert kstest(test.p_values[:100], "uniform").pvalue > 0.001
    assert group_test(shapes, LABELS, n_permutations=9).p_values[100] == 1


def test_groups_apart_completely():
    shapes = np.zeros((4, 2, 3))
    shapes[2:] = 1.0
    test = group_test(shapes, ["x", "x", "y", "y"])
    assert test.t_squared.tolist() == [np.inf, np.inf]
    assert test.p_values[0] == pytest.approx(1 / 3, abs=0.03), "two of six exchanges are as far apart"


def test_bad_input():
    shapes = normal(3)
    with pytest.raises(InputError, match="3 groups for 20 shapes"):
        group_test(shapes, ["a", "b", "c"])
    with pytest.raises(InputError, match="two groups"):
        group_test(shapes, ["a"] * 19 + ["b"])
    with pytest.raises(SettingError, match="method = 'guess'"):
        group_test(shapes, LABELS, method="guess")
    with pytest.raises(SettingError, match="n_permutations = 0"):
        group_test(shapes, LABELS, n_permutations=0)
    with pytest.raises(InputError, match="parametric"):
        group_test(shapes[:4], ["a", "a", "b", "b"], method="parametric")
