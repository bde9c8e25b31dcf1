import sys

import numpy as np
import pytest
from scipy.spatial import KDTree

from isomatch._core.errors import InputError, MissingDependencyError, SettingError
from isomatch.datasets import Creature, closest_points, example_pair, ground_truth
from isomatch.surfaces import Mesh
from isomatch_lab.procedural import creature, joint_names
from isomatch_lab.procedural.anatomy import PLANS, body
from isomatch_lab.procedural.creatures import make_example_pair
from isomatch_lab.procedural.implicit import Skin
from isomatch_lab.procedural.posing import natural_pose, pose_points

KINDS = sorted(PLANS)


@pytest.fixture(scope="module", params=KINDS)
def resting(request) -> Creature:
    return creature(2000, kind=request.param)


@pytest.fixture(scope="module", params=KINDS)
def symmetric_pair(request) -> tuple[Creature, Creature]:
    return tuple(creature(2000, kind=request.param, symmetric=True, triangulation=seed) for seed in (0, 1))


def edge_lengths(vertices, edges):
    return np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)


def smallest_angles(mesh):
    corners = mesh.vertices[mesh.faces]
    to_next, to_previous = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(to_next, to_previous), axis=2)
    return np.degrees(np.arctan2(sine, (to_next * to_previous).sum(axis=2))).min(axis=1)


def mirror_gap(made):
    """Mean distance from the mirrored rest vertices to the rest mesh, in mean edge lengths."""
    mesh = made.rest_mesh
    mirrored = made.rest * [-1, 1, 1]
    gap = np.linalg.norm(closest_points(mirrored, mesh).points(mesh) - mirrored, axis=1)
    return gap.mean() / edge_lengths(mesh.vertices, mesh.edges).mean()


def assert_sphere(mesh):
    """Closed, manifold, oriented outward, one component, genus 0."""
    half = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forward = np.unique(half[:, 0] * mesh.n_vertices + half[:, 1])
    assert len(forward) == len(half) == 2 * len(mesh.edges), (
        "each edge has two faces that run along it oppositely"
    )
    assert mesh.n_vertices - len(mesh.edges) + mesh.n_faces == 2
    assert mesh.components.max() == 0
    assert mesh.volume > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("n_vertices", "style"), [(2000, 1), pytest.param(70_000, 0, marks=pytest.mark.long)]
)
def test_mesh_is_a_sphere_of_good_triangles(kind, n_vertices, style):
    """The large one is subdivided from a coarser one."""
    made = creature(n_vertices, kind=kind, style=style, pose=style, triangulation=3)
    assert_sphere(made.mesh)
    assert abs(made.mesh.n_vertices / n_vertices - 1) < 0.05
    assert smallest_angles(made.rest_mesh).min() > 15
    assert np.percentile(smallest_angles(made.mesh), 1) > 15
    assert len(np.unique(made.mesh.vertices, axis=0)) == made.mesh.n_vertices


@pytest.mark.long
def test_vertices_lie_on_the_skin(resting):
    skin = Skin.of(body(resting.kind))
    assert np.abs(skin.field(resting.rest)[:, 0]).max() < 1e-6


def test_field_gradient_is_its_derivative(resting):
    skin = Skin.of(body(resting.kind))
    points = resting.rest[::50] + 0.02
    step = 1e-6
    for axis, shift in enumerate(step * np.eye(3)):
        slope = (skin.field(points + shift)[:, 0] - skin.field(points - shift)[:, 0]) / (2 * step)
        np.testing.assert_allclose(skin.field(points)[:, 1 + axis], slope, atol=1e-5)


def test_same_arguments_give_the_same_creature(resting):
    again = creature(2000, kind=resting.kind)
    np.testing.assert_array_equal(again.mesh.vertices, resting.mesh.vertices)
    np.testing.assert_array_equal(again.mesh.faces, resting.mesh.faces)


def test_vertex_order_reveals_nothing(resting):
    """Neighbours in order are as far apart as any two vertices."""
    apart = np.linalg.norm(np.diff(resting.rest, axis=0), axis=1).mean()
    random = resting.rest[np.random.default_rng(0).permutation(len(resting.rest))]
    assert apart == pytest.approx(np.linalg.norm(np.diff(random, axis=0), axis=1).mean(), rel=0.05)


@pytest.mark.parametrize(
    "seed", [*range(1, 4), *(pytest.param(n, marks=pytest.mark.long) for n in range(4, 13))]
)
def test_poses_are_near_isometric(resting, seed):
    limbs = body(resting.kind)
    pose = natural_pose(limbs, seed)
    edges = resting.mesh.edges
    vertices = pose_points(resting.rest, limbs, Skin.of(limbs), pose)
    ratio = edge_lengths(vertices, edges) / edge_lengths(resting.rest, edges)
    low, high = np.percentile(ratio, [5, 95])
    assert 0.85 < low < high < 1.18
    assert 0.4 < ratio.min() < 0.95 < 1.05 < ratio.max() < 2.2, "it bends the body and tears nothing"


@pytest.mark.long
def test_natural_poses_do_not_self_intersect(resting):
    """Just outside the posed surface, its winding number is 0."""
    limbs = body(resting.kind)
    for seed in (1, 2):
        vertices = pose_points(resting.rest, limbs, Skin.of(limbs), natural_pose(limbs, seed))
        mesh = Mesh(vertices, resting.mesh.faces)
        assert np.abs(winding_numbers(mesh, (vertices + 2e-3 * mesh.vertex_normals)[::15])).max() < 0.5


def winding_numbers(mesh, points):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    triple = (a * np.cross(b, c)).sum(axis=2)
    rest = la * lb * lc + (a * b).sum(axis=2) * lc + (b * c).sum(axis=2) * la + (c * a).sum(axis=2) * lb
    return np.arctan2(triple, rest).sum(axis=1) / (2 * np.pi)


@pytest.mark.long
def test_joints_turn_rigidly_beyond_the_bend():
    """A turned waist carries the head along as it is, and leaves the hind feet where they are."""
    rest = creature(1500)
    turned = creature(1500, pose={"waist": [0, 0, 20]})
    head = (rest.rest[:, 1] > 0) & (rest.rest[:, 2] > 0.95)
    hind_feet = (rest.rest[:, 1] < -0.2) & (rest.rest[:, 2] < 0.2)
    before, after = (np.linalg.norm(np.diff(x.mesh.vertices[head], axis=0), axis=1) for x in (rest, turned))
    np.testing.assert_allclose(after, before, rtol=1e-3)
    assert turned.mesh.vertices[head, 0].mean() < -0.1, "yaw turns forward to the left, which is −x"
    np.testing.assert_allclose(turned.mesh.vertices[hind_feet], rest.mesh.vertices[hind_feet], atol=1e-3)


def test_truth_to_itself_is_the_identity(resting):
    truth = ground_truth(resting, resting)
    np.testing.assert_array_equal(truth.vertices, np.arange(resting.mesh.n_vertices))
    np.testing.assert_allclose(truth.points(resting.mesh), resting.mesh.vertices, atol=1e-12)


@pytest.mark.long
def test_truth_between_triangulations_is_as_exact_as_the_triangulations():
    gaps = []
    for n_vertices in (1500, 4500):
        source, target = (creature(n_vertices, triangulation=seed) for seed in (0, 1))
        assert source.mesh.n_vertices != target.mesh.n_vertices
        assert KDTree(target.rest).query(source.rest)[0].min() > 1e-6, "the triangulations share no vertex"
        images = ground_truth(source, target).points(target.rest_mesh)
        gaps.append(np.linalg.norm(images - source.rest, axis=1).mean())
        assert gaps[-1] < 0.05 * edge_lengths(target.rest, target.mesh.edges).mean()
    assert gaps[1] < gaps[0] / 2, "second order in the edge length"


def distances_to(points, mesh):
    return np.linalg.norm(closest_points(points, mesh).points(mesh) - points, axis=1)


def test_closest_points_agree_with_trying_every_face():
    rng = np.random.default_rng(0)
    mesh = Mesh(
        rng.normal(size=(60, 3)) * [3, 1, 0.2], rng.permuted(np.tile(np.arange(60), (80, 1)), axis=1)[:, :3]
    )
    points = rng.normal(size=(200, 3))
    truth = closest_points(points, mesh)
    alone = [distances_to(points, Mesh(mesh.vertices, [face])) for face in mesh.faces]
    np.testing.assert_allclose(distances_to(points, mesh), np.min(alone, axis=0), atol=1e-12)
    np.testing.assert_allclose(truth.barycentric.sum(axis=1), 1)
    assert truth.barycentric.min() >= 0


def test_distance_to_a_triangle_is_the_least_over_a_fine_sampling():
    rng = np.random.default_rng(1)
    triangles, points = rng.normal(size=(50, 3, 3)), rng.normal(size=(50, 3)) * 2
    i, j = np.meshgrid(np.linspace(0, 1, 81), np.linspace(0, 1, 81))
    samples = np.stack([1 - i - j, i, j], axis=-1)[i + j <= 1]
    sampled = np.linalg.norm(np.einsum("si,tix->tsx", samples, triangles) - points[:, None], axis=2).min(
        axis=1
    )
    distance = [
        distances_to(point[None], Mesh(triangle, [[0, 1, 2]]))[0]
        for point, triangle in zip(points, triangles)
    ]
    assert (distance <= sampled + 1e-12).all()
    np.testing.assert_allclose(distance, sampled, atol=0.02)


@pytest.mark.long
def test_symmetric_creature_is_its_mirror_image(symmetric_pair):
    source, target = symmetric_pair
    skin = Skin.of(body(source.kind, symmetric=True))
    np.testing.assert_allclose(skin.field(source.rest * [-1, 1, 1])[:, 0], 0, atol=1e-6)
    assert mirror_gap(source) < 0.05
    truth = ground_truth(source, target, mirrored=True)
    gap = np.linalg.norm(truth.points(target.rest_mesh) - source.rest * [-1, 1, 1], axis=1)
    edge = edge_lengths(source.rest, source.mesh.edges).mean()
    assert gap.mean() < 0.05 * edge
    there_and_back = ground_truth(target, source, mirrored=True).vertices[truth.vertices]
    assert np.linalg.norm(source.rest[there_and_back] - source.rest, axis=1).max() < 2 * edge


def test_default_creature_is_not_its_mirror_image(resting):
    assert mirror_gap(resting) > 0.2


@pytest.mark.long
def test_shipped_pair_needs_no_scikit_image_and_can_be_made_again(monkeypatch):
    fresh = make_example_pair()
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    for shipped, made in zip(example_pair(), fresh):
        assert_sphere(shipped.mesh)
        assert shipped.mesh.n_vertices == pytest.approx(made.mesh.n_vertices, rel=0.02)
        assert shipped.mesh.area == pytest.approx(made.mesh.area, rel=1e-3)
        assert shipped.mesh.volume == pytest.approx(made.mesh.volume, rel=1e-3)
        np.testing.assert_allclose(
            np.ptp(shipped.mesh.vertices, axis=0), np.ptp(made.mesh.vertices, axis=0), atol=0.01
        )
    source, target = example_pair()
    images = ground_truth(source, target).points(target.rest_mesh)
    assert np.abs(images - source.rest).max() < 0.01


def test_without_scikit_image_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    with pytest.raises(MissingDependencyError, match="creatures"):
        creature(2000)


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_vertices": 100}, "n_vertices = 100 is too coarse"),
        ({"kind": "snake"}, "kind = 'snake' is no body plan; choose one of 'quadruped', 'biped'"),
        ({"pose": {"wing": [0, 0, 1]}}, "rotates 'wing', which is no joint; choose from waist"),
        ({"pose": {"head": 30}}, "pose of 'head' is 30; give three finite angles"),
        ({"pose": {"head": [0, 0, np.nan]}}, "give three finite angles"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(SettingError, match=message):
        creature(**{"n_vertices": 1500, **arguments})


@pytest.mark.long
def test_truth_needs_one_body(resting):
    with pytest.raises(InputError, match="symmetric"):
        ground_truth(resting, creature(1500, kind=resting.kind, symmetric=True))
    with pytest.raises(SettingError, match="no mirrored truth"):
        ground_truth(resting, resting, mirrored=True)


def test_joints_are_named_in_pairs():
    for kind in KINDS:
        names = joint_names(kind)
        assert len(set(names)) == len(names)
        assert {name for name in names if name.startswith("left_")} == {
            name.replace("right_", "left_") for name in names if name.startswith("right_")
        }
