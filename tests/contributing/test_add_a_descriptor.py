"""The recipe "Add a descriptor" of CONTRIBUTING.md, followed with a toy descriptor."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Mesh, MeshError, distance_basis, match, prepare, repair
from isomatch_lab.procedural import creature
from shapes import disguised


def toy_descriptor(basis):
    """Mean distance from each vertex to the surface, (n, 1), in mesh units. O(n k)."""
    return (basis @ basis.weights)[:, None] / basis.weights.sum()


@pytest.fixture(scope="module")
def mesh():
    return creature(1500).mesh


@pytest.fixture(scope="module")
def basis(mesh):
    return distance_basis(mesh, 20, 40)


@pytest.fixture(scope="module")
def values(basis):
    return toy_descriptor(basis)


def test_one_row_of_finite_values_for_each_vertex(values, mesh):
    assert values.shape == (mesh.n_vertices, 1)
    assert np.isfinite(values).all()


def test_moving_changes_nothing_and_relabelling_relabels(values, mesh):
    other = disguised(mesh, seed=1)
    moved = toy_descriptor(distance_basis(other.mesh, 20, 40))
    np.testing.assert_allclose(moved[other.new_vertex], values, rtol=1e-4)


def test_signs_of_the_eigenvectors_do_not_matter(values, basis):
    flips = np.random.default_rng(0).choice([-1.0, 1.0], basis.rank)
    np.testing.assert_allclose(toy_descriptor(replace(basis, vectors=basis.vectors * flips)), values)


def test_scaling_the_surface_scales_it_as_documented(values, mesh):
    large = Mesh(10 * mesh.vertices, mesh.faces)
    np.testing.assert_allclose(toy_descriptor(distance_basis(large, 20, 40)), 10 * values, rtol=1e-4)


def test_a_vertex_that_no_face_uses_is_repaired_and_indexed(values, mesh):
    """A basis is refused for such a mesh; that of the repaired mesh has an index map to the vertices of the file."""
    vertices = np.insert(mesh.vertices, 7, [9.0, 9.0, 9.0], axis=0)
    unused = Mesh(vertices, mesh.faces + (mesh.faces >= 7))
    with pytest.raises(MeshError, match="vertices"):
        distance_basis(unused, 20, 40)
    repaired = repair(unused)
    computed = toy_descriptor(distance_basis(repaired.mesh, 20, 40))
    assert np.array_equal(computed, values)
    assert np.array_equal(repaired.vertex_index, np.delete(np.arange(len(vertices)), 7))


@pytest.mark.long
def test_it_starts_a_match_of_a_mesh_with_an_unused_vertex(example):
    """On the body there is a row too few; `PreparedShape.lift` makes one for every vertex of the user."""
    source, target = (
        prepare(Mesh(np.vstack([[9, 9, 9], made.mesh.vertices]), made.mesh.faces + 1)) for made in example
    )
    values = [
        shape.lift(np.hstack([toy_descriptor(shape.distances), shape.signatures]))
        for shape in (source, target)
    ]
    found = match(source, target, initial_descriptors=tuple(values), config=Config(hypotheses="given"))
    assert found.origin == "descriptors"
    assert found.map.vertices[0] == -1
