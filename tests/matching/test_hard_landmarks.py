"""Landmarks that are held: exact, within a tolerance, and with a map that follows smoothly."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Graph, Mesh, Outcome, PointCloud, SettingError, match, prepare
from isomatch.datasets import ground_truth
from isomatch_lab.damage import holes
from isomatch_lab.procedural import creature
from isomatch_lab.procedural.organs import organ, organ_truth
from shapes import icosphere
from zoo.made import moved, together

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def hearts():
    """Two bent hearts, whose map slides, with true landmarks far from each other."""
    source, target = (organ("heart", 1500, pose=pose) for pose in (1, 2))
    truth = organ_truth(source, target).vertices
    rows = prepare(source.mesh).column_vertices[:5]
    return source.mesh, target.mesh, truth, np.column_stack([rows, truth[rows]])


def stretch_around(source, target, found, rows):
    """Largest length of the image of an edge at some vertices over its own; lengths in √area."""
    edges = source.edges[np.isin(source.edges, rows).any(axis=1)]
    images = found @ target.vertices / np.sqrt(target.area)
    points = source.vertices / np.sqrt(source.area)
    mapped, lengths = (np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) for x in (images, points))
    return (mapped / lengths).max()


def held(shapes, pairs, **settings):
    """Match with landmarks that are held; they are exact."""
    found = match(*shapes, landmarks=pairs, config=Config(pin=0, **settings))
    assert (found.map.vertices[pairs[:, 0]] == pairs[:, 1]).all()
    return found


@pytest.mark.long
def test_held_landmarks_are_exact_and_the_map_follows(hearts):
    source, target, truth, pairs = hearts
    led = match(source, target, landmarks=pairs)
    bent, rows = held((source, target), pairs), pairs[:, 0]
    np.testing.assert_allclose((bent.map @ target.vertices)[rows], target.vertices[pairs[:, 1]])
    assert bent.quality.landmark_error == 0 < led.quality.landmark_error

    def error(found):
        return np.linalg.norm(found @ target.vertices - target.vertices[truth], axis=1).mean()

    overwritten = led.map.vertices.copy()
    overwritten[rows] = pairs[:, 1]
    overwritten = type(led.map)(overwritten, target.n_vertices)
    assert error(bent.map) < 0.95 * error(led.map), "what is near a landmark gains too"
    assert (
        stretch_around(source, target, bent.map, rows) < 2 < stretch_around(source, target, overwritten, rows)
    )


@pytest.mark.long
def test_far_from_the_landmarks_nothing_changes(bodies):
    source, target, truth = bodies
    rows = np.linalg.norm(source.vertices - source.vertices[0], axis=1).argsort()[:400:100]
    pairs = np.column_stack([rows, truth[rows]])
    led = match(source, target, landmarks=pairs).map
    changed = (led.barycentric != held((source, target), pairs).map.barycentric).any(axis=1)
    assert changed[rows].any()
    distance = np.linalg.norm(source.vertices[changed] - source.vertices[0], axis=1)
    assert distance.max() < 0.7 * np.sqrt(source.area)
    assert changed.mean() < 0.5


@pytest.mark.long
def test_within_the_tolerance_nothing_moves(hearts):
    source, target, _, pairs = hearts
    led = match(source, target, landmarks=pairs)
    off = np.linalg.norm((led.map @ target.vertices)[pairs[:, 0]] - target.vertices[pairs[:, 1]], axis=1)
    off /= np.sqrt(target.area)
    loose = match(source, target, landmarks=pairs, config=Config(pin=float(off.max() + 1e-6)))
    np.testing.assert_array_equal(loose.map.barycentric, led.map.barycentric)
    tolerance = float(np.sort(off)[2:4].mean())
    bent = match(source, target, landmarks=pairs, config=Config(pin=tolerance))
    images = (bent.map @ target.vertices)[pairs[:, 0]]
    now = np.linalg.norm(images - target.vertices[pairs[:, 1]], axis=1) / np.sqrt(target.area)
    assert (now[off > tolerance] < 1e-12).all()
    assert (now < tolerance).all()
    assert any("5 landmarks are held, 2 of them by bending" in note for note in bent.notes)


@pytest.mark.long
@pytest.mark.parametrize("tolerance", [0.0, 0.03])
def test_landmarks_side_by_side_move_the_map_no_farther_than_they_are_off(hearts, tolerance):
    source, target, truth, _ = hearts
    rows = np.linalg.norm(source.vertices - source.vertices[100], axis=1).argsort()[:60:6]
    rows = rows[np.unique(truth[rows], return_index=True)[1]]
    pairs = np.column_stack([rows, np.roll(truth[rows], 1)])
    found = [
        match(source, target, landmarks=pairs, config=Config(pin=pin)).map @ target.vertices
        for pin in (None, tolerance)
    ]
    off, left = (np.linalg.norm(one[rows] - target.vertices[pairs[:, 1]], axis=1) for one in found)
    moved = np.linalg.norm(found[1] - found[0], axis=1)
    assert moved.max() < 1.2 * off.max()
    assert left.max() / np.sqrt(target.area) <= tolerance + 1e-9


@pytest.fixture(scope="module")
def larger():
    return tuple(creature(3500, pose=i, triangulation=i) for i in (3, 4))


@pytest.mark.long
@pytest.mark.parametrize("resolution", ["full", "fast"])
def test_landmarks_are_held_at_every_resolution(larger, resolution):
    source, target = larger
    rows = np.arange(100, 3300, 640)
    pairs = np.column_stack([rows, ground_truth(source, target).vertices[rows]])
    found = held((source.mesh, target.mesh), pairs, resolution=resolution)
    assert found.outcome is Outcome.CONVERGED
    assert stretch_around(source.mesh, target.mesh, found.map, rows) < 3
    assert found.timings["hard landmarks"] > 0


@pytest.mark.long
@pytest.mark.parametrize("part", ["source", "target"])
def test_landmarks_of_parts_are_held(bodies, part):
    source, target, truth = bodies
    damaged = holes(source if part == "source" else target, 0.15, seed=4)
    if part == "source":
        shapes, known = (damaged.mesh, target), truth[damaged.original]
    else:
        shapes, known = (source, damaged.mesh), damaged.damaged_vertex[truth]
    rows = np.flatnonzero(known >= 0)[100::500]
    rows = rows[np.unique(known[rows], return_index=True)[1]]
    pairs = np.column_stack([rows, known[rows]])
    assert held(shapes, pairs).outcome is Outcome.PARTIAL


@pytest.mark.long
def test_landmarks_of_components_are_held(bodies):
    source, target, truth = bodies
    ball = moved(icosphere(2), [0, 0, 2], 0.1)
    rows = np.arange(50, 1400, 300)
    one = [source.n_vertices + 5, target.n_vertices + 5]
    crossed = [source.n_vertices + 7, truth[7]]
    pairs = np.vstack([np.column_stack([rows, truth[rows]]), one, crossed])
    found = held((together(source, ball), together(target, ball)), pairs)
    assert any(f"source vertices {crossed[0]} lie on nothing" in note for note in found.notes)


@pytest.mark.long
def test_a_landmark_that_holds_alone_is_matched(bodies):
    source, target, truth = bodies
    alone = source.n_vertices
    with_triangle = together(source, Mesh(source.vertices[:3] + np.array([0, 0, 5]), [[0, 1, 2]]))
    rows = np.arange(50, 1400, 300)
    free = np.setdiff1d(np.arange(target.n_vertices), truth[rows])[0]
    pairs = np.vstack([np.column_stack([rows, truth[rows]]), [alone, free]])
    found = held((with_triangle, target), pairs)
    assert found.quality.matched == found.map.matched.mean()


def points_of(mesh):
    return PointCloud(mesh.vertices)


def edges_of(mesh):
    return Graph(mesh.n_vertices, mesh.edges, mesh.edge_lengths)


@pytest.mark.long
@pytest.mark.parametrize("made", [points_of, edges_of])
def test_landmarks_of_points_and_graphs_are_held(bodies, made):
    source, target, truth = bodies
    rows = np.arange(50, 1400, 300)
    held((made(source), made(target)), np.column_stack([rows, truth[rows]]))


@pytest.mark.long
def test_landmarks_that_contradict_the_map_are_named(bodies):
    source, target, truth = bodies
    rows = prepare(source).column_vertices[:6]
    pairs = np.column_stack([rows, truth[rows]])
    pairs[:2, 1] = pairs[[1, 0], 1]
    bent, led = held((source, target), pairs), match(source, target, landmarks=pairs)
    assert (led.outcome, bent.outcome) == (Outcome.PRIORS_CONTRADICTED, Outcome.LOW_CONFIDENCE)
    assert bent.quality.landmark_error == 0
    (note,) = [note for note in bent.notes if "before it was bent contradicts" in note]
    assert all(f"{i} → {j}" in note for i, j in pairs[:2])


@pytest.mark.long
def test_bad_pins(bodies):
    with pytest.raises(SettingError, match="pin = 0"):
        match(*bodies[:2], config=Config(pin=0))
    with pytest.raises(SettingError, match="pin = -1"):
        replace(Config(), pin=-1)
