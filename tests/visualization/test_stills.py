"""Pictures: size, and that what corresponds has one colour."""

import io

import matplotlib.image
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch._core.errors import MeshError
from isomatch.correspondence import Correspondence
from isomatch.datasets import example_pair, ground_truth
from isomatch.surfaces import Mesh
from isomatch.visualization import ValuePanel, draw_map, position_colours
from isomatch.visualization.camera import camera_of, turn_to_target
from shapes import icosphere

WIDTH = 400
BALL = icosphere(2)


@pytest.fixture(scope="module")
def pair():
    source, target = example_pair()
    truth = Correspondence(ground_truth(source, target).vertices, target.mesh.n_vertices)
    return source.mesh, target.mesh, truth


def drawn(path, *args, **options):
    draw_map(*args, path, width=WIDTH, **options)
    return matplotlib.image.imread(path)[..., :3]


def test_a_picture_has_the_size_asked_for_and_shows_two_shapes(tmp_path, pair):
    image = drawn(tmp_path / "map.png", *pair)
    assert image.shape[1] == WIDTH
    inked = (image < 0.98).any(axis=2)
    left, right = inked[:, : WIDTH // 2].mean(), inked[:, WIDTH // 2 :].mean()
    assert left == pytest.approx(right, rel=0.3)
    assert left > 0.1
    border = np.concatenate([inked[:3].ravel(), inked[:, :3].ravel(), inked[:, -3:].ravel()])
    assert not border.any()


def test_identical_shapes_under_the_identity_look_identical(tmp_path, pair):
    mesh = pair[0]
    identity = Correspondence(np.arange(mesh.n_vertices), mesh.n_vertices)
    image = drawn(tmp_path / "map.png", mesh, mesh, identity, titles=("", ""))
    columns = np.flatnonzero((image < 0.98).any(axis=(0, 2)))
    gap = np.flatnonzero(np.diff(columns) > 5)
    assert len(gap) == 1
    first, second = columns[: gap[0] + 1], columns[gap[0] + 1 :]
    assert len(first) == len(second)
    np.testing.assert_allclose(image[:, first], image[:, second], atol=1e-6)


def test_the_true_map_pulls_back_nearly_the_own_colours_of_corresponding_places(pair):
    source, target, truth = pair
    colours = truth.pull_back(position_colours(target))
    edge_contrast = np.abs(np.diff(colours[source.edges], axis=1)).mean()
    shuffled = np.random.default_rng(0).permutation(colours)
    assert edge_contrast < 0.1 * np.abs(np.diff(shuffled[source.edges], axis=1)).mean()


def test_unmatched_parts_are_grey(tmp_path, pair):
    source, target, _ = pair
    nothing = Correspondence(np.full(source.n_vertices, -1), target.n_vertices)
    image = drawn(tmp_path / "map.png", source, target, nothing, titles=("", ""))
    saturation = image.max(axis=2) - image.min(axis=2)
    half = WIDTH // 2 - 10
    assert saturation[:, :half].max() < 0.01
    assert saturation[:, -half:].max() > 0.2


def test_a_panel_of_values_adds_a_shape_and_a_scale(tmp_path, pair):
    source = pair[0]
    values = np.where(np.arange(source.n_vertices) % 7, source.vertices[:, 2], np.nan)
    image = drawn(tmp_path / "map.png", *pair, values=ValuePanel(values, "height, mesh units"))
    assert image.shape[1] == WIDTH
    assert ValuePanel([0.0, np.nan], "nothing").scale().vmax > 0


def test_colours_separate_the_ends_of_every_axis(pair):
    target = pair[1]
    colours = position_colours(target)
    assert colours.min() >= 0
    assert colours.max() <= 1
    for axis in range(3):
        low, high = target.vertices[:, axis].argmin(), target.vertices[:, axis].argmax()
        assert np.abs(colours[low] - colours[high]).max() > 0.1


def test_a_stray_vertex_changes_no_colour(pair):
    mesh = pair[1]
    strayed = Mesh(np.vstack([mesh.vertices, [[1e6, 0, 0]]]), mesh.faces)
    np.testing.assert_allclose(position_colours(strayed)[:-1], position_colours(mesh), atol=1e-9)


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_camera_finds_which_axis_is_up(pair, up):
    source = pair[0]
    vertices = source.vertices if up == "z" else source.vertices[:, [1, 2, 0]]
    camera = camera_of(Mesh(vertices, source.faces))
    np.testing.assert_allclose(camera @ camera.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(camera) == pytest.approx(1)
    assert camera[1]["xyz".index(up)] > 0.9


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_long_animal_stands_on_its_legs(pair, up):
    animal = pair[0].vertices * [1, 2, 1]
    camera = camera_of(Mesh(animal if up == "z" else animal[:, [1, 2, 0]], pair[0].faces))
    assert camera[1]["xyz".index(up)] > 0.9


@pytest.mark.parametrize("up", [1, 2])
def test_the_floor_of_a_file_tells_what_is_up(up):
    ball = BALL.vertices * [1, 3, 2] + [0, 7, 8]
    ball[:, up] -= ball[:, up].min()
    assert camera_of(Mesh(ball, BALL.faces))[1, up] > 0.9


def test_a_sheet_is_seen_from_above():
    square = Mesh([[0, 0, 0], [2, 0, 0], [2, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    camera = camera_of(square)
    np.testing.assert_allclose(np.abs(camera[2]), [0, 1, 0], atol=1e-9)
    assert np.linalg.det(camera) == pytest.approx(1)


def test_a_partner_that_was_turned_over_is_turned_back(pair):
    source = pair[0]
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    target = Mesh(source.vertices @ turn.T, source.faces)
    identity = Correspondence(np.arange(source.n_vertices), source.n_vertices)
    np.testing.assert_allclose(turn_to_target(source, target, identity), turn, atol=1e-9)
    np.testing.assert_allclose(turn_to_target(source, source, identity), np.eye(3), atol=1e-9)


@pytest.mark.parametrize("degrees", [20, 60, 85])
def test_a_scan_in_any_pose_is_turned_fully_if_asked(pair, degrees):
    source = pair[0]
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array([2, -1, 2]) / 3).as_matrix()
    target = Mesh(source.vertices @ turn.T, source.faces)
    identity = Correspondence(np.arange(source.n_vertices), source.n_vertices)
    np.testing.assert_allclose(turn_to_target(source, target, identity, upright=False), turn, atol=1e-9)
    if degrees < 65:
        np.testing.assert_array_equal(turn_to_target(source, target, identity), np.eye(3))


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("far", [1e6, 1e12, 1e30])
def test_a_vertex_that_is_far_away_leaves_a_picture(tmp_path, side, far):
    shapes = [BALL, BALL]
    shapes[side] = BALL.moved(np.where(np.arange(BALL.n_vertices)[:, None] == 7, far, BALL.vertices))
    identity = Correspondence(np.arange(BALL.n_vertices), BALL.n_vertices)
    assert drawn(tmp_path / "map.png", *shapes, identity).shape[1] == WIDTH


@pytest.mark.parametrize("far", [1e150, 1e200])
def test_a_shape_without_area_beside_its_largest_coordinate_is_named(far):
    flat = BALL.moved(np.where(np.arange(BALL.n_vertices)[:, None] == 7, far, BALL.vertices))
    identity = Correspondence(np.arange(BALL.n_vertices), BALL.n_vertices)
    with pytest.raises(MeshError, match="drawn"):
        draw_map(flat, BALL, identity, io.BytesIO())


@pytest.mark.parametrize(
    ("label", "highest", "width"),
    [
        ("", 1.0, 400),
        ("cost, $ and $", 25.0, 400),
        ("geodesic error × 100 / √area", 25.0, 400),
        ("geodesic error × 100 / √area", 25.0, 1200),
        ("geodesic error of the image of each vertex, × 100 / √(area of the whole target)", 25e-5, 700),
    ],
)
def test_the_colour_bar_with_its_label_is_in_the_picture(pair, label, highest, width):
    source, target, found = pair
    values = ValuePanel(np.linspace(0, highest, source.n_vertices), label, highest=highest)
    picture = draw_map(source, target, found, values=values, width=width)
    *panels, bar = picture.axes
    box, whole = bar.get_tightbbox(), picture.bbox
    assert bar.get_ylabel().split() == label.split()
    assert min(box.x0 - panels[-1].bbox.x1, box.y0, whole.x1 - box.x1, whole.y1 - box.y1) > 0
