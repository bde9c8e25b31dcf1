"""Meshes that are alike in space are also matched from their poses, however they lie."""

from dataclasses import replace

import numpy as np
import pytest

from broken_ring import error_of, ring
from isomatch import Config, Mesh, match, match_both
from isomatch.datasets import example_pair
from isomatch.evaluation import geodesic_errors
from isomatch.matching import prepare_pair
from isomatch.matching.proposals.starts import starts_from_poses, starts_if_alike
from isomatch.matching.refinements import bumpy_ball
from isomatch.settings import SearchSettings
from shapes import icosphere

WITHOUT = Config(search=SearchSettings(near_rigid=0.0))


@pytest.mark.long
def test_a_broken_ring_is_matched():
    """Distances across the break differ by half the ring."""
    source, target = ring(4, broken=True), ring(4, n=45, bent=0.03)
    found = match(source[0], target[0])
    assert error_of(source, target, found.map.vertices) < 0.08


@pytest.mark.long
def test_where_a_shape_lies_does_not_matter():
    (source, rest), (target, target_rest) = ring(1), ring(1, n=45, bent=0.03)
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    for mesh in (target, replace(target, vertices=5 + 3 * target.vertices @ turn)):
        pair = prepare_pair(source, mesh)
        start, *_ = starts_from_poses(pair)
        assert error_of((source, rest[start[:, 0]]), (target, target_rest), start[:, 1]) < 0.1


@pytest.mark.long
def test_mirror_images_are_found_if_asked_for():
    (source, rest), (target, target_rest) = ring(1), ring(1, n=45)
    mirrored = replace(target, vertices=target.vertices * [1, 1, -1], faces=target.faces[:, ::-1])
    pair = prepare_pair(source, mirrored)

    def errors(orientation):
        starts = starts_from_poses(replace(pair, config=Config(orientation=orientation)))
        return [
            error_of((source, rest[rows]), (mirrored, target_rest), image)
            for rows, image in map(np.transpose, starts)
        ]

    assert min(errors("reverse")) < 0.1
    assert min(errors("any")) < 0.1
    assert min(errors("preserve")) > 0.1


@pytest.mark.long
def test_other_poses_and_shapes_without_triangles_have_none():
    source, target = example_pair()
    pair = prepare_pair(source.mesh, target.mesh)
    assert starts_from_poses(pair) == []
    assert starts_from_poses(prepare_pair(source.mesh, source.mesh))
    assert starts_from_poses(prepare_pair(source.mesh, source.mesh, WITHOUT)) == []


@pytest.fixture(scope="module")
def alike():
    """A bumpy ball, and one of another individual that is turned, and whose vertices have other numbers."""
    ball, number = bumpy_ball(800), np.random.default_rng(1).permutation(800)
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    x, y, z = (ball.vertices * (1 + 0.04 * np.sin(2 * ball.vertices))).T
    other = Mesh((np.column_stack([1.05 * x, y, z]) @ turn)[np.argsort(number)], number[ball.faces])
    return prepare_pair(ball, other), number


def test_shapes_that_are_alike_are_laid_by_one_motion(alike):
    pair, number = alike
    starts = starts_if_alike(pair)
    images = pair.target_vertices[starts[0]]
    assert pair.target.mean_distance(images, number[pair.source_vertices]) < 0.1
    without = replace(pair.config, search=WITHOUT.search)
    assert starts_if_alike(replace(pair, config=without)) == []


def test_a_mirror_image_is_not_alike(alike):
    pair, _ = alike
    mesh = pair.target.mesh_body
    mirrored = Mesh(mesh.vertices * [1, 1, -1], mesh.faces[:, ::-1])
    assert starts_if_alike(prepare_pair(pair.source, mirrored)) == []
    assert starts_if_alike(prepare_pair(icosphere(3), icosphere(3))) == []  # every motion does as well


@pytest.mark.long
def test_alike_shapes_have_the_map_that_a_search_finds(alike):
    pair, number = alike
    source, target = pair.source.surface, pair.target.surface
    found, searched = match_both(source, target), match_both(source, target, config=WITHOUT)
    assert found.source_to_target.origin == "poses"
    rows = np.column_stack([np.arange(800), number])
    for result, other, ends in zip(found, searched, (rows, rows[:, ::-1])):
        onto = (target, source)[ends is not rows]
        errors, others = (geodesic_errors(onto, x.map, ends).mean() for x in (result, other))
        assert errors < 0.03
        assert errors < 1.1 * others + 0.001
        assert result.outcome is other.outcome
