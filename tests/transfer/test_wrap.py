"""The target in the source's topology: laws of the identity and of mirrors, noise that is mended, what has no image."""

import numpy as np
import pytest

from data import real_file
from isomatch import Correspondence, Mesh, match, wrap
from isomatch.correspondence import nearest_points
from isomatch.errors import MapError
from shapes import flat_grid, icosphere


def inverted(mesh, outward):
    return (
        np.einsum("fi,fi->f", mesh.face_cross, outward(mesh.vertices[mesh.faces].mean(axis=1))) <= 0
    ).sum()


def test_a_map_of_nothing_cannot_be_wrapped():
    mesh = icosphere(1)
    with pytest.raises(MapError, match="gives no vertex an image"):
        wrap(Correspondence(np.full(42, -1), 42), mesh, mesh)


def test_the_identity_gives_the_target():
    mesh = icosphere(2)
    wrapped = wrap(Correspondence(np.arange(162), 162), mesh, mesh)
    np.testing.assert_allclose(wrapped.mesh.vertices, mesh.vertices, atol=1e-15)
    assert (wrapped.inverted_before, wrapped.inverted, wrapped.extended) == (0, 0, 0)


def test_a_mirror_image_is_not_mended():
    mesh = icosphere(2)
    mirror = np.abs(mesh.vertices[:, None] * [-1, 1, 1] - mesh.vertices).sum(axis=2).argmin(axis=1)
    wrapped = wrap(Correspondence(mirror, 162), mesh, mesh)
    np.testing.assert_allclose(wrapped.mesh.vertices, mesh.vertices[mirror], atol=1e-15)
    assert wrapped.inverted_before == 0


def test_a_flat_face_is_mended_though_none_is_turned_over():
    mesh = icosphere(2)
    vertex, other, last = mesh.faces[0]
    faces = np.array([mesh.faces[(mesh.faces == v).any(axis=1).argmax()] for v in range(162)])
    barycentric = (faces == np.arange(162)[:, None]).astype(float)
    faces[vertex], barycentric[vertex] = (vertex, other, last), (1e-5, 0.5, 0.5 - 1e-5)
    wrapped = wrap(Correspondence(np.arange(162), 162, faces, barycentric), mesh, mesh)
    assert (wrapped.inverted_before, wrapped.inverted) == (0, 0)
    assert wrapped.mesh.face_areas.min() > 0.01 * mesh.face_areas.min()


@pytest.mark.parametrize("seed", range(3))
def test_inverted_faces_are_mended_on_the_surface(seed):
    source, target = icosphere(3), icosphere(4)
    rng = np.random.default_rng(seed)
    shaken = source.vertices + 0.09 * rng.normal(size=source.vertices.shape)
    shaken /= np.linalg.norm(shaken, axis=1, keepdims=True)
    start = (shaken @ target.vertices.T).argmax(axis=1)
    points = nearest_points(target.vertices, shaken, target.faces, start)
    found = Correspondence(points.corners[:, 0], target.n_vertices, *points)
    before = source.moved(found.pull_back(target.vertices))
    wrapped = wrap(found, source, target)
    assert inverted(before, lambda x: x) > 50
    assert wrapped.inverted_before > 50
    assert wrapped.inverted == inverted(wrapped.mesh, lambda x: x) == 0
    np.testing.assert_array_equal(wrapped.mesh.faces, source.faces)
    radius = np.linalg.norm(wrapped.mesh.vertices, axis=1)
    assert radius.min() > 0.99  # on the chords of the target's faces
    assert radius.max() <= 1 + 1e-12
    assert np.linalg.norm(wrapped.mesh.vertices - source.vertices, axis=1).max() < 0.5


def test_what_is_mended_here_does_not_depend_on_what_is_mended_there():
    strip = flat_grid(40, 5)
    images = np.tile(np.arange(200), (2, 1))
    images[:, 22] = 32
    images[1, 152] = 167
    one, both = (wrap(Correspondence(image, 200), strip, strip) for image in images)
    assert both.inverted_before > one.inverted_before > both.inverted == one.inverted == 0
    np.testing.assert_allclose(both.mesh.vertices[:100], one.mesh.vertices[:100], atol=1e-9)


def test_vertices_at_a_seam_stay_together():
    whole = flat_grid(5, 5)
    corners, faces = whole.faces.ravel(), np.arange(whole.faces.size).reshape(-1, 3)
    soup = Mesh(whole.vertices[corners], faces)
    image = np.arange(25).reshape(5, 5).copy()
    image[2, 2] = 18  # folds the faces around
    wrapped = wrap(Correspondence(image.ravel()[corners], 25), soup, whole)
    assert wrapped.inverted_before > wrapped.inverted == 0
    for corner in range(25):
        at = wrapped.mesh.vertices[corners == corner]
        assert (at == at[0]).all()


def test_what_has_no_image_continues_what_has():
    """Inside a flat grid it is the linear extension; another component goes along rigidly."""
    grid, ball = flat_grid(7, 7), icosphere(0)
    ball = ball.moved(0.2 * ball.vertices + [3.0, 3.0, 1.0])
    source = Mesh(np.vstack([grid.vertices, ball.vertices]), np.vstack([grid.faces, ball.faces + 49]))
    image = np.arange(61)
    inside = (grid.vertices[:, :2] > 1.5).all(axis=1) & (grid.vertices[:, :2] < 4.5).all(axis=1)
    image[:49][inside] = -1
    image[49:] = -1
    turned = grid.vertices @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    wrapped = wrap(Correspondence(image, 49), source, Mesh(turned, grid.faces))
    assert wrapped.extended == inside.sum() + 12
    wanted = source.vertices @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(wrapped.mesh.vertices[49:], wanted[49:], atol=1e-9)
    np.testing.assert_allclose(wrapped.mesh.vertices[:49], wanted[:49], atol=1e-6)


def test_vertices_without_faces_move_with_the_surface_near_them():
    grid, n = flat_grid(30, 30), 500
    rng = np.random.default_rng(0)
    source = Mesh(np.vstack([grid.vertices, rng.uniform(0, 30, (n, 3))]), grid.faces)
    image = np.append(np.arange(900), np.full(n, -1))
    wrapped = wrap(Correspondence(image, 900), source, grid.moved(grid.vertices + 1))
    assert wrapped.extended == n
    np.testing.assert_allclose(wrapped.mesh.vertices, source.vertices + 1, atol=1e-9)


def test_a_map_of_other_surfaces_is_refused():
    with pytest.raises(MapError, match="not a map of this target"):
        wrap(Correspondence(np.zeros(42, int), 5), icosphere(1), icosphere(1))


@pytest.mark.long
def test_scanned_people_have_no_inverted_faces():
    shapes = []
    for name in ("tr_reg_000", "tr_reg_010"):
        with np.load(real_file(f"faust_r/{name}.npz"), allow_pickle=False) as arrays:
            shapes.append(Mesh(arrays["vertices"], arrays["faces"]))
    result = match(*shapes)
    wrapped = wrap(result.map, *shapes)
    assert wrapped.inverted_before > 200
    assert wrapped.inverted == 0
    np.testing.assert_array_equal(wrapped.mesh.faces, shapes[0].faces)
    np.testing.assert_array_equal(result.as_mesh(*shapes).vertices, wrapped.mesh.vertices)
