"""The recipe "Add a start" of CONTRIBUTING.md, followed with principal axes of inertia."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from isomatch import Outcome, SettingError, match
from isomatch.matching import default_starts
from shapes import disguised

pytestmark = pytest.mark.usefixtures("prepared_once")


def inertia(pair):
    """Map to the nearest points in space once principal axes agree, which they do in four ways."""
    source, target = (in_axes(shape.body.vertices) for shape in (pair.source, pair.target))
    nearest = cKDTree(target)
    for turn in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]):
        image = nearest.query(source[pair.source_vertices] * turn)[1]
        yield np.column_stack([pair.source_vertices, image])


def in_axes(points):
    """Positions in the principal axes, which are right-handed."""
    points = points - points.mean(axis=0)
    axes = np.linalg.eigh(points.T @ points)[1]
    axes[:, 0] *= np.linalg.det(axes)
    return points @ axes


@pytest.fixture
def animals(example):
    """A shape, the same one moved and relabelled, and the true images."""
    mesh = example[0].mesh
    other = disguised(mesh, seed=1)
    return mesh, other.mesh, other.new_vertex


def mean_error(found, mesh, truth):
    off = mesh.vertices[found.map.vertices] - mesh.vertices[truth]
    return np.linalg.norm(off, axis=1).mean() / np.sqrt(mesh.area)


@pytest.mark.long
def test_alone_it_leads_to_the_right_map(animals):
    source, target, truth = animals
    found = match(source, target, starts=[inertia])
    assert found.origin in ("inertia", "symmetry")
    assert mean_error(found, target, truth) < 0.02


@pytest.mark.long
def test_with_those_of_isomatch_it_contends(animals):
    source, target, truth = animals
    found = match(source, target, starts=[inertia, *default_starts])
    assert found.outcome is Outcome.CONVERGED
    assert "stages handed in: starts = inertia, extremities, poses, anchors" in found.notes
    assert mean_error(found, target, truth) < 0.02


@pytest.mark.long
@pytest.mark.parametrize(
    ("start", "message"),
    [
        (lambda pair: None, "gave None; expected a list of first maps, which may be empty"),
        (lambda pair: np.zeros((4, 2), dtype=int), r"gave one array of shape \(4, 2\); expected a list"),
        (lambda pair: [[[0, 0], [1, 1]]], r"shape \(2, 2\) .*at least three rows"),
        (lambda pair: [np.full((4, 2), 10**6)], r"of bodies of \d+ and \d+ vertices"),
        (lambda pair: [], r"gave no first map, and there are no priors; add \*default_starts"),
    ],
)
def test_what_is_no_first_map_is_refused(animals, start, message):
    with pytest.raises(SettingError, match=message):
        match(*animals[:2], starts=[start])


def test_one_start_is_not_a_list_of_starts(animals):
    with pytest.raises(SettingError, match="inertia"):
        match(*animals[:2], starts=inertia)
