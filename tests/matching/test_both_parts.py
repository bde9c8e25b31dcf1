"""Two shapes that show overlapping parts of one body."""

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.datasets import creature, ground_truth
from isomatch.lab.damage import cut
from isomatch.lab.sets import relabelled
from isomatch.matching import BothParts
from isomatch.settings import PartSettings

pytestmark = pytest.mark.usefixtures("prepared_once")

FEW = Config(parts=PartSettings(n_common=3))
FIVE = 5


@pytest.fixture(scope="module")
def parts():
    """Parts of two poses of an asymmetric quadruped, and the image of each vertex of the first, −1 where it has none."""
    first, second = (creature(1500, triangulation=i, pose=i) for i in (1, 2))
    target, new = relabelled(second.mesh, 0)
    here, there = cut(first.mesh, 0.4, seed=0), cut(target, 0.4, seed=2)
    image = there.damaged_vertex[new[ground_truth(first, second).vertices][here.original]]
    return here.mesh, there.mesh, image


@pytest.fixture(scope="module")
def found(parts, prepared_once):
    return match(*parts[:2], config=FEW, relation=BothParts())


def error_and_overlap(image, source, target, truth):
    """Mean distance of images from the truth on a prepared target, and intersection over union of what is in common."""
    has, matched = truth >= 0, image >= 0
    both = has & matched
    areas = source.vertex_areas
    error = target.mean_distance(target.body_vertex[image[both]], target.body_vertex[truth[both]])
    return error, areas[both].sum() / areas[has | matched].sum()


def test_what_both_show_is_mapped_and_the_rest_is_not(parts, found):
    source, target, truth = parts
    error, overlap = error_and_overlap(found.map.vertices, source, prepare(target), truth)
    assert error < 0.06
    assert overlap > 0.75
    assert found.outcome is Outcome.PARTIAL
    assert 0.2 < found.map.matched.mean() < 0.8
    assert np.isnan(found.expected_error[~found.map.matched]).all()
    assert any("as parts of one body" in note for note in found.notes)


def test_labels_and_place_do_not_matter(parts, found):
    source, target, _ = parts
    turned, new = relabelled(Mesh(target.vertices[:, [1, 2, 0]] + 3, target.faces), 4)
    again = match(source, turned, config=FEW, relation=BothParts())
    both = found.map.matched & again.map.matched
    assert both.sum() > 0.95 * (found.map.matched | again.map.matched).sum()
    prepared = prepare(turned)
    images = (
        prepared.body_vertex[each] for each in (new[found.map.vertices[both]], again.map.vertices[both])
    )
    assert prepared.mean_distance(*images) < 0.02


def test_the_other_way_round(parts):
    source, target, truth = parts
    back = np.full(target.n_vertices, -1)
    back[truth[truth >= 0]] = np.flatnonzero(truth >= 0)
    shown = np.zeros(target.n_vertices, dtype=bool)
    shown[back >= 0] = True
    found = match(target, source, config=FEW, relation=BothParts())
    known = found.map.matched & shown
    prepared = prepare(source)
    images = (prepared.body_vertex[each[known]] for each in (found.map.vertices, back))
    assert known.sum() > 0.85 * shown.sum()
    assert prepared.mean_distance(*images) < 0.06


def test_landmarks_lead(parts):
    source, target, truth = parts
    rows = np.flatnonzero(truth >= 0)[:: (truth >= 0).sum() // FIVE][:FIVE]
    landmarks = np.column_stack([rows, truth[rows]])
    config = Config(hypotheses="given", parts=FEW.parts)
    found = match(source, target, landmarks=landmarks, config=config, relation=BothParts())
    error, overlap = error_and_overlap(found.map.vertices, source, prepare(target), truth)
    assert error < 0.06
    assert overlap > 0.7
    assert found.origin == "landmarks"
    assert found.quality.landmark_error < 0.1


def test_a_map_that_is_given_is_grown(parts):
    """It is known around a few vertices alone."""
    source, target, truth = parts
    centre = np.flatnonzero(truth >= 0)[50]
    near = np.linalg.norm(source.vertices - source.vertices[centre], axis=1) < 0.5 * np.sqrt(source.area)
    given = np.where(near, truth, -1)
    config = Config(hypotheses="given", parts=FEW.parts)
    found = match(source, target, initial_map=given, config=config, relation=BothParts())
    error, overlap = error_and_overlap(found.map.vertices, source, prepare(target), truth)
    assert found.origin == "initial map"
    assert found.map.matched.sum() > 1.2 * (given >= 0).sum()
    assert error < 0.06
    assert overlap > 0.6


def test_parts_of_two_animals_are_no_sure_match(parts):
    other = cut(creature(1500, kind="biped").mesh, 0.4, seed=0).mesh
    assert match(parts[0], other, config=FEW, relation=BothParts()).outcome is Outcome.LOW_CONFIDENCE
