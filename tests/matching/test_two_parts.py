"""Two shapes that show overlapping parts of one body."""

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.datasets import ground_truth
from isomatch.matching import TwoParts
from isomatch.settings import PartSettings
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature
from isomatch_lab.sets import relabelled

pytestmark = pytest.mark.usefixtures("prepared_once")

FEW = Config(parts=PartSettings(n_common=2))
GIVEN = Config(hypotheses="given", parts=FEW.parts)


@pytest.fixture(scope="module")
def parts():
    """Parts of two poses of an asymmetric quadruped, and the image of each vertex of the first, −1 where it has none."""
    first, second = (creature(1500, triangulation=i, pose=i) for i in (1, 2))
    target, new = relabelled(second.mesh, 0)
    one, other = cut(first.mesh, 0.4, seed=0), cut(target, 0.4, seed=2)
    image = other.damaged_vertex[new[ground_truth(first, second).vertices][one.original]]
    return one.mesh, other.mesh, image


@pytest.fixture(scope="module")
def found(parts, prepared_once):
    return match(*parts[:2], config=FEW, relation=TwoParts)


def error_and_overlap(image, parts):
    """Mean error of the images, in √area of the target, and intersection over union of what is in common."""
    source, target, truth = parts[0], prepare(parts[1]), parts[2]
    has, matched = truth >= 0, image >= 0
    both = has & matched
    areas = source.vertex_areas
    error = target.mean_distance(target.body_vertex[image[both]], target.body_vertex[truth[both]])
    return error, areas[both].sum() / areas[has | matched].sum()


@pytest.mark.long
def test_what_both_show_is_mapped_and_the_rest_is_not(parts, found):
    error, overlap = error_and_overlap(found.map.vertices, parts)
    assert error < 0.06
    assert overlap > 0.75
    assert found.outcome is Outcome.PARTIAL
    assert 0.3 < found.map.matched.mean() < 0.8
    assert np.isnan(found.expected_error[~found.map.matched]).all()
    assert any("as parts of one body" in note for note in found.notes)


@pytest.mark.long
def test_overlap_is_the_share_of_both_in_common(parts, found):
    source, target, truth = parts
    common = source.vertex_areas[truth >= 0].sum()
    assert found.overlap == pytest.approx((common / source.area, common / target.area), abs=0.15)
    assert found.overlap[0] == pytest.approx(found.map.matched.mean())


@pytest.mark.long
def test_the_other_way_round(parts):
    source, target, truth = parts
    back = np.full(target.n_vertices, -1)
    back[truth[truth >= 0]] = np.flatnonzero(truth >= 0)
    backward = match(target, source, config=FEW, relation=TwoParts).map
    known = backward.matched & (back >= 0)
    shape = prepare(source)
    assert known.sum() > 0.85 * (back >= 0).sum()
    assert (
        shape.mean_distance(shape.body_vertex[backward.vertices[known]], shape.body_vertex[back[known]])
        < 0.06
    )


@pytest.fixture(scope="module")
def landmarks(parts):
    shown = np.flatnonzero(parts[2] >= 0)
    rows = shown[:: len(shown) // 5][:5]
    return np.column_stack([rows, parts[2][rows]])


@pytest.fixture(scope="module")
def led(parts, landmarks, prepared_once):
    return match(*parts[:2], landmarks=landmarks, config=GIVEN, relation=TwoParts)


@pytest.mark.long
def test_landmarks_lead(parts, led):
    error, overlap = error_and_overlap(led.map.vertices, parts)
    assert error < 0.06
    assert overlap > 0.7
    assert led.origin == "landmarks"
    assert led.outcome is Outcome.PARTIAL
    assert led.quality.landmark_error < 0.1


@pytest.mark.long
def test_labels_and_place_do_not_matter(parts, landmarks, led):
    turned, new = relabelled(Mesh(parts[1].vertices[:, [1, 2, 0]] + 3, parts[1].faces), 4)
    pairs = np.column_stack([landmarks[:, 0], new[landmarks[:, 1]]])
    again = match(parts[0], turned, landmarks=pairs, config=GIVEN, relation=TwoParts)
    either, both = led.map.matched | again.map.matched, led.map.matched & again.map.matched
    assert both.sum() > 0.95 * either.sum()
    shape = prepare(turned)
    images = (shape.body_vertex[image] for image in (new[led.map.vertices[both]], again.map.vertices[both]))
    assert shape.mean_distance(*images) < 0.02


@pytest.mark.long
def test_a_map_that_is_given_around_some_vertex_is_grown(parts):
    source, _, truth = parts
    centre = np.flatnonzero(truth >= 0)[50]
    near = np.linalg.norm(source.vertices - source.vertices[centre], axis=1) < 0.5 * np.sqrt(source.area)
    given = np.where(near, truth, -1)
    found = match(*parts[:2], initial_map=given, config=GIVEN, relation=TwoParts)
    error, overlap = error_and_overlap(found.map.vertices, parts)
    assert found.origin == "initial map"
    assert found.map.matched.sum() > 1.2 * (given >= 0).sum()
    assert error < 0.06
    assert overlap > 0.6


@pytest.mark.long
def test_parts_of_two_animals_are_no_sure_match(parts):
    other = cut(creature(1500, kind="biped").mesh, 0.4, seed=0).mesh
    found, target = match(parts[0], other, config=FEW, relation=TwoParts), prepare(other)
    assert found.outcome is Outcome.LOW_CONFIDENCE
    assert found.alternatives
    for one in found.alternatives:  # which differ where both have images
        assert one.map.shape == found.map.shape
        both = found.map.matched & one.map.matched
        images = (target.body_vertex[map_.vertices[both]] for map_ in (found.map, one.map))
        assert not both.any() or target.mean_distance(*images) > 0.1
