"""Creases, and slits along them that are closed again."""

import numpy as np
import pytest

from isomatch import Mesh, check
from isomatch.geodesics import distance_engine
from isomatch.repair import close_holes, count_handles, cut_along, ends_of, find_creases
from isomatch.repair.caps import boundary_loops
from shapes import disguised, icosphere
from touching import double_ring, pressed_fork, ring


def path_between(mesh, height):
    """List the edges along a great circle of a sphere above a height."""
    on_circle = np.abs(mesh.vertices[:, 0]) < 1e-9
    kept = on_circle & (mesh.vertices[:, 2] > height)
    return mesh.edges[kept[mesh.edges].all(axis=1)]


ONE_FACE = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize("make", [lambda: icosphere(3), ring, double_ring, lambda: ONE_FACE])
def test_smooth_shapes_have_none(make):
    assert find_creases(make()).shape == (0, 2)


def test_two_prongs_that_touch_have_one_between_them():
    """On both sides of the self-contact, and over its top."""
    mesh = pressed_fork()
    edges = find_creases(mesh)
    middles = mesh.vertices[edges].mean(axis=1)
    assert np.abs(middles[:, 0]).max() < 0.1, "between the prongs, which lie side by side"
    assert middles[:, 2].max() > 0.3
    assert (middles[:, 1].min() < 0) & (middles[:, 1].max() > 0)
    known = {frozenset(edge) for edge in mesh.edges.tolist()}
    assert all(frozenset(edge) in known for edge in edges.tolist())


def test_a_mesh_stays_connected_and_its_faces_stay():
    mesh = pressed_fork()
    edges = find_creases(mesh)
    cut, index = cut_along(mesh, edges)
    np.testing.assert_array_equal(index[: mesh.n_vertices], np.arange(mesh.n_vertices))
    np.testing.assert_array_equal(index[cut.faces], mesh.faces)
    np.testing.assert_array_equal(mesh.vertices[index], cut.vertices)
    assert cut.components.max() == 0
    assert cut.n_vertices == mesh.n_vertices + len(edges) - len(ends_of(edges))
    assert len(boundary_loops(cut)) == len(ends_of(edges))


def test_names_position_and_unit_do_not_matter():
    mesh = pressed_fork()
    other = disguised(mesh, 1, scale=1000.0)
    edges = {frozenset(edge) for edge in find_creases(mesh).tolist()}
    edges_of_other = {
        frozenset(np.argsort(other.new_vertex)[edge].tolist()) for edge in find_creases(other.mesh)
    }
    assert len(edges & edges_of_other) > 0.9 * len(edges), "except ties"


def test_a_slit_of_a_sphere_is_closed_on_either_side_by_itself():
    """From one side of the slit to the other, the shortest path runs around the end of a chord."""
    sphere = icosphere(4)
    edges = path_between(sphere, 0.0)
    cut, index = cut_along(sphere, edges)
    ends = ends_of(edges)
    assert len(ends) == 1
    closed = close_holes(cut, ends)
    assert np.array_equal(closed.vertices[: cut.n_vertices], cut.vertices)
    assert np.array_equal(closed.faces[: cut.n_faces], cut.faces)
    assert not len(closed.boundary_edges)
    assert check(closed).euler_number == 2
    assert count_handles(closed) == 0
    top = np.flatnonzero(sphere.vertices[:, 2] == 1)[0]
    copy = sphere.n_vertices + np.flatnonzero(index[sphere.n_vertices :] == top)[0]
    across = distance_engine(closed, weld=False).distances_from([top])[0, copy]
    low = sphere.vertices[ends[0], 2].max()
    assert across == pytest.approx(2 * (1 - low), rel=0.1), "down one half disc and up the other"
    together = distance_engine(close_holes(cut), weld=False).distances_from([top])[0, copy]
    assert together < across


def test_a_chord_that_is_on_no_rim_parts_nothing():
    sphere = icosphere(3)
    bowl = sphere.submesh(sphere.vertices[:, 2] < 0.5)[0]
    assert not np.isin([0, 1], boundary_loops(bowl)[0]).all()
    closed = close_holes(bowl, [np.array([0, 1])])
    np.testing.assert_array_equal(closed.faces, close_holes(bowl).faces)
