"""Shape models: closed forms, invariance, scikit-learn as another route, files."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from sklearn.decomposition import PCA

from corresponded import ellipsoids, moved, only, random_shapes
from isomatch import Asset, Mesh, write_asset
from isomatch._core.errors import FormatError, InputError, MeshError, SettingError
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeModel,
    compactness,
    generalised_procrustes,
)
from isomatch.io import Polygons

LENGTHS = [0.7, 0.9, 1.0, 1.2, 1.5]


def test_one_axis_is_one_mode_and_its_length_the_score():
    model = ShapeModel.fit(ellipsoids(LENGTHS), weights="uniform")
    assert model.n_modes == 1
    lengths = np.array(LENGTHS)
    slope = model.scores[:, 0] / (lengths - lengths.mean())
    np.testing.assert_allclose(slope, slope[0])
    assert slope[0] > 0, "the positive direction is outward"
    z = ellipsoids([1.0]).vertices[0, :, 2]
    assert model.variances[0] == pytest.approx(lengths.var(ddof=1) * (z**2).mean())
    np.testing.assert_allclose(model.vertex_variances, lengths.var(ddof=1) * z**2, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("n_shapes", [4, 300])
@pytest.mark.parametrize("weights", ["uniform", "area"])
def test_scikit_learn_finds_the_same_modes(n_shapes, weights):
    shapes = random_shapes(n_shapes, n_factors=10)
    model = ShapeModel.fit(shapes, weights=weights)
    share = shapes.area_weights if weights == "area" else np.full(shapes.n_vertices, 1 / shapes.n_vertices)
    aligned = generalised_procrustes(shapes.vertices, share).aligned * np.sqrt(share)[:, None]
    other = PCA(model.n_modes).fit(aligned.reshape(n_shapes, -1))
    np.testing.assert_allclose(model.variances, other.explained_variance_, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(model.variance_ratios, other.explained_variance_ratio_, rtol=1e-8, atol=1e-12)
    count = min(model.n_modes, 10)  # more are of rotations, and small
    flat = (model.modes * np.sqrt(share)[:, None]).reshape(model.n_modes, -1)
    agreement = np.abs((flat * other.components_).sum(axis=1))[:count]
    np.testing.assert_allclose(agreement, 1, atol=1e-6)


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_all_modes_describe_every_shape(scale):
    shapes = moved(random_shapes(6), scale=True)
    model = ShapeModel.fit(shapes, scale)
    aligned = generalised_procrustes(shapes.vertices, shapes.area_weights, scale).aligned
    np.testing.assert_allclose(model.aligned, aligned, atol=1e-9)
    assert model.n_modes == 5
    np.testing.assert_allclose(model.scores.mean(axis=0), 0, atol=1e-9)
    np.testing.assert_allclose(model.scores.var(axis=0, ddof=1), model.variances)
    gram = np.einsum("kij,i,lij->kl", model.modes, model.weights, model.modes)
    np.testing.assert_allclose(gram, np.eye(5), atol=1e-9)


def test_variances_add_up():
    model = ShapeModel.fit(random_shapes(8))
    whole = model.variances.sum()
    assert model.weights @ model.vertex_variances == pytest.approx(whole)
    np.testing.assert_allclose(model.aligned.var(axis=0, ddof=1).sum(axis=1), model.vertex_variances)
    shares = compactness(model)
    assert shares[0] == 0
    assert shares[-1] == pytest.approx(1)
    assert (np.diff(shares, 2) <= 1e-12).all(), "modes are in decreasing order"


def test_places_order_and_labels_of_vertices_do_not_matter():
    shapes = random_shapes(6, spread=0.3)
    model = ShapeModel.fit(shapes)
    order = [4, 2, 0, 5, 1, 3]
    np.testing.assert_allclose(ShapeModel.fit(moved(shapes, 3)).scores, model.scores, atol=1e-8)
    np.testing.assert_allclose(ShapeModel.fit(only(shapes, order)).scores, model.scores[order], atol=1e-8)
    old = np.random.default_rng(0).permutation(shapes.n_vertices)
    relabelled = CorrespondedShapes(shapes.names, shapes.vertices[:, old], np.argsort(old)[shapes.faces])
    again = ShapeModel.fit(relabelled)
    np.testing.assert_allclose(again.scores, model.scores, atol=1e-8)
    np.testing.assert_allclose(again.modes, model.modes[:, old], atol=1e-7)


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_a_shape_of_the_model_has_its_scores(scale):
    shapes = moved(random_shapes(6))
    model = ShapeModel.fit(shapes, scale)
    for i in range(6):
        scored = model.score(moved(shapes, 9).mesh(i))
        np.testing.assert_allclose(scored.scores, model.scores[i], atol=1e-9)
        np.testing.assert_allclose(scored.deviations, model.scores[i] / np.sqrt(model.variances), atol=1e-6)
        assert scored.error < 1e-8
        assert scored.vertex_errors.max() < 1e-7


def test_a_new_shape_is_described_as_far_as_the_modes_go():
    model = ShapeModel.fit(ellipsoids(LENGTHS), weights="uniform")
    within = model.score(ellipsoids([1.1]).mesh(0))
    assert within.error < 1e-9
    assert within.scores[0] == pytest.approx(np.interp(1.1, LENGTHS, model.scores[:, 0]))
    wider = ellipsoids([1.1]).vertices[0] * [1.0, 1.2, 1.0]
    beyond = model.score(Mesh(wider, model.faces))
    assert beyond.error == pytest.approx(0.2 * np.sqrt((wider[:, 1] ** 2).mean()) / 1.2)


@pytest.mark.parametrize("mode", [0, 3, 7])
def test_the_mean_moved_along_a_mode_is_as_many_deviations_away(mode):
    model = ShapeModel.fit(moved(random_shapes(9)))
    scored = model.score(model.mode_mesh(mode, 3.0))
    assert scored.mahalanobis == pytest.approx(3, abs=1e-9)
    assert scored.p_value == pytest.approx(chi2.sf(9, 8))
    assert scored.error < 1e-9
    assert model.score(model.mesh()).p_value == pytest.approx(1)


def test_a_bump_is_found_where_it_is():
    model = ShapeModel.fit(random_shapes(12, n_factors=3))
    bumped = model.mean.copy()
    bumped[17] += 0.2 * model.mesh().vertex_normals[17]
    scored = model.score(Mesh(bumped, model.faces))
    errors = scored.vertex_errors
    assert errors.argmax() == 17
    assert errors[17] > 3 * np.delete(errors, 17).max()
    unseen = model.score(Mesh(bumped, model.faces), np.arange(len(bumped)) != 17)
    assert np.isnan(unseen.vertex_errors[17])
    assert np.nanmax(unseen.vertex_errors) < 1e-9


def test_a_file_is_cut_as_the_model(tmp_path):
    i, j = (grid.ravel() for grid in np.mgrid[:4, :4])
    first = 5 * i + j
    quads = np.column_stack([first, first + 5, first + 6, first + 1])
    flat = np.column_stack([*(grid.ravel() for grid in np.mgrid[:5.0, :5.0]), np.zeros(25)])
    vertices = flat + 0.1 * np.random.default_rng(0).standard_normal((4, 25, 3))
    shapes = CorrespondedShapes(tuple("abcd"), vertices, Polygons.of_triangles(quads).triangles)
    model = ShapeModel.fit(shapes)
    for turns in range(4):  # a fan from the next corner is the other diagonal
        polygons = Polygons.of_triangles(np.roll(quads, turns, axis=1))
        write_asset(tmp_path / "quads.ply", Asset(vertices[1], polygons))
        np.testing.assert_allclose(
            model.score_file(tmp_path / "quads.ply").scores, model.scores[1], atol=1e-6
        )
    for odd in (quads[::-1], quads[:-1], np.column_stack([quads[:, :3], quads[::-1, 3]])):
        write_asset(tmp_path / "odd.ply", Asset(vertices[1], Polygons.of_triangles(odd)))
        with pytest.raises(MeshError, match=r"odd\.ply: .* has other faces .* isomatch collect add"):
            model.score_file(tmp_path / "odd.ply")


def test_what_was_not_measured_tells_nothing():
    shapes = moved(random_shapes(6))
    measured = np.ones((6, shapes.n_vertices), dtype=bool)
    measured[2, :40] = False
    lacking = replace(shapes, measured=measured)
    model = ShapeModel.fit(lacking)
    spoilt = moved(shapes, 9).vertices[2].copy()
    spoilt[:40] += 5.0
    scored = model.score(Mesh(spoilt, model.faces), measured[2])
    np.testing.assert_allclose(scored.scores, model.scores[2], atol=1e-4)
    assert scored.error < 1e-4
    assert model.score(Mesh(spoilt, model.faces)).error > 1
    with pytest.raises(MeshError, match="some of them true"):
        model.score(Mesh(spoilt, model.faces), np.zeros(shapes.n_vertices, dtype=bool))
    with pytest.raises(MeshError, match=r"measured has shape \(3,\)"):
        model.score(Mesh(spoilt, model.faces), np.ones(3, dtype=bool))


def test_a_part_of_the_mean_is_the_mean_whatever_its_size():
    model = ShapeModel.fit(moved(random_shapes(6)), "remove")
    measured = np.arange(len(model.mean)) < 100
    scored = model.score(Mesh(7 * model.mean, model.faces), measured)
    assert np.abs(scored.deviations).max() < 0.2


def test_a_vertex_without_area_moves_along():
    shapes = ellipsoids(LENGTHS)
    beside = np.concatenate([shapes.vertices, shapes.vertices[:, :1] * 2], axis=1)
    model = ShapeModel.fit(CorrespondedShapes(shapes.names, beside, shapes.faces))
    assert model.weights[-1] == 0
    np.testing.assert_allclose(model.aligned, beside, atol=1e-9)


def test_few_shapes():
    one = ShapeModel.fit(ellipsoids([1.0]))
    assert repr(one) == "ShapeModel(0 modes of 1 shapes, 162 vertices)"
    np.testing.assert_allclose(one.mesh().vertices, ellipsoids([1.0]).vertices[0], atol=1e-12)
    assert one.score(one.mesh()).error < 1e-12
    two = ShapeModel.fit(moved(ellipsoids([1.0, 1.3])))
    assert two.n_modes == 1
    assert two.scores[0, 0] == pytest.approx(-two.scores[1, 0])
    assert two.scores[1, 0] > 0
    same = ShapeModel.fit(moved(ellipsoids([1.0] * 4)))
    assert same.n_modes == 0
    assert same.vertex_variances.max() == 0


def test_meshes_of_modes():
    model = ShapeModel.fit(random_shapes(5))
    up, down = (model.mode_mesh(1, sign * 2.0).vertices for sign in (1, -1))
    np.testing.assert_allclose((up + down) / 2, model.mean)
    np.testing.assert_allclose(model.vertices([0, 2 * model.deviations[1]]), up)
    moved_by = np.sqrt(model.weights @ ((up - model.mean) ** 2).sum(axis=1))
    assert moved_by == pytest.approx(2 * model.deviations[1])


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_files(scale, tmp_path):
    model = ShapeModel.fit(random_shapes(5), scale)
    model.save(tmp_path / "model.npz")
    again = ShapeModel.load(tmp_path / "model.npz")
    for name in ("names", "mean", "faces", "weights", "modes", "variances", "scores", "size"):
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    with np.load(tmp_path / "model.npz") as stored:
        arrays = dict(stored)
    np.savez(tmp_path / "model.npz", **arrays | {"names": np.array("[")})
    with pytest.raises(FormatError, match="not a shape model"):
        ShapeModel.load(tmp_path / "model.npz")
    np.savez(tmp_path / "model.npz", **arrays | {"format_version": np.array(99)})
    with pytest.raises(FormatError, match="has format version 99"):
        ShapeModel.load(tmp_path / "model.npz")


def test_bad_input():
    model = ShapeModel.fit(ellipsoids(LENGTHS))
    with pytest.raises(SettingError, match="at most 1"):
        model.vertices([1, 2])
    with pytest.raises(SettingError, match="mode = 1"):
        model.mode_mesh(1, 2.0)
    with pytest.raises(SettingError, match="weights = 'volume'"):
        ShapeModel.fit(ellipsoids(LENGTHS), weights="volume")
    with pytest.raises(MeshError, match="faces"):
        model.score(Mesh(model.mean, model.faces[::-1]))
    unplaced = model.mean.copy()
    unplaced[3] = np.nan
    with pytest.raises(MeshError, match="position"):
        model.score(Mesh(unplaced, model.faces))
    flat = CorrespondedShapes(("a",), [np.zeros_like(model.mean)], model.faces)
    with pytest.raises(InputError, match="shape a has area 0"):
        ShapeModel.fit(flat)
