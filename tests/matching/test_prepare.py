"""What is computed from one shape alone."""

import numpy as np
import pytest

from isomatch import Config, Mesh, MeshError, distance_engine, geodesic_distances, prepare
from isomatch.descriptors import mean_curvature
from isomatch_lab.procedural import creature
from shapes import box, disguised, icosphere, inside_out, two_spheres
from zoo import torus
from zoo.made import moved, soup, together, with_vertices


@pytest.fixture(scope="module")
def shape(prepared_example):
    return prepared_example[0]


def test_body_of_a_sound_mesh_is_all_of_it_centred_and_of_unit_area(example, shape):
    areas, n = shape.body.vertex_areas, example[0].mesh.n_vertices
    np.testing.assert_array_equal(shape.body_vertex, np.arange(n))
    np.testing.assert_array_equal(shape.user_vertex, np.arange(n))
    assert (shape.left_out, shape.notes) == (pytest.approx(0, abs=1e-12), ())
    assert shape.body.area == pytest.approx(1)
    np.testing.assert_allclose(areas @ shape.body.vertices, 0, atol=1e-12)
    assert shape.scale == pytest.approx(example[0].mesh.area ** 0.5)


def test_sizes_are_those_of_the_settings_and_columns_distances_from_the_samples(shape):
    n = shape.body.n_vertices
    assert (shape.columns.shape, shape.distances.vectors.shape) == ((100, n), (n, 50))
    assert shape.laplace.vectors.shape == (n, 150)
    assert len(np.unique(shape.sample_vertices)) == len(shape.sample_vertices) == 1000
    assert (shape.columns[np.arange(100), shape.column_vertices] == 0).all()
    again = shape.distances.row(shape.column_vertices[:10])
    assert np.abs(again - shape.columns[:10]).mean() < 0.01 * shape.columns.mean()


def test_extremal_points_are_apart_and_remote(shape):
    assert 4 <= len(shape.extremities) <= 8
    among = shape.extremity_columns[:, shape.extremities]
    assert among[~np.eye(len(among), dtype=bool)].min() >= 0.24
    most = shape.average_distance.max()
    assert shape.average_distance[shape.extremities[0]] == pytest.approx(most, rel=1e-6)


@pytest.mark.long
def test_every_prefix_of_the_spread_vertices_is_even(shape):
    points = shape.body.vertices
    for count in (50, 200, 1000):
        chosen = points[shape.sample_vertices[:count]]
        distance = np.linalg.norm(chosen[:, None] - chosen, axis=2)[~np.eye(count, dtype=bool)].min()
        reach = np.linalg.norm(points[:, None] - chosen, axis=2).min(axis=1).max()
        assert reach <= distance * (1 + 1e-9)


def test_signatures_and_curvature_are_standardised(shape):
    areas = shape.laplace.weights
    np.testing.assert_allclose(areas @ shape.signatures, 0, atol=1e-9)
    assert shape.signatures.shape == (shape.body.n_vertices, 23)
    assert np.average(shape.curvature, weights=areas) == pytest.approx(0.0, abs=1e-9)
    assert np.average(shape.curvature**2, weights=areas) == pytest.approx(1.0)


def test_curvature_of_a_sphere_is_one_over_its_radius():
    """In units of √area: 1 / r = √(4π); and outward bumps are positive."""
    sphere = prepare(icosphere(4), Config(n_functions=100))
    curvature = mean_curvature(sphere.triangles, sphere.laplace, 100)
    np.testing.assert_allclose(curvature, (4 * np.pi) ** 0.5, rtol=0.02)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e4])
def test_moved_and_scaled_shape_is_prepared_alike(example, shape, scale):
    other = disguised(example[0].mesh, seed=9, scale=scale)
    again, new = prepare(other.mesh), other.new_vertex
    for name in ("column_vertices", "extremities", "sample_vertices"):
        np.testing.assert_array_equal(getattr(again, name), new[getattr(shape, name)])
    np.testing.assert_allclose(again.columns[:, new], shape.columns, atol=1e-5)
    np.testing.assert_allclose(again.signatures[new], shape.signatures, atol=5e-3)
    np.testing.assert_allclose(again.average_distance[new], shape.average_distance, atol=1e-5)


def test_inside_out_mesh_is_wound_outward(example, shape):
    mesh = example[0].mesh
    turned = prepare(inside_out(mesh))
    assert turned.body.volume == pytest.approx(shape.body.volume)
    assert any("rewound" in note for note in turned.notes), "and the user is told"


def test_duplicated_seam_is_welded():
    """An animal whose every triangle has vertices of its own, as STL files have: one shape, not a thousand."""
    mesh = creature(1500).mesh
    split = soup(mesh)
    shape = prepare(split)
    assert shape.body.n_vertices == mesh.n_vertices
    assert (shape.body_vertex >= 0).all()
    offset = split.vertices - shape.scale * shape.body.vertices[shape.body_vertex]
    np.testing.assert_allclose(offset - offset[0], 0, atol=1e-9)


def test_smaller_component_is_left_out_and_noted():
    mesh = two_spheres(3, 0.5)
    n = mesh.n_vertices // 2
    shape = prepare(mesh, Config(n_functions=50))
    assert (shape.body_vertex[:n] >= 0).all()
    assert (shape.body_vertex[n:] == -1).all()
    assert shape.left_out == pytest.approx(0.5), "of the vertices, if only 0.2 of the area"
    (note,) = shape.notes
    assert note.startswith("1 smaller components with 20.0% of the area and 50.0% of the vertices are left")


def test_vertices_of_debris_and_without_faces_are_not_counted_as_left_out():
    body, speck = icosphere(3), Mesh(np.eye(3), [[0, 1, 2]])
    specks = [moved(speck, [2 + i, 0, 0], 0.01) for i in range(100)]
    alone = np.random.default_rng(0).normal(size=(200, 3)) * 9
    shape = prepare(with_vertices(together(body, *specks), alone), Config(n_functions=50))
    assert (shape.body_vertex >= 0).sum() == body.n_vertices
    assert shape.left_out < 0.001


def test_small_mesh_gets_reduced_settings_that_are_recorded():
    shape = prepare(icosphere(2))
    assert shape.config == Config(n_columns=81, rank=40, n_functions=40)
    assert shape.laplace.vectors.shape == (162, 40)


def test_too_few_vertices():
    with pytest.raises(MeshError, match="subdivide"):
        prepare(icosphere(1))


def test_over_and_over_the_same(example, shape):
    again = prepare(example[0].mesh)
    np.testing.assert_array_equal(again.distances.vectors, shape.distances.vectors)
    np.testing.assert_array_equal(again.laplace.vectors, shape.laplace.vectors)


def test_values_are_lifted_to_the_users_vertices_and_back(example, shape):
    """A mesh with a vertex that no face uses: values on the body have a row too few for it."""
    mesh = Mesh(np.vstack([[9, 9, 9], example[0].mesh.vertices]), example[0].mesh.faces + 1)
    other = prepare(mesh)
    values = np.random.default_rng(0).normal(size=(other.body.n_vertices, 3))
    lifted = other.lift(values)
    assert lifted.shape == (mesh.n_vertices, 3)
    assert np.isnan(lifted[0]).all()
    np.testing.assert_array_equal(other.restrict(lifted), values)
    labels = other.lift(np.arange(other.body.n_vertices), -1)
    assert labels.dtype.kind == "i"
    assert labels[0] == -1


@pytest.mark.long
@pytest.mark.parametrize("kind", ["matrix", "function", "engine"])
def test_given_distances_take_the_place_of_the_engine(kind):
    """Distances have the user's units and vertices; one vertex is not in the body."""
    made = creature(1500).mesh
    mesh = Mesh(np.vstack([[9, 9, 9], 3 * made.vertices]), made.faces + 1)
    n = mesh.n_vertices
    matrix = np.full((n, n), np.inf)
    matrix[0, 0] = 0.0
    matrix[1:, 1:] = geodesic_distances(Mesh(mesh.vertices[1:], made.faces), np.arange(n - 1))
    matrix = np.minimum(matrix, matrix.T)
    distances = {
        "matrix": matrix,
        "function": lambda sources: matrix[sources],
        "engine": distance_engine(matrix),
    }
    given = prepare(mesh, distances=distances[kind])
    assert given.distances.engine == ("function" if kind == "function" else "matrix")
    rows = given.user_vertex[given.column_vertices]
    np.testing.assert_allclose(given.columns, matrix[rows][:, given.user_vertex] / given.scale, rtol=1e-6)
    assert given.scale == pytest.approx(3 * made.area**0.5)


def test_given_distances_of_another_shape(shape):
    with pytest.raises(MeshError, match="one row"):
        prepare(shape.surface, distances=np.ones((3, 3)) - np.eye(3))


def test_engine_by_name():
    mesh = creature(1500).mesh
    assert prepare(mesh, Config(engine="dijkstra")).distances.engine == "dijkstra"
    assert prepare(mesh).distances.engine == "fast_marching"


@pytest.mark.parametrize("mesh", [box(10, 8, 6), torus(40, 20)], ids=["box", "torus"])
def test_rounding_does_not_choose_between_the_sides_of_a_symmetric_shape(mesh):
    """Equal distances are told apart by number, and a right angle is not taken for an obtuse one."""
    moves = 1e-9 * np.random.default_rng(0).uniform(-1, 1, mesh.vertices.shape)
    exact, disturbed = prepare(mesh), prepare(mesh.moved(mesh.vertices + moves))
    for chosen in ("column_vertices", "sample_vertices", "extremities"):
        np.testing.assert_array_equal(getattr(exact, chosen), getattr(disturbed, chosen))
