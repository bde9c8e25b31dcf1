"""Shapes that are far from isometric: limbs of other lengths."""

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.correspondence import Embedding
from isomatch.datasets import creature, ground_truth, relabelled
from isomatch.matching import Hints, prepare_pair
from isomatch.matching.config import ElasticSettings
from isomatch.matching.elastic import far_from_isometric
from isomatch.matching.elastic.elastic_fit import ElasticFit, Step
from isomatch.matching.elastic.elastic_shape import ElasticShape
from isomatch.matching.elastic.elastic_starts import anchor_starts
from shapes import icosphere

NONE = np.zeros((0, 2), dtype=np.int64)


def another_species(mesh, rest):
    """Longer hind legs and tail, a shorter neck: each point moves by how far it lies behind, below and in front."""
    behind = np.maximum(-0.4 - rest[:, 1], 0)
    below = np.maximum(0.45 - rest[:, 2], 0)
    front = np.maximum(rest[:, 1] - 0.4, 0)
    offset = np.column_stack([0 * behind, -1.5 * behind + -0.6 * front, -0.9 * below * (rest[:, 1] < 0)])
    return Mesh(mesh.vertices + offset, mesh.faces)


@pytest.fixture(scope="module")
def species():
    """Two shapes, prepared, and the true image of every vertex of the first."""
    first, second = (creature(2500, triangulation=i, pose=0, symmetric=True) for i in (1, 2))
    target, new = relabelled(another_species(second.mesh, second.rest), 0)
    return prepare(first.mesh), prepare(target), new[ground_truth(first, second).vertices]


@pytest.fixture(scope="module")
def found(species):
    return match(*species[:2])


def mean_error(species, found):
    target = species[1]
    return target.mean_distance(target.body_vertex[found.map.vertices], target.body_vertex[species[2]])


def test_limbs_may_stretch(species, found):
    assert any("far from isometric" in note for note in found.notes)
    assert found.origin == "anchors"
    assert mean_error(species, found) < 0.08


def test_a_map_of_other_species_is_never_sure(found):
    assert found.outcome is Outcome.LOW_CONFIDENCE
