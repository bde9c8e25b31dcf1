"""Asymmetry: what is common to all shapes and what is of each alone, and p-values that are those of chance."""

import numpy as np
import pytest
from scipy.stats import kstest

from corresponded import moved
from isomatch import InputError, SettingError
from isomatch.statistics import CorrespondedShapes, ShapeModel, asymmetry
from shapes import icosphere

SPHERE = icosphere(2)
OTHER = np.abs(SPHERE.vertices[:, None] * [-1, 1, 1] - SPHERE.vertices).sum(axis=2).argmin(axis=1)
RNG = np.random.default_rng(2)


def heads(m, bump, noise, seed=0):
    """Ellipsoids with a bump on one side, and others on both."""
    rng = np.random.default_rng(seed)
    base = SPHERE.vertices * [2.0, 3.0, 2.5]
    one_side = np.exp(-((SPHERE.vertices - [1, 0, 0]) ** 2).sum(axis=1) / 0.3)[:, None] * [1.0, 0, 0]
    low = np.column_stack([SPHERE.vertices, SPHERE.vertices**2, np.ones(len(base))])
    fields = np.tensordot(rng.normal(size=(m, 3, 7)), low, (2, 1)).transpose(0, 2, 1)
    vertices = base + bump * one_side + noise * fields
    return CorrespondedShapes(tuple(f"h{i}" for i in range(m)), vertices, SPHERE.faces)


def measured(shapes, **options):
    model = ShapeModel.fit(shapes.mirrored(OTHER))
    m = len(shapes)
    return asymmetry(model.aligned[:m], model.aligned[m:], model.weights, **options)


def test_symmetric_shapes_have_none():
    base = SPHERE.vertices * [2.0, 3.0, 2.5]
    grown = base * np.array([[1, 1, 1], [1.1, 1, 1], [1, 1.2, 1]])[:, None]
    found = measured(moved(CorrespondedShapes("abc", grown, SPHERE.faces)))
    np.testing.assert_allclose(found.amounts, 0, atol=1e-9)
    np.testing.assert_allclose(found.directional, 0, atol=1e-9)


def test_a_bump_on_one_side_of_all_is_directional():
    found = measured(moved(heads(10, 0.4, 0.005)), seed=4)
    assert found.share > 0.9
    assert found.p_value < 0.01
    assert found.seed == 4
    length = np.linalg.norm(found.directional, axis=1)
    tips = {int(SPHERE.vertices[:, 0].argmax()), int(SPHERE.vertices[:, 0].argmin())}
    assert set(np.argsort(length)[-2:].tolist()) == tips
    assert length.max() == pytest.approx(0.2, rel=0.25)  # half on each side


def test_parts_add_up():
    """Components are orthogonal: squares of all are those of the mean and of what is left."""
    found = measured(heads(8, 0.1, 0.05))
    weights = np.full(8, 1 / 8)
    total = weights @ found.amounts**2
    assert found.share == pytest.approx(1 - weights @ found.fluctuating**2 / total)


def test_which_side_is_which_makes_no_difference():
    shapes = RNG.normal(size=(6, 9, 3))
    images = RNG.normal(size=(6, 9, 3))
    one, other = asymmetry(shapes, images), asymmetry(images, shapes)
    np.testing.assert_allclose(one.directional, -other.directional)
    np.testing.assert_allclose(one.amounts, other.amounts)
    assert one.p_value == other.p_value


def test_p_values_of_chance_are_uniform():
    p_values = []
    for i in range(200):
        half = RNG.normal(size=(9, 3, 3))
        p_values.append(asymmetry(half, -half, n_permutations=99, seed=i).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01


@pytest.mark.parametrize(
    ("shapes", "images", "options", "error", "message"),
    [
        (3, 2, {}, InputError, "not shapes and as many mirror images"),
        (1, 1, {}, InputError, "1 shapes are too few"),
        (3, 3, {"n_permutations": 0}, SettingError, "n_permutations = 0"),
    ],
)
def test_what_cannot_be_compared_is_refused(shapes, images, options, error, message):
    with pytest.raises(error, match=message):
        asymmetry(np.zeros((shapes, 4, 3)), np.zeros((images, 4, 3)), **options)
