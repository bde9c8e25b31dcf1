"""Laws of the decimation: topology, boundary, shape and triangles of the coarse mesh."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from data import tosca
from isomatch import Graph, Mesh, MeshError, SettingError
from isomatch.decimation import decimate, decimations
from isomatch.repair import check, repair
from shapes import box, cylinder, flat_grid, icosphere, planar_delaunay
from zoo import torus
from zoo.made import mobius_strip, moved, together


def puncture(mesh: Mesh, *centres: int) -> Mesh:
    """Remove some vertices with their faces."""
    return mesh.submesh(~np.isin(np.arange(mesh.n_vertices), centres))[0]


def side_by_side(*meshes: Mesh) -> Mesh:
    return together(*(moved(mesh, (3 * i, 0, 0)) for i, mesh in enumerate(meshes)))


SURFACES = {
    "closed": icosphere(3),
    "torus": torus(36, 18),
    "moebius": mobius_strip(60, 12),
    "open": cylinder(40, 20),
    "holes": puncture(icosphere(3), 0, 1, 2, 500),
    "flat": flat_grid(24, 30),
    "irregular": planar_delaunay(700),
    "two components": side_by_side(icosphere(3), icosphere(1), puncture(icosphere(3), 5)),
}


def topology(mesh: Mesh) -> tuple:
    report = check(mesh)
    return (
        report.euler_number,
        report.n_components,
        report.n_boundary_loops,
        len(check(repair(mesh).mesh).inconsistent_edges) > 0,
        *(
            len(part)
            for part in (report.non_manifold_edges, report.non_manifold_vertices, report.unused_vertices)
        ),
    )


@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("share", [0.5, 0.05, 0.0])
def test_the_topology_is_preserved(mesh, share):
    coarse = decimate(mesh, int(share * mesh.n_vertices) or 1)
    assert topology(coarse.mesh) == topology(mesh)
    assert not len(check(coarse.mesh).duplicate_faces)
    if share:
        assert coarse.mesh.n_vertices == coarse.wanted
        assert not coarse.is_stalled
    else:
        assert coarse.is_stalled
        assert coarse.mesh.n_vertices < 0.05 * mesh.n_vertices
        assert "wanted" in repr(coarse)


@pytest.mark.long
@pytest.mark.parametrize(
    "make", [partial(torus, 280, 250), partial(mobius_strip, 280, 250), partial(flat_grid, 265, 265)]
)
def test_blocks_preserve_the_topology_and_spread_the_vertices(make):
    """Large meshes are decimated block by block."""
    mesh = make()
    n = mesh.n_vertices // 8
    coarse = decimate(mesh, n)
    assert topology(coarse.mesh) == topology(mesh)
    assert coarse.mesh.n_vertices == n
    assert np.quantile(np.bincount(coarse.owner), 0.99) < 40


@pytest.mark.long
@pytest.mark.parametrize(("n", "sizes"), [(1500, [2000, 700, 400, 60]), (70_000, [80_000, 32_000, 3000])])
def test_several_sizes_at_once_are_those_made_one_by_one(n, sizes):
    mesh = planar_delaunay(n)
    for coarse, size in zip(decimations(mesh, sizes), sizes, strict=True):
        alone = decimate(mesh, size)
        assert np.array_equal(coarse.mesh.vertices, alone.mesh.vertices)
        assert np.array_equal(coarse.mesh.faces, alone.mesh.faces)
        assert np.array_equal(coarse.owner, alone.owner)
        assert coarse.wanted == size


@pytest.mark.parametrize("mesh", [SURFACES["holes"], SURFACES["two components"]])
def test_owners(mesh):
    coarse = decimate(mesh, mesh.n_vertices // 8)
    owners, first = np.unique(coarse.owner, return_index=True)
    assert np.array_equal(owners, np.arange(coarse.mesh.n_vertices))
    assert (np.diff(first) > 0).all()
    a, b = coarse.owner[mesh.edges].T
    assert Graph(mesh.n_vertices, mesh.edges[a == b], np.ones((a == b).sum())).components.max() + 1 == len(
        owners
    )
    coarse_edges = {tuple(edge) for edge in coarse.mesh.edges.tolist()}
    assert {(min(e), max(e)) for e in zip(a.tolist(), b.tolist()) if e[0] != e[1]} >= coarse_edges


@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("weighted", [False, True])
def test_in_place_no_vertex_moves_and_boundaries_stay(mesh, weighted):
    weights = np.exp(mesh.vertices[:, 0]) if weighted else None
    found = decimate(mesh, mesh.n_vertices // 3, in_place=True, weights=weights)
    shift = np.linalg.norm(mesh.vertices - found.mesh.vertices[found.owner], axis=1)
    nearest = np.full(found.mesh.n_vertices, np.inf)
    np.minimum.at(nearest, found.owner, shift)
    assert nearest.max() < 1e-12
    assert topology(found.mesh) == topology(mesh)
    fine, coarse = mesh.boundary_edges, found.mesh.boundary_edges
    assert len(fine) == len(coarse)
    np.testing.assert_array_equal(np.sort(found.owner[np.unique(fine)]), np.unique(coarse))


def test_the_density_grows_with_the_root_of_the_weight():
    plane = flat_grid(101, 101)
    right = plane.vertices[:, 0] > 50
    coarse = decimate(plane, 1500, weights=np.where(right, 81.0, 1.0)).mesh.vertices
    inside = (np.abs(coarse[:, :2] - 50) < 45).all(axis=1) & (np.abs(coarse[:, 0] - 50) > 5)
    n_right = (inside & (coarse[:, 0] > 50)).sum()
    assert n_right / (inside.sum() - n_right) == pytest.approx(9, rel=0.25)


def test_a_mesh_that_is_small_enough_stays():
    mesh = icosphere(2)
    for n in (mesh.n_vertices, 10**6):
        coarse = decimate(mesh, n)
        assert coarse.mesh is mesh
        assert not coarse.is_stalled
        assert np.array_equal(coarse.owner, np.arange(mesh.n_vertices))


def test_the_sphere_stays_round():
    coarse = decimate(icosphere(5), 600).mesh
    assert np.abs(np.linalg.norm(coarse.vertices, axis=1) - 1).max() < 0.01
    assert abs(coarse.volume - 4 / 3 * np.pi) < 0.02 * 4 / 3 * np.pi
    outward = np.einsum("ij,ij->i", coarse.face_cross, coarse.vertices[coarse.faces].mean(axis=1))
    assert (outward > 0).all()


def test_a_flat_rectangle_keeps_its_plane_its_outline_and_its_side():
    coarse = decimate(flat_grid(40, 60), 100).mesh
    assert np.abs(coarse.vertices[:, 2]).max() < 1e-6
    assert (coarse.face_cross[:, 2] > 0).all()
    assert coarse.area == pytest.approx(39 * 59, rel=1e-2)
    assert shape_of_triangles(coarse).mean() > 0.75


@pytest.mark.parametrize("seed", range(3))
def test_no_face_turns_over(seed):
    mesh = planar_delaunay(3000, seed)
    coarse = decimate(mesh, 300).mesh
    assert (np.sign(coarse.face_cross[:, 2]) == np.sign(mesh.face_cross[0, 2])).all()


def test_boundary_loops_keep_their_place():
    coarse = decimate(cylinder(80, 40), 200).mesh
    rim = coarse.vertices[np.unique(coarse.boundary_edges)]
    height = 39 / 80
    assert np.minimum(np.abs(rim[:, 2]), np.abs(rim[:, 2] - height)).max() < 1e-3 * height
    assert check(coarse).boundary_lengths == pytest.approx([1.0, 1.0], rel=0.02)


def test_a_cube_keeps_its_edges():
    cube = box(20, 20, 20)
    coarse = decimate(cube, 150).mesh
    size = np.ptp(cube.vertices, axis=0)
    assert np.ptp(coarse.vertices, axis=0) == pytest.approx(size, rel=1e-3)
    assert coarse.volume == pytest.approx(cube.volume, rel=0.02)


def shape_of_triangles(mesh: Mesh) -> np.ndarray:
    """4 √3 area / sum of squared edges: 1 if equilateral."""
    sides = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    return 4 * np.sqrt(3) * mesh.face_areas / (sides**2).sum(axis=(1, 2))


@pytest.mark.long
@pytest.mark.parametrize("n", [5000, 1000])
def test_an_animal_keeps_its_shape(n):
    cat = tosca("cat0")
    coarse = decimate(cat, n)
    assert topology(coarse.mesh) == topology(cat)
    shapes = shape_of_triangles(coarse.mesh)
    assert shapes.mean() > 0.75
    assert np.quantile(shapes, 0.01) > 0.25
    assert shapes.min() > 0.1
    assert coarse.mesh.area == pytest.approx(cat.area, rel=0.03)
    assert coarse.mesh.volume == pytest.approx(cat.volume, rel=0.02)
    edge = np.sqrt(cat.area / n)
    moved = np.linalg.norm(cat.vertices - coarse.mesh.vertices[coarse.owner], axis=1)
    assert np.quantile(moved, 0.99) < 1.5 * edge


def test_every_run_and_every_unit_give_the_same():
    mesh = SURFACES["irregular"]
    coarse = decimate(mesh, 300)
    for scale in (1.0, 2.0**-400, 2.0**400):
        scaled = decimate(Mesh(mesh.vertices * scale, mesh.faces), 300)
        assert np.array_equal(scaled.mesh.vertices, coarse.mesh.vertices * scale)
        assert np.array_equal(scaled.mesh.faces, coarse.mesh.faces)
        assert np.array_equal(scaled.owner, coarse.owner)
    far = decimate(Mesh(mesh.vertices + 1e6, mesh.faces), 300)
    assert topology(far.mesh) == topology(mesh)
    assert far.mesh.area == pytest.approx(mesh.area, rel=1e-2)


def test_where_the_mesh_is_not_manifold_nothing_gets_worse():
    sphere = icosphere(3)
    fin = Mesh(
        np.concatenate([sphere.vertices, 1.5 * sphere.vertices[sphere.edges[:40, 0]]]),
        np.concatenate([sphere.faces, np.column_stack([sphere.edges[:40], np.arange(642, 682)])]),
    )
    pinched = puncture(side_by_side(icosphere(3), icosphere(3)), 3)
    faces = np.where(pinched.faces == 700, 10, pinched.faces)
    for mesh in (fin, repair(Mesh(pinched.vertices, faces)).mesh):
        coarse = decimate(mesh, 150).mesh
        before, after = check(mesh), check(coarse)
        fixed = [*before.non_manifold_edges.ravel(), *before.non_manifold_vertices]
        gap = np.linalg.norm(mesh.vertices[fixed][:, None] - coarse.vertices, axis=2).min(axis=1)
        assert gap.max() < 1e-12
        assert after.euler_number == before.euler_number
        assert after.n_components == before.n_components
        assert len(after.non_manifold_edges) == len(before.non_manifold_edges)
        assert len(after.non_manifold_vertices) == len(before.non_manifold_vertices)
        assert not len(after.duplicate_faces)


@pytest.mark.parametrize(
    ("faces", "n"),
    [
        ([[0, 1, 2]], 3),
        ([[0, 1, 2], [0, 2, 1]], 3),
        ([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], 4),
        ([[0, 1, 2], [1, 3, 2]], 3),
        (np.zeros((0, 3), dtype=int), 4),
    ],
    ids=["triangle", "two-sided triangle", "tetrahedron", "square", "points"],
)
def test_the_smallest_surfaces_never_vanish(faces, n):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]])
    coarse = decimate(Mesh(points[: np.max(faces, initial=2) + 1] if len(faces) else points, faces), 1)
    assert coarse.mesh.n_vertices == n
    assert coarse.is_stalled


def test_what_is_no_surface_is_refused():
    sphere = icosphere(1)
    for corner, message in ((sphere.faces[7, 0], "have a vertex twice"), (99, "refer to vertices outside")):
        faces = sphere.faces.copy()
        faces[7, 1] = corner
        with pytest.raises(MeshError, match=f"faces 7 {message}"):
            decimate(Mesh(sphere.vertices, faces), 10)
    vertices = sphere.vertices.copy()
    vertices[3, 0] = np.nan
    with pytest.raises(MeshError, match=r"vertices 3 are not finite"):
        decimate(Mesh(vertices, sphere.faces), 10)
    with pytest.raises(SettingError, match="n_vertices = 0"):
        decimate(sphere, 0)
