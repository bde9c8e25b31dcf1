"""Shape completion: conditional Gaussians by another route, limits, invariance, calibration, bad input."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from corresponded import ellipsoids, random_shapes
from isomatch import Correspondence, Landmarks, Mesh, match
from isomatch._core.errors import InputError, LandmarkError, MeshError, NotConvergedError, SettingError
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    Observations,
    ShapeModel,
    complete,
    model_noise,
    observed_landmarks,
    observed_part,
    observed_vertices,
)
from isomatch.cohort.shape_statistics.completion import _Fit
from isomatch.surfaces import PrecisePoints
from isomatch_lab.procedural import creature

TURN = Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix()
N_BODIES = 40


@cache
def model(scale="keep"):
    return ShapeModel.fit(random_shapes(12), scale)


def half(mesh, axis=0):
    """A mesh without the vertices on one side."""
    seen = mesh.vertices[:, axis] > np.median(mesh.vertices[:, axis])
    return mesh.moved(np.where(seen[:, None], mesh.vertices, np.nan))


@cache
def bodies():
    """Bodies that differ by ten smooth fields and a little roughness, and a model of all but the first five."""
    base = creature(1500, kind="biped").mesh
    rng = np.random.default_rng(5)
    waves = np.cos(base.vertices @ rng.normal(size=(3, 10)) * 3 + rng.uniform(0, 6, 10))
    fields = np.einsum("nk,kd->knd", waves, 0.02 * rng.normal(size=(10, 3)))
    shapes = base.vertices + np.tensordot(rng.normal(size=(N_BODIES, 10)), fields, 1)
    shapes += 0.002 * rng.normal(size=shapes.shape)
    names = [f"b{i:02d}" for i in range(N_BODIES)]
    return base, shapes, ShapeModel.fit(CorrespondedShapes(names[5:], shapes[5:], base.faces))


def test_equal_to_conditioning_a_joint_gaussian():
    m = model()
    rng = np.random.default_rng(1)
    corners, weights = m.faces[[3, 17, 40]], rng.dirichlet(np.ones(3), 3)
    noise = np.array([0.05, 0.1, 0.2])
    positions = np.einsum("qc,qcd->qd", weights, m.vertices(m.scores[2])[corners]) + 0.1
    found = complete(m, Observations(PrecisePoints(corners, weights), positions, noise), pose="given")

    prior = np.einsum("k,kid,kje->idje", m.variances, m.modes, m.modes).reshape((3 * len(m.mean),) * 2)
    at = np.zeros((3, len(m.mean)))
    np.put_along_axis(at, corners, weights, axis=1)
    h = np.kron(at, np.eye(3))  # (3 q, 3 n)
    gain = prior @ h.T @ np.linalg.inv(h @ prior @ h.T + np.diag(np.repeat(noise**2 / 3, 3)))
    mean = m.mean.ravel() + gain @ (positions.ravel() - h @ m.mean.ravel())
    covariance = prior - gain @ h @ prior
    np.testing.assert_allclose(found.mesh.vertices.ravel(), mean, atol=1e-9)
    variances = np.diag(covariance).reshape(-1, 3).sum(axis=1)
    np.testing.assert_allclose(found.standard_deviation, np.sqrt(variances), atol=1e-8)


def test_without_observations_it_is_the_mean_with_the_deviations_of_the_model():
    m = model()
    found = complete(m, Observations.at_vertices([], np.zeros((0, 3)), 1.0), pose="given")
    np.testing.assert_allclose(found.mesh.vertices, m.mean)
    np.testing.assert_allclose(found.standard_deviation, np.sqrt(m.vertex_variances))
    np.testing.assert_allclose(found.score_deviations, m.deviations)
    assert np.isnan(found.error)


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_a_shape_of_the_model_that_is_seen_without_noise_has_its_scores(scale):
    m = model(scale)
    moved = m.mesh().moved(m.vertices(m.scores[4]) @ TURN.T * (1 if scale == "keep" else 7) + [5, 6, 7])
    found = complete(m, observed_vertices(m, moved, noise=0.0))
    np.testing.assert_allclose(found.scores, m.scores[4], atol=1e-4)
    np.testing.assert_allclose(found.mesh.vertices, moved.vertices, atol=1e-4)
    assert found.standard_deviation.max() < 1e-3
    assert found.scale == pytest.approx(1 if scale == "keep" else 7, rel=1e-4)


def test_seen_without_noise_in_the_given_pose_it_is_the_projection_on_the_modes():
    m = ShapeModel.fit(random_shapes(12), weights="uniform")
    scored = m.score(random_shapes(13, seed=3).mesh(12))
    every = np.arange(len(m.mean))
    found = complete(m, Observations.at_vertices(every, scored.aligned, 0.0), pose="given")
    np.testing.assert_allclose(found.scores, scored.scores, atol=1e-9)
    assert found.error == pytest.approx(scored.error)


def test_more_observations_never_raise_the_uncertainty():
    m = model()
    order = np.random.default_rng(0).permutation(len(m.mean))
    before = np.inf
    for count in (0, 1, 3, 10, 42):
        rows = order[:count]
        seen = Observations.at_vertices(rows, m.vertices(m.scores[1])[rows], 0.1)
        deviation = complete(m, seen, pose="given").standard_deviation
        assert (deviation <= before + 1e-12).all()
        before = deviation
    assert (before < 0.5 * np.sqrt(m.vertex_variances)).mean() > 0.9


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_the_part_may_be_anywhere(scale):
    m = model(scale)
    part = half(random_shapes(13, seed=3).mesh(12))
    found = complete(m, observed_vertices(m, part))
    factor = 1.0 if scale == "keep" else 20.0
    turned = complete(m, observed_vertices(m, part.moved(factor * part.vertices @ TURN.T + [3, -2, 9])))
    np.testing.assert_allclose(turned.scores, found.scores, atol=1e-6)
    np.testing.assert_allclose(
        turned.mesh.vertices, factor * found.mesh.vertices @ TURN.T + [3, -2, 9], atol=1e-5
    )
    np.testing.assert_allclose(turned.standard_deviation, factor * found.standard_deviation, rtol=1e-5)
    there = turned.scale * m.vertices(turned.scores) @ turned.rotation.T + turned.translation
    np.testing.assert_allclose(turned.mesh.vertices, there)


def test_a_pose_that_is_fitted_is_less_certain_than_one_that_is_given():
    m = model()
    seen = observed_vertices(m, half(m.mesh(m.scores[3])), noise=0.1)
    free, fixed = complete(m, seen), complete(m, seen, pose="given")
    assert (free.standard_deviation > fixed.standard_deviation).all()


@pytest.mark.long
def test_half_a_body_tells_of_the_other_half():
    base, shapes, m = bodies()
    alone = replace(m, modes=m.modes[:0], variances=m.variances[:0], scores=m.scores[:, :0])
    errors, without, inside = [], [], []
    for body in shapes[:5]:
        for axis in range(3):
            seen = observed_vertices(m, half(base.moved(body), axis), noise=model_noise(m))
            found = complete(m, seen)
            error = np.linalg.norm(found.mesh.vertices - body, axis=1)
            hidden = ~np.isfinite(half(base.moved(body), axis).vertices[:, 0])
            errors.append(error[hidden].mean())
            inside.append((error < 2 * found.expected_error)[hidden].mean())
            mean = complete(alone, seen).mesh.vertices
            without.append(np.linalg.norm(mean - body, axis=1)[hidden].mean())
    assert max(np.array(errors) / without) < 0.5
    assert np.mean(errors) < 0.2 * np.mean(without)
    assert np.mean(inside) > 0.95


@pytest.mark.long
def test_a_part_of_other_triangles_is_matched_to_the_mean():
    base, shapes, m = bodies()
    body = base.moved(shapes[0] @ TURN.T + 3)
    kept = np.flatnonzero(base.vertices[:, 2] > np.quantile(base.vertices[:, 2], 0.4))
    order = np.random.default_rng(0).permutation(kept)
    part = Mesh(body.vertices[order], _numbered(base.faces, order, base.n_vertices))
    result = match(part, m.mesh())
    seen = observed_part(m, part, result.map, result.expected_error)
    found, by_map = complete(m, seen), complete(m, replace(seen, surface=None))
    error, plain = (np.linalg.norm(each.mesh.vertices - body.vertices, axis=1) for each in (found, by_map))
    assert error.mean() < 0.6 * plain.mean(), "nearest points are more precise than the map"
    assert error.mean() < 0.2 * np.linalg.norm(m.score(body).aligned - m.mean, axis=1).mean()
    assert (error < 2 * found.expected_error).mean() > 0.95


def _numbered(faces, vertices, n):
    new = np.full(n, -1)
    new[vertices] = np.arange(len(vertices))
    return new[faces[np.isin(faces, vertices).all(axis=1)]]


def test_landmarks_are_joined_by_name():
    m = ShapeModel.fit(ellipsoids([0.7, 0.9, 1.0, 1.2, 1.5]))
    rows = [0, 5, 17, 60, 100]
    names = ["a", "b", "c", "d", "e"]
    truth = m.vertices(m.scores[4]) @ TURN.T + 2
    found = Landmarks([*truth[rows][::-1], [9, 9, 9]], [*names[::-1], "other"])
    seen = observed_landmarks(m, Landmarks(m.mean[rows], names), found, noise=1e-4)
    assert seen.notes == ("landmarks that the mean does not have: other",)
    completed = complete(m, seen)
    np.testing.assert_allclose(completed.mesh.vertices, truth, atol=1e-3)
    errors = replace(found, expected_error=np.full(6, 0.3))
    assert np.allclose(observed_landmarks(m, Landmarks(m.mean[rows], names), errors, noise=0.4).noise, 0.5)


def test_bad_input():
    m = model()
    with pytest.raises(MeshError, match="faces"):
        observed_vertices(m, Mesh(m.mean, m.faces[1:]))
    three = m.mean[[0, 1, 2]]
    with pytest.raises(LandmarkError, match="pose"):
        complete(m, Observations.at_vertices([0, 1], three[:2], 0.1))
    with pytest.raises(LandmarkError, match="on a line"):
        complete(m, Observations.at_vertices([0, 1, 2], three * [1, 0, 0], 0.1))
    with pytest.raises(InputError, match="the model has 0…41"):
        complete(m, Observations.at_vertices([0, 1, 42], three, 0.1))
    with pytest.raises(InputError, match="each"):
        Observations.at_vertices([0, 1], three, 0.1)
    with pytest.raises(InputError, match="must be finite"):
        Observations.at_vertices([0, 1, 2], three * np.nan, 0.1)
    with pytest.raises(SettingError, match="is not a distance"):
        observed_vertices(m, m.mesh(), noise=-1.0)
    with pytest.raises(SettingError, match="fitted"):
        complete(m, observed_vertices(m, m.mesh()), pose="free")
    with pytest.raises(LandmarkError, match="named like"):
        observed_landmarks(m, Landmarks(three, ["a", "b", "c"]), Landmarks(three[:1], ["x"]))
    with pytest.raises(LandmarkError, match="several"):
        observed_landmarks(m, Landmarks(three, ["a", "a", "c"]), Landmarks(three[:1], ["a"]))


def test_steps_that_do_not_settle_are_an_error():
    m = model()
    with pytest.raises(NotConvergedError, match="still move after 1 steps"):
        _Fit.of(m, observed_vertices(m, half(m.mesh(m.scores[3])), noise=0.1), is_free=True, most=1)


@pytest.mark.long
def test_a_part_that_is_wound_inside_out_completes_to_the_same():
    _, shapes, m = bodies()
    shape = m.mesh().moved(shapes[0])
    part, kept = shape.submesh(shape.vertices[:, 1] > np.median(shape.vertices[:, 1]))
    found = Correspondence(kept, shape.n_vertices)
    outward = complete(m, observed_part(m, part, found))
    inward = complete(m, observed_part(m, Mesh(part.vertices, part.faces[:, ::-1]), found))
    np.testing.assert_allclose(inward.mesh.vertices, outward.mesh.vertices)
    assert outward.n_points > 100
    assert not outward.notes


def test_mirror_images_do_not_hide_what_a_model_does_not_describe():
    shapes = random_shapes(12)
    other = Correspondence(np.random.default_rng(0).permutation(shapes.n_vertices), shapes.n_vertices)
    twins = shapes.mirrored([other] * 12)
    alone, both = model_noise(ShapeModel.fit(shapes)), model_noise(ShapeModel.fit(twins))
    assert both > 0.3 * alone
