"""Open surfaces that seem to be inside out: told, and left as they are."""

import numpy as np
import pytest

from isomatch import Mesh, prepare
from isomatch.datasets import example_pair
from isomatch.repair import repair, seems_inside_out
from shapes import icosphere, inside_out, upper_share
from zoo import grid

BODIES = [*(creature.mesh for creature in example_pair()), icosphere(3)]


@pytest.mark.parametrize("body", BODIES, ids=["standing", "running", "ball"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("share", [0.2, 0.5])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_parts_of_bodies_with_large_openings(body, axis, share, scale):
    part = upper_share(body, axis, share)
    part = part.moved(scale * (part.vertices + 3))
    assert not seems_inside_out(part)
    mended = repair(inside_out(part))
    was_turned = "rewound" in " ".join(
        mended.changes
    )  # as of the runner cut across, whose openings are small
    assert seems_inside_out(mended.mesh) != was_turned


def test_closed_and_flat_surfaces_tell_nothing():
    rough = grid(20, 20)
    bumps = 0.02 * np.ptp(rough.vertices) * np.random.default_rng(0).normal(size=rough.vertices.shape)
    for mesh in (*BODIES, rough, rough.moved(rough.vertices + bumps), Mesh(np.zeros((0, 3)), [])):
        assert not seems_inside_out(mesh)
        assert not seems_inside_out(inside_out(mesh))


def test_a_prepared_shape_says_so():
    part = upper_share(BODIES[0], 2, 0.5)
    assert not any("inside out" in note for note in prepare(part).notes)
    assert any("seems to be inside out" in note for note in prepare(inside_out(part)).notes)
