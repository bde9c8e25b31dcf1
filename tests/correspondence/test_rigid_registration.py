"""As-rigid-as-possible registration: what lies right stays, what bends is followed, and gathered images are spread."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.spatial.transform import Rotation

from isomatch import Mesh, prepare
from isomatch._core.errors import SettingError
from isomatch.correspondence import (
    RigidRegistration,
    SurfaceIndex,
    VertexCells,
    nearest_rotation,
    nearest_with_normals,
    rigid_energy,
)
from isomatch.correspondence.rigid_energy import RigidEnergy
from isomatch.spectral import factorise_for_threads, stiffness_and_masses
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature
from shapes import icosphere

LENGTHS = (0.3, 0.2, 0.1, 0.05)


@pytest.fixture(scope="module")
def whole():
    return prepare(creature(1500).mesh)


@pytest.fixture(scope="module")
def piece(whole):
    """A piece of the whole, and the vertices of the whole that it consists of."""
    made = cut(whole.mesh_body, 0.4, seed=1)
    return made.mesh, made.original


def registered(source, whole, positions, lengths=LENGTHS):
    return RigidRegistration(source)(whole.mesh_body, whole.index, positions, lengths)


def turned(points, seed=0):
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return points @ (rotation * np.sign(np.linalg.det(rotation)))


def assert_near(found, truth):
    """Vertices of the boundary may slide a little, since their normals lack the faces beyond."""
    distances = np.linalg.norm(found - truth, axis=1)  # the edges are 0.03 long
    assert distances.mean() < 3e-4
    assert distances.max() < 5e-3


def test_a_piece_that_lies_right_stays(whole, piece):
    mesh, original = piece
    on_whole = whole.mesh_body.vertices[original]
    assert_near(registered(mesh, whole, on_whole), on_whole)


def test_no_steps_change_nothing(whole, piece):
    start = piece[0].vertices + 0.1
    np.testing.assert_array_equal(registered(piece[0], whole, start, ()), start)


@pytest.mark.parametrize(
    ("length", "most", "message"),
    [
        (0.0, 1.0, "above 0"),
        (-0.1, 1.0, "above 0"),
        (np.nan, 1.0, "above 0"),
        (0.3, 0.9, "most_scaled"),
        (0.3, np.nan, "most_scaled"),
    ],
)
def test_lengths_are_above_0_and_nothing_is_scaled_down(whole, piece, length, most, message):
    register, start = RigidRegistration(piece[0]), piece[0].vertices
    with pytest.raises(SettingError, match=message):
        register(whole.mesh_body, whole.index, start, (0.3, length), most_scaled=most)


def test_a_step_solves_for_the_least_energy_that_the_notes_give(piece):
    """Rotations by scipy, the sum as it is written: any change costs as much as the opposite one, and something."""
    mesh, length = piece[0], 0.2
    start = mesh.vertices * [1.1, 0.9, 1.0]
    stiffness, areas = stiffness_and_masses(mesh)
    links = coo_array(stiffness)
    edges = links.row != links.col
    i, j, weights = links.row[edges], links.col[edges], np.maximum(-links.data[edges], 0)
    before = mesh.vertices[i] - mesh.vertices[j]
    turns = np.empty((mesh.n_vertices, 3, 3))
    for vertex in range(mesh.n_vertices):
        around = i == vertex
        after = start[i[around]] - start[j[around]]
        turns[vertex] = Rotation.align_vectors(after, before[around], weights[around])[0].as_matrix()

    def energy(moved):
        bent = np.einsum("eij,ej->ei", turns[i], before)
        stretched = weights @ ((moved[i] - moved[j] - bent) ** 2).sum(axis=1)
        return areas @ ((moved - start) ** 2).sum(axis=1) + 0.5 * length**2 * stretched

    pulled, _ = RigidEnergy.of_surface(mesh).pulls(mesh.vertices, start, None)
    pull = areas / length**2
    found = factorise_for_threads(stiffness, pull)(pull[:, None] * start + pulled)
    change = 0.01 * np.random.default_rng(0).normal(size=found.shape)
    more, less = energy(found + change) - energy(found), energy(found - change) - energy(found)
    assert more > 0
    assert more == pytest.approx(less, rel=1e-6)


def test_a_source_is_scaled_and_used_again(whole, piece):
    mesh, original = piece
    start = 0.95 * whole.mesh_body.vertices[original]
    small = RigidRegistration(mesh.moved(0.5 * mesh.vertices))
    for _ in range(2):
        found = small(whole.mesh_body, whole.index, start, LENGTHS, scale=2.0)
        np.testing.assert_allclose(found, registered(mesh, whole, start), atol=1e-9)


def test_a_piece_of_another_size_keeps_its_shape_if_it_may_grow(whole, piece):
    """As similar as possible: 1.4 times as large costs nothing, and more than is allowed costs what is beyond."""
    mesh, original = piece
    small, on_whole = mesh.moved(mesh.vertices / 1.4), whole.mesh_body.vertices[original]

    def stretched(most_scaled):
        registration = RigidRegistration(small)
        moved = registration(whole.mesh_body, whole.index, on_whole, (0.3, 0.3), most_scaled=most_scaled)
        edges = (np.linalg.norm(np.diff(at[mesh.edges], axis=1), axis=2) for at in (moved, mesh.vertices))
        return np.divide(*edges).mean()

    rigid, little, similar = (stretched(most) for most in (1.0, 1.2, 2.0))
    assert similar == pytest.approx(1.0, abs=0.01)
    assert rigid < little - 0.05 < similar - 0.1


def test_a_turned_piece_is_put_back(whole, piece):
    """Its own position in space does not matter, only where the map puts it."""
    mesh, original = piece
    on_whole = whole.mesh_body.vertices[original]
    found = registered(mesh.moved(turned(mesh.vertices)), whole, on_whole)
    assert_near(found, on_whole)


def test_gathered_images_are_spread(whole, piece):
    """A map that shrinks a piece towards its middle, as near boundaries: most of the error goes."""
    mesh, original = piece
    truth = whole.mesh_body.vertices[original]
    middle = np.average(truth, axis=0, weights=mesh.vertex_areas)
    shrunk = middle + 0.9 * (truth - middle)
    points = nearest_with_normals(mesh.moved(shrunk), whole.mesh_body, whole.index)
    before = np.linalg.norm(points.interpolated(whole.mesh_body.vertices) - truth, axis=1)
    after = np.linalg.norm(registered(mesh, whole, shrunk) - truth, axis=1)
    assert after.mean() < 0.5 * before.mean()


def test_held_vertices_turn_a_sphere_that_nothing_else_would():
    sphere = icosphere(3)
    every = np.arange(sphere.n_vertices)
    index = SurfaceIndex(sphere.faces, VertexCells.of(every[::8], every // 8))
    off = sphere.vertices @ Rotation.from_euler("xyz", [10, 20, 5], degrees=True).as_matrix()
    held = np.arange(6)

    def distances(held):
        found = RigidRegistration(sphere)(sphere, index, off, [1.0] * 6, held=held)
        return np.linalg.norm(found - sphere.vertices, axis=1)

    free, led = distances(None), distances((held, sphere.vertices[held]))
    assert led[held].max() < 0.5 * free[held].max()
    assert led.mean() < 0.5 * free.mean()
    np.testing.assert_array_equal(distances((held[:0], off[:0])), free)


def test_the_result_does_not_depend_on_the_number_of_threads(whole, piece, monkeypatch):
    mesh, original = piece
    start = 0.95 * whole.mesh_body.vertices[original]
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "1")
    one = registered(mesh, whole, start)
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "3")
    np.testing.assert_array_equal(registered(mesh, whole, start), one)


def test_normals_tell_sheets_apart():
    """A point between two parallel sheets that face away from each other belongs to the one with its normal."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    sheets = Mesh(np.vstack([square, square - [0, 0, 0.1]]), np.vstack([faces, faces[:, ::-1] + 4]))
    index = SurfaceIndex(sheets.faces, VertexCells.of(np.array([0, 4]), np.repeat([0, 1], 4)))
    upward = Mesh(0.5 * square + [0.25, 0.25, -0.06], faces)
    assert (nearest_with_normals(upward, sheets, index).corners < 4).all()
    assert (nearest_with_normals(upward, sheets, index, unit=0.0).corners >= 4).all()


def test_rotations_are_turned_until_the_trace_is_largest():
    """From a start that is off by some degrees, also where a covariance is of rank 2, as on a plane."""
    before, after = np.random.default_rng(0).normal(size=(2, 200, 3, 3))
    after = before @ Rotation.random(200, rng=1).as_matrix().transpose(0, 2, 1) + 0.1 * after
    before[::2, 2] = 0
    covariances = before.transpose(0, 2, 1) @ after
    wanted = nearest_rotation(covariances).transpose(0, 2, 1)
    start = (
        Rotation.from_rotvec(np.random.default_rng(2).normal(scale=0.1, size=(200, 3))).as_matrix() @ wanted
    )
    found = rigid_energy.improve_rotations(start, covariances)
    traces, largest = (np.einsum("nij,nji->n", turn, covariances) for turn in (found, wanted))
    np.testing.assert_allclose(traces, largest, rtol=1e-3)
    np.testing.assert_allclose(found @ found.transpose(0, 2, 1), np.tile(np.eye(3), (200, 1, 1)), atol=1e-12)


def test_conjugate_gradients_solve_the_system_of_the_edges():
    mesh = icosphere(2)
    energy = rigid_energy.RigidEnergy.of_edges(mesh)
    rng = np.random.default_rng(0)
    diagonal, right = rng.uniform(0.5, 2.0, mesh.n_vertices), rng.normal(size=(mesh.n_vertices, 3))
    found = np.zeros_like(right)
    for _ in range(4):  # each time the residual is a hundredth
        found = energy.solve(diagonal, right, found)
    wanted = np.linalg.solve(energy.stiffness.toarray() + np.diag(diagonal), right)
    np.testing.assert_allclose(found, wanted, atol=1e-6)
