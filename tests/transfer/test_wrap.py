"""The target in the source's topology: identity, motions and mirrors; thin walls; what has no counterpart."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from data import real_file
from isomatch import Correspondence, Mesh, match, wrap
from isomatch._core.errors import MapError
from isomatch.correspondence.template_bending import turned_faces
from shapes import disguised, flat_grid, icosphere
from thin_walls import shell
from zoo.made import moved, soup, together


def error(points, truth, target):
    """Mean distance over √area."""
    return np.linalg.norm(points - truth, axis=1).mean() / np.sqrt(target.area)


@pytest.mark.parametrize(("image", "n_target", "message"), [(-1, 42, "no vertex"), (0, 5, "target")])
def test_maps_of_nothing_and_of_other_surfaces_are_refused(image, n_target, message):
    with pytest.raises(MapError, match=message):
        wrap(Correspondence(np.full(42, image), n_target), icosphere(1), icosphere(1))


def test_the_identity_gives_the_target():
    mesh = icosphere(2)
    wrapped = wrap(Correspondence(np.arange(162), 162), mesh, mesh)
    np.testing.assert_allclose(wrapped.mesh.vertices, mesh.vertices, atol=1e-12)
    quality = wrapped.quality
    assert (quality.turned, quality.extended) == (0.0, 0)
    assert quality.stretch == pytest.approx(1.0, abs=1e-9)
    assert quality.distance == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("winding", [1, -1])
def test_a_copy_that_was_moved_scaled_and_wound_otherwise_is_met_exactly(scale, winding):
    whole = shell("tube", 0.05, 0).mesh
    other = disguised(whole, seed=1, scale=scale)
    target = Mesh(other.mesh.vertices, other.mesh.faces[:, ::winding])
    wrapped = wrap(Correspondence(other.new_vertex, whole.n_vertices), whole, target)
    truth = target.vertices[other.new_vertex]
    assert np.abs(wrapped.mesh.vertices - truth).max() < 1e-6 * np.sqrt(target.area)
    assert wrapped.quality.turned == 0.0


def test_a_map_to_the_mirror_image_gives_the_mirror_image():
    whole = shell("tube", 0.05, 0).mesh
    target = whole.moved(whole.vertices * [-1.0, 1.0, 1.0])
    wrapped = wrap(Correspondence(np.arange(whole.n_vertices), whole.n_vertices), whole, target)
    assert np.abs(wrapped.mesh.vertices - target.vertices).max() < 1e-6 * np.sqrt(target.area)
    assert wrapped.quality.turned == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_map_is_smoothed_out(seed):
    source, target = icosphere(3), icosphere(4)
    shaken = source.vertices + 0.09 * np.random.default_rng(seed).normal(size=source.vertices.shape)
    nearest = cKDTree(target.vertices).query(shaken)[1]
    wrapped = wrap(Correspondence(nearest, target.n_vertices), source, target)
    np.testing.assert_array_equal(wrapped.mesh.faces, source.faces)
    assert wrapped.quality.turned == 0.0
    lookup = error(target.vertices[nearest], source.vertices, target)
    assert error(wrapped.mesh.vertices, source.vertices, target) < 0.6 * lookup
    assert wrapped.quality.distance < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("kind", ["capsule", "tube"])
@pytest.mark.parametrize("poses", [(0, 1), (2, 3)])
def test_the_two_sides_of_a_thin_wall_stay_apart(kind, poses):
    assert_walls_apart(*(shell(kind, 0.028, pose) for pose in poses))


@pytest.mark.long
@pytest.mark.parametrize("kind", ["capsule", "tube"])
@pytest.mark.parametrize("step", [0.012, 0.0085])
def test_the_two_sides_of_thin_walls_of_many_triangles_stay_apart(kind, step):
    assert_walls_apart(shell(kind, step, 0), shell(kind, step, 1))


def assert_walls_apart(source, target):
    given = source.disturbed_map(target)
    truth, lookup = source.truth(target), target.mesh.vertices[given.vertices]
    wrapped = wrap(given, source.mesh, target.mesh)
    points = wrapped.mesh.vertices
    assert np.isfinite(points).all()
    assert wrapped.quality.turned <= 1e-3
    assert wrapped.quality.turned == pytest.approx(turned_faces(source.mesh, points).mean(), abs=1e-9)
    assert wrapped.quality.stretch < 1.4
    assert wrapped.quality.distance < 1e-3
    assert wrapped.quality.extended == 0
    assert error(points, truth, target.mesh) < 0.5 * error(lookup, truth, target.mesh)
    # no vertex ends on the other side of its wall: the normals there are opposite
    normals = target.mesh.vertex_normals[cKDTree(target.mesh.vertices).query(points)[1]]
    expected = target.mesh.vertex_normals[cKDTree(target.mesh.vertices).query(truth)[1]]
    assert (np.einsum("ni,ni->n", normals, expected) < -0.5).mean() < 0.002


def test_a_template_over_an_opening_is_completed_and_marked():
    """Vertices over the opening have images on its rim, as the nearest points there are."""
    ball = icosphere(4)
    open_ball, _ = ball.submesh(ball.vertices[:, 2] < 0.7)
    nearest = cKDTree(open_ball.vertices).query(ball.vertices)[1]
    wrapped = wrap(Correspondence(nearest, open_ball.n_vertices), ball, open_ball)
    marked, height = wrapped.extended, ball.vertices[:, 2]
    assert marked[height > 0.85].all()
    assert not marked[height < 0.6].any()
    assert wrapped.quality.extended == marked.sum()
    radius = np.linalg.norm(wrapped.mesh.vertices, axis=1)
    assert np.abs(radius[~marked] - 1).max() < 0.03
    assert np.abs(radius[marked] - 1).max() < 0.1
    assert wrapped.quality.turned == 0.0


def test_a_boundary_comes_to_lie_on_the_boundary():
    source, target = flat_grid(30, 30), flat_grid(24, 24)
    target = target.moved(target.vertices * 29 / 23)
    from_sides = []
    for seed in range(3):
        shaken = source.vertices + 0.3 * np.random.default_rng(seed).normal(size=source.vertices.shape)
        given = Correspondence(cKDTree(target.vertices).query(shaken)[1], target.n_vertices)
        points = wrap(given, source, target).mesh.vertices
        rim = np.unique(source.boundary_edges)
        from_side = np.minimum(points[rim, :2], 29 - points[rim, :2]).min(axis=1)
        from_sides.append(np.abs(from_side).mean())
        assert error(points, source.vertices, target) < 0.5 * error(
            target.vertices[given.vertices], source.vertices, target
        )
    assert np.mean(from_sides) < 0.04  # 0.08 if the boundary counted as little as the rest


def test_vertices_at_a_seam_stay_together():
    whole = flat_grid(5, 5)
    corners = whole.faces.ravel()
    image = np.arange(25).reshape(5, 5).copy()
    image[2, 2] = 18  # folds the faces around
    wrapped = wrap(Correspondence(image.ravel()[corners], 25), soup(whole), whole)
    assert wrapped.quality.turned == 0.0
    for corner in range(25):
        at = wrapped.mesh.vertices[corners == corner]
        assert (at == at[0]).all()


def test_what_has_no_image_continues_what_has():
    """Inside a flat grid it is the linear extension; another component goes along."""
    grid, ball = flat_grid(7, 7), icosphere(0)
    source = together(grid, moved(ball, [3, 3, 1], 0.2))
    image = np.arange(61)
    inside = (grid.vertices[:, :2] > 1.5).all(axis=1) & (grid.vertices[:, :2] < 4.5).all(axis=1)
    image[:49][inside] = -1
    image[49:] = -1
    turned = 3 * grid.vertices @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    wrapped = wrap(Correspondence(image, 49), source, Mesh(turned, grid.faces))
    np.testing.assert_array_equal(wrapped.extended, image < 0)
    wanted = 3 * source.vertices @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(wrapped.mesh.vertices, wanted, atol=1e-3)


def test_vertices_without_faces_move_with_the_surface_near_them():
    grid, n = flat_grid(30, 30), 500
    rng = np.random.default_rng(0)
    source = Mesh(np.vstack([grid.vertices, rng.uniform(0, 30, (n, 3))]), grid.faces)
    image = np.append(np.arange(900), np.full(n, -1))
    wrapped = wrap(Correspondence(image, 900), source, grid.moved(grid.vertices + 1))
    assert wrapped.extended.sum() == n
    np.testing.assert_allclose(wrapped.mesh.vertices, source.vertices + 1, atol=1e-9)


def test_faces_without_area_do_no_harm():
    ball = icosphere(3)
    vertices = np.vstack([ball.vertices, ball.vertices[ball.faces[0]].mean(axis=0)])
    middle = ball.n_vertices
    a, b, c = ball.faces[0]
    split = [[a, b, middle], [b, c, middle], [c, a, middle]]
    flat = [[ball.faces[1, 0], ball.faces[1, 1], ball.faces[1, 1]]]
    vertices[middle] = vertices[a]  # two of the three faces around it have no area
    source = Mesh(vertices, np.concatenate([ball.faces[1:], split, flat]))
    turn = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    target = ball.moved(ball.vertices @ turn.T)
    image = np.append(np.arange(middle), a)
    wrapped = wrap(Correspondence(image, middle), source, target)
    np.testing.assert_allclose(wrapped.mesh.vertices, vertices @ turn.T, atol=1e-2)


def test_a_surface_without_area_gives_the_images():
    line = Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    wrapped = wrap(Correspondence([2, 1, 0], 3), line, line)
    np.testing.assert_allclose(wrapped.mesh.vertices, line.vertices[::-1], atol=1e-12)


@pytest.mark.long
def test_scanned_people_are_nearer_to_the_truth_than_by_lookup():
    shapes, names = [], []
    for name in ("tr_reg_000", "tr_reg_010"):
        with np.load(real_file(f"faust_r/{name}.npz"), allow_pickle=False) as arrays:
            shapes.append(Mesh(arrays["vertices"], arrays["faces"]))
            names.append(arrays["vts"])
    result = match(*shapes)
    wrapped = wrap(result.map, *shapes)
    assert wrapped.quality.turned <= 1e-3
    np.testing.assert_array_equal(wrapped.mesh.faces, shapes[0].faces)
    np.testing.assert_array_equal(result.as_mesh(*shapes).vertices, wrapped.mesh.vertices)
    truth = shapes[1].vertices[names[1]]
    lookup = result.map.pull_back(shapes[1].vertices)[names[0]]
    bent = wrapped.mesh.vertices[names[0]]
    assert error(bent, truth, shapes[1]) < 0.97 * error(lookup, truth, shapes[1])
