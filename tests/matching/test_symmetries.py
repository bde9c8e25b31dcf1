"""Symmetries of one shape, and what a match of symmetric shapes says."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from data import real_file
from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.matching import prepare_pair
from isomatch.matching.proposals.flips import symmetric_variants
from isomatch.settings import SearchSettings, SymmetrySettings
from isomatch.shapes.symmetries import MIN_MOVED
from isomatch_lab.procedural import creature
from isomatch_lab.sets import relabelled
from later import some_later
from shapes import box, cylinder, disguised, icosphere
from zoo import torus

pytestmark = pytest.mark.usefixtures("prepared_once")
SYMMETRIC = {
    "cube": lambda: box(10, 10, 10),
    "brick": lambda: box(8, 16, 24),
    "flat brick": lambda: box(2, 16, 16),
    "sphere": lambda: icosphere(3),
    "torus": lambda: torus(40, 17),
    "cylinder": lambda: cylinder(28, 28),
}
OTHERWISE_CUT = {
    "cube": lambda: box(12, 12, 12),
    "brick": lambda: box(10, 20, 30),
    "torus": lambda: torus(47, 20),
    "cylinder": lambda: cylinder(33, 33),
}


def dented(mesh):
    """Push one corner of a box out of place, so that nothing but the identity maps it onto itself."""
    corner = mesh.vertices.max(axis=0) * [1, 1, 0.8]
    near = np.exp(-(((mesh.vertices - corner) ** 2).sum(axis=1)) / (0.3 * mesh.vertices.max()) ** 2)
    return Mesh(mesh.vertices + 0.25 * near[:, None] * corner, mesh.faces)


def counted(shape):
    sides = [symmetry.orientation > 0 for symmetry in shape.symmetries]
    return sum(sides), len(sides) - sum(sides)


@pytest.fixture(scope="module")
def brick():
    return prepare(box(8, 16, 24))


@pytest.mark.parametrize("scale", [None, 100.0])
def test_a_brick_has_half_turns_and_mirror_images(brick, scale):
    """Three and four, whatever the numbering and the scale; the search may miss some, or find one twice."""
    other = brick if scale is None else prepare(disguised(brick.surface, seed=3, scale=scale).mesh)
    rotations, mirror_images = counted(other)
    assert 1 <= rotations <= 4
    assert 2 <= mirror_images <= 5


def test_symmetries_keep_distances_and_move_points(brick):
    distances = brick.distances_between(brick.sample_vertices[: brick.config.n_search])
    for symmetry in brick.symmetries:
        images = distances[np.ix_(symmetry.image_row, symmetry.image_row)]
        assert np.abs(images - distances).mean() < 0.08 * distances.mean(), "the spacing of the samples"
        assert symmetry.moved > MIN_MOVED


def test_twice_a_half_turn_or_a_mirror_image_is_the_identity(brick):
    rows = np.arange(brick.config.n_search)
    distances = brick.distances_between(brick.sample_vertices[: len(rows)])
    for symmetry in brick.symmetries:
        twice = symmetry.image_row[symmetry.image_row]
        assert distances[twice, rows].mean() < 0.1


@pytest.mark.long
def test_bodies_are_their_own_mirror_image_or_have_no_symmetry():
    symmetric, other = (prepare(creature(1500, symmetric=symmetric).mesh) for symmetric in (True, False))
    assert counted(symmetric) == (0, 1)
    assert counted(other) == (0, 0)


CASES = [(name, SYMMETRIC) for name in SYMMETRIC] + [(name, OTHERWISE_CUT) for name in OTHERWISE_CUT]


@pytest.mark.parametrize(("name", "others"), some_later(CASES, lambda case: case == ("cube", SYMMETRIC)))
def test_symmetric_shapes_of_the_same_and_of_other_triangles_are_ambiguous(name, others):
    found = match(SYMMETRIC[name](), disguised(others[name](), seed=1).mesh)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert all("rotation" in words for words in found.symmetries) or others is OTHERWISE_CUT


@pytest.mark.long
def test_a_ball_is_ambiguous_until_landmarks_are_given():
    """Although its triangles betray one map."""
    settings = Config(n_columns=40, rank=8, n_functions=100, n_search=300, n_refine=500, refinement="smooth")
    copy, new_vertex = relabelled(icosphere(3), 8)
    found = match(icosphere(3), copy, config=settings)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    known = np.column_stack([np.arange(0, 600, 100), new_vertex[:600:100]])
    assert match(icosphere(3), copy, landmarks=known).outcome is Outcome.CONVERGED


@pytest.mark.long
@pytest.mark.parametrize("by", ["a dent", "landmarks"])
def test_what_resolves_the_symmetry(brick, by):
    source = dented(brick.surface) if by == "a dent" else brick.surface
    target, vertices = disguised(source, seed=1), brick.column_vertices[:6]
    pairs = np.column_stack([vertices, target.new_vertex[vertices]]) if by == "landmarks" else None
    found = match(source, target.mesh, landmarks=pairs)
    assert found.outcome is Outcome.CONVERGED
    assert (found.map.vertices == target.new_vertex).mean() > 0.95


def test_without_a_search_there_are_no_symmetries():
    config = Config(symmetry=SymmetrySettings(n_assignments=0))
    pair = prepare_pair(box(8, 16, 24), box(8, 16, 24), config)
    assert not pair.target.symmetries
    assert not symmetric_variants(pair, np.arange(400))


def test_mirror_images_are_variants_only_where_either_side_is_allowed(brick):
    rows = np.arange(brick.config.n_search)
    variants = {
        orientation: symmetric_variants(
            prepare_pair(brick, brick, replace(brick.requested, orientation=orientation)), rows
        )
        for orientation in ("preserve", "any")
    }
    rotations, mirror_images = counted(brick)
    assert len(variants["preserve"]) == rotations
    assert len(variants["any"]) == rotations + mirror_images


def individual(asymmetry, longer=0.0):
    """A body with a half turn as a near-symmetry, except for one bump; longer on one side if asked."""
    sphere = icosphere(3)

    def bump(*at):
        return np.exp(-(((sphere.vertices - np.array(at) / np.linalg.norm(at)) ** 2).sum(axis=1)) / 0.35**2)

    heights = (0.9 + longer, (1, 0.2, 0.3)), (0.6 - longer / 2, (0.3, 1, -0.5))
    radius = 1 + sum(height * (bump(x, y, z) + bump(-x, -y, z)) for height, (x, y, z) in heights)
    radius += 0.5 * bump(0, 0, 1) + asymmetry * bump(1, 0.2, 0.3)
    vertices = sphere.vertices * radius[:, None] * [1, 1, 1.5]
    vertices[:, 2] *= 1 + longer * (vertices[:, 2] > 0)
    return Mesh(vertices, sphere.faces)


@pytest.mark.long
@pytest.mark.parametrize(
    ("asymmetry", "outcome"), [(0.2, Outcome.SYMMETRY_AMBIGUOUS), (0.6, Outcome.CONVERGED)]
)
def test_a_map_is_ambiguous_if_individuals_differ_more_than_the_sides_of_one(asymmetry, outcome):
    """The search keeps one map, and takes none of the symmetries for exact, so that it sees no rival."""
    search, symmetry = SearchSettings(n_hypotheses=1, flipped=0), SymmetrySettings(largest_residual=1.7)
    source, target = individual(asymmetry), disguised(individual(asymmetry, longer=0.3), seed=1)
    found = match(source, target.mesh, config=Config(search=search, symmetry=symmetry))
    assert found.outcome is outcome
    assert any("about as near to exact as the shapes are alike" in note for note in found.notes) == bool(
        found.alternatives
    )
    sphere = icosphere(3).vertices
    half_turn = cKDTree(sphere).query(sphere * [-1, -1, 1])[1]
    for map_, right in [
        (found.map, np.arange(len(sphere))),
        *((a.map, half_turn) for a in found.alternatives),
    ]:
        offset = target.mesh.vertices[map_.vertices] - target.mesh.vertices[target.new_vertex[right]]
        assert np.linalg.norm(offset, axis=1).mean() < 0.1 * np.sqrt(target.mesh.area)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "first", "second"),
    [("ant", "ant86", "ant95"), ("ant", "ant95", "ant86"), ("glasses", "glasses55", "glasses58")],
)
def test_half_turns_of_other_individuals_are_not_sure(kind, first, second):
    """Each came out as sure once, 0.38 to 1.0 √area off."""
    with np.load(real_file(f"shrec07/{kind}.npz")) as shapes:
        source, target = (Mesh(shapes[name], shapes[f"{name}_faces"]) for name in (first, second))
        landmarks = [shapes[f"{name}_landmarks"] for name in (first, second)]
    found = match(source, target)
    images = target.vertices[found.map.vertices[landmarks[0]]]
    error = np.linalg.norm(images - target.vertices[landmarks[1]], axis=1).mean() / np.sqrt(target.area)
    assert error < 0.15 or found.outcome is not Outcome.CONVERGED
