"""Holes closed by caps."""

import numpy as np
import pytest

from isomatch import Mesh, check
from isomatch.repair import close_holes
from isomatch.repair.caps import boundary_loops
from isomatch_lab.damage import cut, holes
from isomatch_lab.procedural import creature
from shapes import flat_grid, icosphere
from zoo.made import without_faces


@pytest.fixture(scope="module")
def sphere():
    return icosphere(4)


def test_a_closed_mesh_stays_as_it_is(sphere):
    assert np.array_equal(close_holes(sphere).faces, sphere.faces)


@pytest.mark.parametrize("height", [-0.5, 0.0, 0.6])
def test_a_sphere_cut_by_a_plane_gets_a_disc(sphere, height):
    kept = (sphere.vertices[sphere.faces, 2] < height).all(axis=1)
    vertices, faces = np.unique(sphere.faces[kept], return_inverse=True)
    bowl = Mesh(sphere.vertices[vertices], faces.reshape(-1, 3))
    closed = close_holes(bowl)
    report = check(closed)
    assert report.euler_number == 2
    assert not len(closed.boundary_edges)
    assert not report.fatal
    assert "no defects" in str(report)
    rim = bowl.vertices[boundary_loops(bowl)[0]]
    radius = np.linalg.norm(rim[:, :2], axis=1).mean()
    assert closed.area - bowl.area == pytest.approx(np.pi * radius**2, rel=0.15)  # the rim is ragged
    lengths = closed.edge_lengths.max() / sphere.edge_lengths.mean()
    assert lengths < 3, "the cap is as fine as the mesh"


@pytest.mark.long
@pytest.mark.parametrize("damage", [cut, holes])
def test_the_mesh_comes_first_and_every_hole_is_closed(damage):
    mesh = damage(creature(2000).mesh, 0.3, seed=3).mesh
    closed = close_holes(mesh)
    assert np.array_equal(closed.vertices[: mesh.n_vertices], mesh.vertices)
    assert np.array_equal(closed.faces[: mesh.n_faces], mesh.faces)
    assert not len(closed.boundary_edges)


def test_holes_that_touch_get_a_cap_each():
    # a strip of squares around two holes that meet in vertex 4
    mesh = without_faces(flat_grid(5, 5), [10, 11, 20, 21])
    loops = boundary_loops(mesh)
    assert sorted(len(loop) for loop in loops) == [4, 4, 16]
