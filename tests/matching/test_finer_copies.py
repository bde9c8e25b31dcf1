"""Faces that are split in four change no shape: a finer copy is matched as well as the coarse one."""

import numpy as np
import pytest

from data import tosca
from isomatch import Config, match
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import Isometry, prepare_pair
from isomatch_lab.sets import relabelled
from shapes import split_in_four

LABELLINGS = 0, 10
"""Seeds, over which errors are averaged: one labelling of a mesh differs from another by 5 %."""


def mean_error(source, target, image, levels):
    return np.mean([error(source, target, image, levels, seed) for seed in LABELLINGS])


def error(source, target, image, levels, seed):
    """Mean distance × 100 / √area of the images of the vertices of two meshes, which are split some times first."""
    rows, images = np.arange(source.n_vertices), image
    for _ in range(levels):
        source, target = split_in_four(source), split_in_four(target)
    (source, at_source), (target, at_target) = (
        relabelled(mesh, seed + side) for side, mesh in enumerate((source, target))
    )
    found = match(source, target).map.pull_back(target.vertices)[at_source[rows]]
    distance = np.linalg.norm(found - target.vertices[at_target[images]], axis=1)
    return 100 * distance.mean() / np.sqrt(target.area)


@pytest.mark.long
@pytest.mark.parametrize("levels", [1, 2])
def test_a_finer_copy_of_a_creature_is_matched_as_well(levels):
    source, target = example_pair()
    meshes_and_truth = source.mesh, target.mesh, ground_truth(source, target).vertices
    assert mean_error(*meshes_and_truth, levels) < 1.1 * mean_error(*meshes_and_truth, 0)


@pytest.mark.long
@pytest.mark.parametrize(
    "poses", [("horse0", "horse5"), ("horse0", "horse6"), ("horse5", "horse7"), ("cat3", "cat9")]
)
def test_a_finer_copy_of_a_real_shape_is_matched_as_well(poses):
    source, target = map(tosca, poses)
    same = np.arange(source.n_vertices)
    assert mean_error(source, target, same, 1) < 1.1 * mean_error(source, target, same, 0)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_what_a_copy_of_a_shape_is_called_decides_nothing(seed):
    """Half of the copies of this pair had a head turned about its axis, and an error of 2."""
    source, target = tosca("horse0"), tosca("horse5")
    assert error(source, target, np.arange(source.n_vertices), 0, 10 * seed) < 0.7


@pytest.mark.long
@pytest.mark.parametrize("stuck", [False, True])
def test_a_map_refined_once_more_scores_no_worse(stuck):
    """And better if it was refined with all functions at once."""
    source, target = (shape.mesh for shape in example_pair())
    at_once = {"sizes_without_positions": (), "sizes_with_positions": (), "final_sizes": (200,)}
    scores = []
    for sizes in ((), Config().refining.sizes_again):
        config = Config.from_dict({"refining": {"sizes_again": sizes, **(at_once if stuck else {})}})
        relation = Isometry(prepare_pair(source, target, config))
        candidates, _ = relation.candidates(*relation.hypotheses())
        scores.append([fit.score for fit in relation.refine_jointly(relation.begin(candidates[:3]))])
    once, again = scores
    assert len(once) == len(again)
    assert all(np.less_equal(again, once))
    assert min(again) < min(once) or not stuck
