"""A left specimen among right ones: the outcome says that the mirror image fits, and finds it where it may."""

import numpy as np
import pytest

from isomatch import Config, Outcome, match
from isomatch.surfaces import reflected
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature
from shapes import disguised


def lopsided(pose, **changes):
    return creature(2000, pose=pose, style=3, **changes).mesh


@pytest.mark.long
@pytest.mark.parametrize("kind", ["quadruped", "biped"])
def test_a_lopsided_body_and_its_mirror_image(kind):
    """Poses differ, the mirror image is renumbered and turned, and its faces keep their orientation."""
    source, posed = lopsided(1, kind=kind), lopsided(2, kind=kind)
    target = disguised(reflected(posed), seed=1)
    result = match(source, target.mesh)
    assert result.outcome is Outcome.MIRROR_IMAGE
    assert result.quality.mirrored < result.config.outcome.mirror_image
    assert "orientation = 'any'" in result.outcome.advice
    found = match(source, target.mesh, config=Config(orientation="any"))
    assert found.outcome is Outcome.CONVERGED
    assert found.quality.orientation < -0.8
    same = match(source, posed)
    assert same.outcome is Outcome.CONVERGED
    assert same.quality.mirrored == np.inf
    assert match(source, posed, config=Config(orientation="reverse")).outcome is Outcome.MIRROR_IMAGE


@pytest.mark.long
@pytest.mark.parametrize("kind", ["quadruped", "biped"])
def test_a_body_with_two_like_sides_is_its_own_mirror_image(kind):
    source, target = lopsided(1, kind=kind, symmetric=True), lopsided(2, kind=kind, symmetric=True)
    result = match(source, disguised(reflected(target), seed=1).mesh)
    assert result.outcome in (Outcome.CONVERGED, Outcome.SYMMETRY_AMBIGUOUS)


@pytest.mark.long
def test_a_part_of_a_mirror_image():
    """Its holes are closed on the way; the same part of the body itself is found, and nothing is said of mirrors."""
    whole, part = lopsided(1), cut(lopsided(2), 0.3, seed=1).mesh
    assert match(disguised(reflected(part), seed=1).mesh, whole).outcome is Outcome.MIRROR_IMAGE
    assert match(part, whole).outcome is Outcome.PARTIAL
