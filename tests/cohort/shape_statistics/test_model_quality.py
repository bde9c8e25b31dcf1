"""Generalisation and specificity: closed forms and monotone facts."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from sklearn.decomposition import PCA

from corresponded import ellipsoids, only, random_shapes
from isomatch.cohort.shape_statistics import ShapeModel, generalisation, leave_one_out, specificity


def test_more_modes_never_describe_a_new_shape_worse():
    model = ShapeModel.fit(random_shapes(10))
    curve = generalisation(model)
    assert len(curve.mean) == 9
    assert (np.diff(curve.mean) <= 1e-12).all()


def test_generalisation_is_that_of_models_made_anew():
    model = ShapeModel.fit(random_shapes(8), weights="uniform")
    flat = model.aligned.reshape(8, -1) / np.sqrt(len(model.mean))
    for j in (0, 1, 3, 6):
        errors = []
        for i in range(8):
            others = np.delete(flat, i, axis=0)
            missed = flat[i] - others.mean(axis=0)
            if j:
                pca = PCA(j).fit(others)
                missed = flat[i] - pca.inverse_transform(pca.transform(flat[i : i + 1]))[0]
            errors.append(np.linalg.norm(missed))
        assert generalisation(model).mean[j] == pytest.approx(np.mean(errors), rel=1e-6)


@pytest.mark.parametrize("n_factors", [3, 100])
def test_a_shape_left_out_is_as_unusual_as_to_a_model_made_anew(n_factors):
    model = ShapeModel.fit(random_shapes(8, n_factors), weights="uniform")
    flat = model.aligned.reshape(8, -1) / np.sqrt(len(model.mean))
    usual = leave_one_out(model)
    for i in range(8):
        others = np.delete(flat, i, axis=0)
        pca = PCA(
            len(ShapeModel.fit(only(random_shapes(8, n_factors), [j for j in range(8) if j != i])).modes)
        )
        along = pca.fit(others).transform(flat[i : i + 1])[0]
        assert usual.mahalanobis[i] == pytest.approx(
            np.sqrt((along**2 / pca.explained_variance_).sum()), rel=1e-6
        )
        error = np.linalg.norm(flat[i] - pca.inverse_transform(along[None])[0])
        assert usual.errors[i] == pytest.approx(error, rel=1e-6, abs=1e-12)
    assert usual.errors.mean() == pytest.approx(generalisation(model).mean[-1])


def test_shapes_of_one_mode_are_described_by_it():
    curve = generalisation(ShapeModel.fit(ellipsoids([0.8, 1.0, 1.1, 1.4])))
    assert curve.mean[0] > 0.1
    assert curve.mean[1:].max() < 1e-9


def test_without_modes_the_random_shape_is_the_mean():
    model = ShapeModel.fit(random_shapes(6))
    nearest = np.sqrt((model.scores**2).sum(axis=1)).min()
    curve = specificity(model, n_samples=50)
    assert curve.mean[0] == pytest.approx(nearest)
    assert curve.standard_error[0] == pytest.approx(0, abs=1e-12)


def test_specificity_of_one_mode_is_an_integral():
    model = ShapeModel.fit(ellipsoids([0.8, 1.0, 1.1, 1.4]))
    sd = model.deviations[0]
    expected, _ = quad(lambda z: norm.pdf(z) * np.abs(z * sd - model.scores[:, 0]).min(), -8, 8, limit=200)
    curve = specificity(model, n_samples=20000)
    assert abs(curve.mean[1] - expected) < 4 * curve.standard_error[1]
    assert np.array_equal(specificity(model, seed=3).mean, specificity(model, seed=3).mean)


def test_specificity_measures_distances_of_shapes():
    model = ShapeModel.fit(random_shapes(5))
    curve = specificity(model, n_samples=1, seed=1)
    draw = np.random.default_rng(1).standard_normal(4) * model.deviations
    for j in range(5):
        drawn = model.vertices(draw[:j])
        away = np.sqrt(((model.aligned - drawn) ** 2).sum(axis=2) @ model.weights)
        assert curve.mean[j] == pytest.approx(away.min())


def test_of_many_shapes_some_are_left_out():
    model = ShapeModel.fit(random_shapes(30))
    whole = generalisation(model)
    part = generalisation(model, seed=2, most=15)
    assert (np.abs(part.mean - whole.mean) < 4 * part.standard_error).all()


def test_few_shapes():
    one = ShapeModel.fit(ellipsoids([1.0]))
    assert len(generalisation(one).mean) == len(leave_one_out(one).errors) == 0
    two = ShapeModel.fit(ellipsoids([1.0, 1.2]))
    assert generalisation(two).mean == pytest.approx(np.ptp(two.scores))
    assert leave_one_out(two).mahalanobis.tolist() == [0.0, 0.0]
    same = ShapeModel.fit(ellipsoids([1.0] * 4))
    assert generalisation(same).mean.max() == 0
    assert specificity(same).mean.tolist() == [0.0]
