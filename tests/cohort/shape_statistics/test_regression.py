"""Shape regressed on size and other variables: closed forms, and p-values that are those of chance."""

import numpy as np
import pytest
from scipy.stats import kstest

from corresponded import moved, random_shapes
from isomatch import InputError, SettingError
from isomatch.cohort.shape_statistics import (
    centroid_sizes,
    generalised_procrustes,
    group_test,
    shape_regression,
)

RNG = np.random.default_rng(5)


def test_what_depends_on_a_variable_alone_is_described_altogether():
    direction = RNG.normal(size=(7, 3))
    size = RNG.uniform(1, 2, 9)
    shapes = size[:, None, None] * direction + RNG.normal(size=(7, 3))
    found = shape_regression(shapes, size, n_permutations=99)
    assert found.r_squared == pytest.approx(1)
    assert found.p_value == 0.01
    np.testing.assert_allclose(found.coefficients[0], direction)
    length = np.sqrt((direction**2).sum() / 7)
    np.testing.assert_allclose(found.scores[:, 0], length * (size - size.mean()))
    np.testing.assert_allclose(found.mean, shapes.mean(axis=0))


def test_sums_of_squares_are_those_of_least_squares():
    shapes, variables = RNG.normal(size=(15, 6, 3)), RNG.normal(size=(15, 2))
    weights = RNG.uniform(size=6)
    found = shape_regression(shapes, variables, weights, n_permutations=1)
    design = np.column_stack([np.ones(15), variables])
    flat = shapes.reshape(15, -1)
    solution, *_ = np.linalg.lstsq(design, flat, rcond=None)
    of_column = np.repeat(weights / weights.sum(), 3)
    residual = ((flat - design @ solution) ** 2 @ of_column).sum()
    total = ((flat - flat.mean(axis=0)) ** 2 @ of_column).sum()
    assert found.r_squared == pytest.approx(1 - residual / total)
    np.testing.assert_allclose(found.coefficients.reshape(2, -1), solution[1:], atol=1e-12)


def test_p_values_of_chance_are_uniform_and_of_the_seed():
    p_values = [
        shape_regression(RNG.normal(size=(8, 3, 3)), RNG.normal(size=8), n_permutations=99, seed=i).p_value
        for i in range(200)
    ]
    assert kstest(p_values, "uniform").pvalue > 0.01
    shapes, size = RNG.normal(size=(8, 3, 3)), RNG.normal(size=8)
    first, again, other = (
        shape_regression(shapes, size, n_permutations=99, seed=seed).p_value for seed in (1, 1, 2)
    )
    assert first == again != other


def test_groups_as_a_variable():
    """The share between two groups, whose difference is the coefficient of their indicator."""
    shapes = RNG.normal(size=(10, 4, 3))
    second = np.arange(10) >= 6
    found = shape_regression(shapes, second.astype(float), n_permutations=9)
    test = group_test(shapes, ["b" if x else "a" for x in second], n_permutations=9)
    np.testing.assert_allclose(found.coefficients[0], test.difference, atol=1e-12)


@pytest.mark.parametrize(
    ("shapes", "variables", "message"),
    [
        (2, [1.0, 2.0], "2 shapes are too few"),
        (4, [3.0] * 4, "do not vary"),
        (4, [[0, 0.0], [1, 2], [2, 4], [3, 6]], "depends on the others"),
        (4, [1.0, 2.0], "for each of the 4 shapes"),
        (4, [1.0, 2.0, np.nan, 3.0], "finite number"),
    ],
)
def test_variables_that_tell_nothing_are_refused(shapes, variables, message):
    with pytest.raises(InputError, match=message):
        shape_regression(RNG.normal(size=(shapes, 5, 3)), variables)


def test_no_permutation_is_refused():
    with pytest.raises(SettingError, match="n_permutations = 0"):
        shape_regression(RNG.normal(size=(4, 5, 3)), [1, 2, 3, 4], n_permutations=0)


def test_centroid_sizes():
    shapes = random_shapes(5)
    sizes = centroid_sizes(shapes.vertices)
    apart = shapes.vertices - shapes.vertices.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(sizes, np.linalg.norm(apart.reshape(5, -1), axis=1))
    np.testing.assert_allclose(centroid_sizes(moved(shapes).vertices), sizes)
    np.testing.assert_allclose(centroid_sizes(3 * shapes.vertices, shapes.area_weights) / 3,
                               centroid_sizes(shapes.vertices, shapes.area_weights))  # fmt: skip
    doubled = np.concatenate([shapes.vertices, shapes.vertices[:, :1]], axis=1)
    weights = np.ones(43)
    weights[[0, 42]] = 0.5  # the same vertex twice, with half the weight each
    np.testing.assert_allclose(centroid_sizes(doubled, weights) / np.sqrt(43), sizes / np.sqrt(42))


def test_removed_sizes_are_those_that_alignment_takes_away():
    shapes = moved(random_shapes(6), scale=True)
    scales = generalised_procrustes(shapes.vertices, None, "remove").scales
    product = scales * centroid_sizes(shapes.vertices)
    np.testing.assert_allclose(product, product[0])
