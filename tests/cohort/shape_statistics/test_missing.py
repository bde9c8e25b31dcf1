"""Vertices that were not measured: wherever they are in the files, nothing depends on it."""

from dataclasses import replace

import numpy as np
import pytest

from corresponded import moved, random_shapes
from isomatch import Correspondence, MeshError, write_asset
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeModel,
    filled,
    generalised_procrustes,
    group_test,
    measured_variances,
    read_shapes,
)
from isomatch.io import Asset, Attribute

RNG = np.random.default_rng(3)


def with_gaps(shapes, share=0.15, seed=0):
    """Some vertices of each shape but the first are not measured."""
    measured = np.random.default_rng(seed).random(shapes.vertices.shape[:2]) > share
    measured[0] = True
    return replace(shapes, measured=measured)


def with_nonsense(shapes, seed=0):
    """The same, with the missing vertices anywhere."""
    anywhere = np.random.default_rng(seed).normal(size=shapes.vertices.shape) * 20
    return replace(shapes, vertices=np.where(shapes.measured[:, :, None], shapes.vertices, anywhere))


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_the_places_of_missing_vertices_make_no_difference(scale):
    shapes = with_gaps(moved(random_shapes(9), scale=scale == "remove"))
    places = [filled(each, None, scale).vertices for each in (shapes, with_nonsense(shapes))]
    size = np.sqrt((shapes.vertices - shapes.vertices.mean(axis=1, keepdims=True)) ** 2).mean()
    np.testing.assert_allclose(places[0], places[1], atol=2e-5 * size)
    assert np.array_equal(places[0][shapes.measured], shapes.vertices[shapes.measured])


@pytest.mark.parametrize("scale", ["keep", "remove"])
def test_aligned_they_lie_on_the_mean(scale):
    shapes = filled(with_nonsense(with_gaps(moved(random_shapes(9)))), None, scale)
    found = generalised_procrustes(shapes.vertices, None, scale)
    apart = np.linalg.norm(found.aligned - found.mean, axis=2)
    assert apart[~shapes.measured].max() < 1e-4 * np.median(apart[shapes.measured])


def test_the_mean_is_that_of_what_was_measured():
    """A shape that lacks a part is aligned by the rest alone."""
    base = random_shapes(1).vertices[0]
    measured = np.ones((3, len(base)), dtype=bool)
    measured[2, :12] = False
    vertices = np.array([base, base, base])
    vertices[2, :12] += [0, 0, 9]
    shapes = filled(moved(CorrespondedShapes("abc", vertices, random_shapes(1).faces, measured=measured)))
    model = ShapeModel.fit(shapes)
    assert model.n_modes == 0 or model.deviations.max() < 1e-5


def test_without_gaps_nothing_is_done():
    shapes = random_shapes(4)
    assert filled(shapes) is shapes
    assert replace(shapes, measured=np.ones((4, 42), dtype=bool)).measured is None
    np.testing.assert_allclose(
        measured_variances(shapes.vertices, shapes), shapes.vertices.var(axis=0, ddof=1).sum(axis=1)
    )


def test_variances_are_those_of_the_shapes_that_measured():
    shapes = with_gaps(random_shapes(6))
    measured = shapes.measured.copy()
    measured[1:, 7] = False
    shapes = with_nonsense(replace(shapes, measured=measured))
    found = measured_variances(shapes.vertices, shapes)
    for i in range(shapes.n_vertices):
        own = shapes.vertices[measured[:, i], i]
        wanted = own.var(axis=0, ddof=1).sum() if len(own) > 1 else np.nan
        np.testing.assert_allclose(found[i], wanted)
    assert np.isnan(found[7])


def test_a_vertex_that_nobody_measured_stays_where_it_is():
    shapes = random_shapes(4)
    measured = np.ones((4, 42), dtype=bool)
    measured[:, 5] = False
    found = filled(replace(shapes, measured=measured))
    assert np.array_equal(found.vertices, shapes.vertices)


def test_the_test_of_groups_leaves_out_what_one_group_lacks():
    shapes = RNG.normal(size=(12, 8, 3))
    shapes[6:, :3] += 4
    measured = np.ones((12, 8), dtype=bool)
    measured[1:6, 1] = False
    test = group_test(shapes, ["a"] * 6 + ["b"] * 6, measured=measured)
    assert np.flatnonzero(test.significant()).tolist() == [0, 2]
    assert (test.p_values[1], test.q_values[1]) == (1, 1)
    alone = group_test(np.delete(shapes, 1, axis=1), ["a"] * 6 + ["b"] * 6)
    np.testing.assert_allclose(np.delete(test.q_values, 1), alone.q_values)


def test_files_say_what_was_measured(tmp_path):
    shapes = with_gaps(random_shapes(4), share=0.3)
    few = shapes.measured.copy()
    few[3, 4:] = False
    for i, name in enumerate(shapes.names):
        mask = Attribute("measured", "point", "label", few[i].astype(np.uint8))
        write_asset(tmp_path / f"{name}.ply", Asset.of_mesh(shapes.mesh(i), [mask] if i else []))
    found = read_shapes(tmp_path)
    assert found.names == shapes.names[:3]
    assert np.array_equal(found.measured, few[:3])
    assert found.left_out == (f"s003: only {few[3].mean():.0%} of its vertices were measured",)


def test_a_mirror_image_lacks_the_other_side():
    shapes = with_gaps(random_shapes(3))
    other = np.random.default_rng(1).permutation(42)
    both = shapes.mirrored([Correspondence(other, 42)] * 3)
    assert np.array_equal(both.measured[3:], shapes.measured[:, other])


def test_a_mask_of_another_shape_is_refused():
    with pytest.raises(MeshError, match="measured has shape"):
        replace(random_shapes(2), measured=np.ones((2, 3), dtype=bool))
