"""A scan that seems to be inside out is matched with both windings, and the one that fits is told."""

import numpy as np
import pytest

from isomatch import Outcome, match, prepare
from isomatch.datasets import example_pair
from isomatch.decimation import decimate
from isomatch.matching import match_both
from isomatch.shapes import turned_over
from shapes import icosphere, inside_out, upper_share
from zoo.made import moved, together

NOTE = "seems to be inside out; of both windings of its faces, the map verifies better with them"


@pytest.fixture(scope="module")
def whole():
    return prepare(decimate(example_pair()[1].mesh, 900).mesh)


@pytest.fixture(scope="module")
def part():
    return upper_share(decimate(example_pair()[0].mesh, 900).mesh)


@pytest.fixture(scope="module")
def sound(part, whole):
    """The map of the part to the whole."""
    return match(part, whole)


def require_turned_over(found, expected):
    assert any(f"{NOTE} turned over" in note for note in found.notes)
    assert not any(NOTE in note for note in expected.notes)
    assert found.outcome is expected.outcome is Outcome.PARTIAL
    assert np.array_equal(found.map.vertices, expected.map.vertices)


@pytest.mark.long
def test_the_map_of_a_part_is_that_of_the_part_turned_over(part, whole, sound):
    reversed_part = prepare(inside_out(part))
    assert reversed_part.seems_inside_out
    assert not prepare(part).seems_inside_out
    found = match(reversed_part, whole)
    require_turned_over(found, sound)
    np.testing.assert_allclose(found.map.barycentric, sound.map.barycentric, atol=1e-6)


@pytest.mark.long
def test_also_both_ways(part, whole):
    for found, expected in zip(match_both(inside_out(part), whole), match_both(part, whole)):
        require_turned_over(found, expected)


@pytest.mark.long
def test_what_only_seems_so_stays_as_it_is(part, whole, sound):
    doubted = prepare(part)
    vars(doubted)["seems_inside_out"] = True
    found = match(doubted, whole)
    assert any(f"{NOTE} as they are" in note for note in found.notes)
    assert np.array_equal(found.map.vertices, sound.map.vertices)


@pytest.mark.long
def test_two_that_seem_so_agree_with_each_other(part):
    reversed_part = prepare(inside_out(part))
    assert not any(NOTE in note for note in match(reversed_part, reversed_part).notes)


def test_turned_over_twice_is_the_same(part):
    shape = prepare(part)
    turned = turned_over(turned_over(shape))
    assert np.array_equal(turned.mesh_body.faces, shape.mesh_body.faces)
    normals = (prepared.mesh_body.vertex_normals for prepared in (turned_over(shape), shape))
    np.testing.assert_allclose(next(normals), -next(normals), atol=1e-12)


@pytest.mark.long
def test_a_further_component_does_not_make_the_body_a_stranger(part, whole):
    far = moved(icosphere(3), 3 * part.vertices.max(axis=0), 0.1 * np.ptp(part.vertices))
    found = match(together(inside_out(part), far), together(whole.surface, far))
    assert any(f"{NOTE} turned over" in note for note in found.notes)
    assert not any("has no partner" in note for note in found.notes)
