"""Organs: topology, symmetry, distortion and truth."""

import numpy as np
import pytest

from isomatch import Mesh
from isomatch._core.errors import SettingError
from isomatch.datasets import closest_points
from isomatch_lab.procedural.organs import PLANS, SIGNS, organ, organ_truth
from isomatch_lab.sets import benchmark_set

EULER = {"face": 1, "cortex": 1, "tube": 0}


def rest_mesh(made):
    return Mesh(made.rest, made.mesh.faces)


def gaps(points, mesh):
    return np.linalg.norm(closest_points(points, mesh).points(mesh) - points, axis=1)


def edge_lengths(mesh):
    return np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)


@pytest.mark.long
@pytest.mark.parametrize("kind", PLANS)
def test_organs_are_connected_oriented_and_nearly_isometric_to_their_rest(kind):
    made = organ(kind, 1500, pose=1)
    mesh, lengths = made.mesh, edge_lengths(rest_mesh(made))
    half = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(half, axis=0)) == len(half), "no edge has two faces that run along it alike"
    assert mesh.components.max() == 0
    assert mesh.n_vertices - len(mesh.edges) + mesh.n_faces == EULER.get(kind, 2)
    low, high = np.quantile(edge_lengths(mesh) / lengths, [0.05, 0.95])
    assert 0.8 < low < high < 1.3


@pytest.mark.long
@pytest.mark.parametrize("symmetry", ["mirror", "turn"])
@pytest.mark.parametrize("kind", ["kidney", "face"])
def test_symmetric_organs_go_onto_themselves_at_rest_and_bent(kind, symmetry):
    made = organ(kind, 1500, symmetry=symmetry, pose=3)
    spacing = edge_lengths(rest_mesh(made)).mean()
    for vertices in (made.rest, made.mesh.vertices):
        assert gaps(vertices * SIGNS[symmetry], Mesh(vertices, made.mesh.faces)).mean() < 0.1 * spacing
    plain = organ(kind, 1500, pose=3)
    assert gaps(plain.rest * SIGNS[symmetry], rest_mesh(plain)).mean() > 0.2 * spacing


def test_the_truth_is_the_same_point_at_rest():
    one, other = (organ("liver", 1500, pose=pose) for pose in (1, 2))
    points = organ_truth(one, other).points(rest_mesh(other))
    assert np.linalg.norm(points - one.rest, axis=1).max() < 0.2 * edge_lengths(rest_mesh(one)).mean()
    np.testing.assert_array_equal(organ_truth(one, one).vertices, np.arange(len(one.rest)))


def test_half_a_turn_twice_is_the_identity():
    made = organ("kidney", 1500, symmetry="turn", pose=1)
    there = organ_truth(made, made, symmetric=True).points(made.mesh)
    back = organ_truth(made, made, symmetric=True).points(Mesh(there, made.mesh.faces))
    away = np.linalg.norm(back - made.mesh.vertices, axis=1)
    assert away.mean() < edge_lengths(made.mesh).mean()


@pytest.mark.long
def test_the_set_has_asymmetric_and_symmetric_pairs():
    organs = benchmark_set("organs")
    names = [source for source, _ in organs.pairs]
    assert len(names) == len(set(names)) == 40
    assert sum("none" in name for name in names) == 24
    pair = organs.load("kidney_turn_4_9", "kidney_turn_4_10")
    assert pair.truth.shape == pair.mirrored.shape == (pair.source.n_vertices, 2)
    assert pair.truth.max(axis=0).tolist() <= [pair.source.n_vertices - 1, pair.target.n_vertices - 1]
    assert organs.load(*organs.pairs[0]).mirrored is None


def test_an_unknown_organ_is_refused_by_name():
    with pytest.raises(SettingError, match="unknown"):
        organ("spleen")
