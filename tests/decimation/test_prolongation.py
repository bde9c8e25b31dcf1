"""Laws of carrying points between a mesh and its decimation."""

from __future__ import annotations

import numpy as np
import pytest

from data import tosca
from isomatch import Mesh, MeshError, PrecisePoints
from isomatch.decimation import Prolongation, decimate
from shapes import cylinder, flat_grid, icosphere, inside_out, planar_delaunay
from zoo import torus
from zoo.made import moved, together


def positions(points: PrecisePoints, vertices: np.ndarray) -> np.ndarray:
    return points.interpolation(len(vertices)) @ vertices


def to_fine(transfer: Prolongation, points: PrecisePoints) -> PrecisePoints:
    """Carry points of the coarse mesh to the fine one."""
    return transfer.near_fine(points.interpolated(transfer.coarse.mesh.vertices), points.corners)


def random_points(mesh: Mesh, n: int = 2000, seed: int = 0) -> PrecisePoints:
    random = np.random.default_rng(seed)
    return PrecisePoints(mesh.faces[random.integers(mesh.n_faces, size=n)], random.dirichlet(np.ones(3), n))


def folded_sheet(gap: float) -> Mesh:
    """Two flat sheets, one above the other, a unit long, joined by half a cylinder along one side."""
    sheet = flat_grid(40, 201)
    bend = np.pi * gap / 2
    y, s = sheet.vertices[:, 1] / 40, sheet.vertices[:, 0] / 200 * (2 + bend) - 1 - bend / 2
    turn = np.clip(s / gap * 2, -np.pi / 2, np.pi / 2)
    beyond = np.maximum(np.abs(s) - bend / 2, 0)
    points = np.column_stack([gap / 2 * np.cos(turn) - beyond, y, gap / 2 * np.sin(turn)])
    return Mesh(points, sheet.faces)


SURFACES = {
    "sphere": icosphere(4),
    "cylinder": cylinder(60, 40),
    "flat": planar_delaunay(2000),
    "folded": folded_sheet(0.1),
}


@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES)
def test_without_decimation_every_point_stays(mesh):
    transfer = Prolongation(mesh, decimate(mesh, mesh.n_vertices))
    places = transfer.on_coarse
    assert np.array_equal(places.corners[:, 0], np.arange(mesh.n_vertices))
    assert places.barycentric[:, 0] == pytest.approx(1)
    points = random_points(mesh)
    error = np.linalg.norm(
        positions(to_fine(transfer, points), mesh.vertices) - positions(points, mesh.vertices), axis=1
    )
    assert (error < 1e-9).mean() > 0.998  # in a sliver, the nearest vertex may be none of the face
    assert error.max() < mesh.edge_lengths.max()


@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES)
def test_there_and_back_is_the_same_vertex(mesh):
    transfer = Prolongation(mesh, decimate(mesh, mesh.n_vertices // 8))
    back = to_fine(transfer, transfer.on_coarse)
    is_corner = back.corners == np.arange(mesh.n_vertices)[:, None]
    distance = np.linalg.norm(positions(back, mesh.vertices) - mesh.vertices, axis=1)
    assert is_corner.any(axis=1).mean() > 0.97
    assert distance.max() < 2 * mesh.edge_lengths.max()
    assert np.median(distance) < 1e-6 * mesh.edge_lengths.mean()


@pytest.mark.long
@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES)
def test_places_are_near_and_weights_are_barycentric(mesh):
    coarse = decimate(mesh, mesh.n_vertices // 8)
    transfer = Prolongation(mesh, coarse)
    step = np.sqrt(mesh.area / coarse.mesh.n_vertices)
    faces = {tuple(face) for face in np.sort(coarse.mesh.faces, axis=1).tolist()}
    assert {tuple(face) for face in np.sort(transfer.on_coarse.corners, axis=1).tolist()} <= faces
    points = random_points(coarse.mesh)
    raised = to_fine(transfer, points)
    for found, surface, near in (
        (transfer.on_coarse, coarse.mesh, mesh.vertices),
        (raised, mesh, positions(points, coarse.mesh.vertices)),
    ):
        assert found.barycentric.min() >= 0
        assert found.barycentric.sum(axis=1) == pytest.approx(1)
        assert np.linalg.norm(positions(found, surface.vertices) - near, axis=1).max() < 0.5 * step
    assert (transfer.on_coarse.barycentric.argmax(axis=1) == 0).all()


@pytest.mark.parametrize("n", [600, 2000])
def test_folded_sheets_exchange_no_points(n):
    """Two sheets joined at one side, a tenth of a coarse edge apart."""
    gap = 0.1 * np.sqrt(2 / n)
    mesh = folded_sheet(gap)
    coarse = decimate(mesh, n)
    along = mesh.vertices[:, 0] * np.where(np.arange(mesh.n_vertices) % 201 < 100, -1, 1)
    along_coarse = np.bincount(coarse.owner, along) / np.bincount(coarse.owner)
    transfer = Prolongation(mesh, coarse)
    step = np.sqrt(2 / n)
    assert np.abs(positions(transfer.on_coarse, along_coarse) - along).max() < 2 * step
    points = random_points(coarse.mesh)
    change = positions(to_fine(transfer, points), along) - positions(points, along_coarse)
    assert np.abs(change).max() < 2 * step


def test_parallel_sheets_exchange_no_points():
    sheet = flat_grid(40, 40)
    mesh = together(sheet, moved(inside_out(sheet), (0, 0, 0.3)))
    coarse = decimate(mesh, 300)
    transfer = Prolongation(mesh, coarse)
    sheet_of = np.arange(3200) >= 1600
    sheet_of_coarse = np.zeros(coarse.mesh.n_vertices, dtype=bool)
    sheet_of_coarse[coarse.owner] = sheet_of
    assert (sheet_of_coarse[transfer.on_coarse.corners] == sheet_of[:, None]).all()
    points = random_points(coarse.mesh)
    assert (sheet_of[to_fine(transfer, points).corners] == sheet_of_coarse[points.corners]).all()


@pytest.mark.parametrize("n", [300, 1000])
def test_the_two_sides_of_a_thin_wall_exchange_no_points(n):
    """A round wall, closed along its rims; the coarse mesh is as far from its side as the other side is."""
    mesh = moved(torus(120, 60, 1.0, 0.005), scale=[1, 1, 80])
    coarse = decimate(mesh, n)
    x, y, z = np.swapaxes(coarse.mesh.vertices[Prolongation(mesh, coarse).on_coarse.corners], 0, 1)
    facing = np.einsum("ij,ij->i", np.cross(y - x, z - x), mesh.vertex_normals)
    assert (facing > 0).all()


def test_places_agree_with_all_faces():
    """On a sphere, where no other sheet is near: against a search over every face."""
    mesh = icosphere(4)
    coarse = decimate(mesh, 200)
    places = Prolongation(mesh, coarse).on_coarse
    dense = np.array([[i, j, 20 - i - j] for i in range(21) for j in range(21 - i)]) / 20
    samples = np.einsum("sc,fcx->fsx", dense, coarse.mesh.vertices[coarse.mesh.faces]).reshape(-1, 3)
    for i in range(0, mesh.n_vertices, 40):
        nearest = np.linalg.norm(samples - mesh.vertices[i], axis=1).min()
        found = np.linalg.norm(positions(places, coarse.mesh.vertices)[i] - mesh.vertices[i])
        assert found <= nearest + 1e-12


def test_units_and_threads_do_not_matter(monkeypatch):
    mesh = icosphere(5)
    coarse = decimate(mesh, 800)
    transfer = Prolongation(mesh, coarse)
    points = random_points(coarse.mesh, 20_000)
    expected = transfer.on_coarse, to_fine(transfer, points)
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "3")
    large = Mesh(mesh.vertices * 2.0**400, mesh.faces)
    scaled = Prolongation(large, decimate(large, 800))
    for found, same in zip((scaled.on_coarse, to_fine(scaled, points)), expected):
        assert np.array_equal(found.corners, same.corners)
        assert np.array_equal(found.barycentric, same.barycentric)


def test_a_vertex_without_faces_stays_itself():
    sphere = icosphere(3)
    mesh = Mesh(np.concatenate([sphere.vertices, [[5.0, 0, 0]]]), sphere.faces)
    transfer = Prolongation(mesh, decimate(mesh, 100))
    last = transfer.coarse.owner[-1]
    assert transfer.on_coarse.corners[-1].tolist() == [last] * 3
    assert to_fine(transfer, PrecisePoints.at_vertices(np.array([last]))).corners.tolist() == [[642] * 3]


def test_an_animal_there_and_back():
    mesh = tosca("cat0")
    transfer = Prolongation(mesh, decimate(mesh, 5000))
    back = to_fine(transfer, transfer.on_coarse)
    distance = np.linalg.norm(positions(back, mesh.vertices) - mesh.vertices, axis=1)
    assert (back.corners == np.arange(mesh.n_vertices)[:, None]).any(axis=1).mean() > 0.97
    assert np.quantile(distance, 0.999) < np.sqrt(mesh.area / 5000)


def test_what_does_not_belong_together_is_refused():
    mesh = icosphere(2)
    with pytest.raises(MeshError, match="162"):
        Prolongation(icosphere(3), decimate(mesh, 50))
