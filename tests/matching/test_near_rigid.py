"""Meshes that are alike in space are also matched from their poses, however they lie."""

from dataclasses import replace

import numpy as np
import pytest

from broken_ring import error_of, ring
from isomatch import Config, match
from isomatch.datasets import example_pair
from isomatch.matching import prepare_pair
from isomatch.matching.proposals.starts import starts_from_poses
from isomatch.settings import SearchSettings

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
