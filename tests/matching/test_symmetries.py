"""Symmetries of one shape, and what a match of symmetric shapes says."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.matching import prepare_pair
from isomatch.matching.search import symmetric_variants
from isomatch.settings import SymmetrySettings
from isomatch.shapes.symmetries import LEAST_MOVED
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


def test_a_brick_has_half_turns_and_mirror_images(brick):
    """Three and four; the search may miss some, or find one twice."""
    rotations, mirror_images = counted(brick)
    assert 1 <= rotations <= 4
    assert 2 <= mirror_images <= 5


def test_symmetries_keep_distances_and_move_points(brick):
    distances = brick.distances_between(brick.sample_vertices[: brick.config.n_search])
    for symmetry in brick.symmetries:
        images = distances[np.ix_(symmetry.image_row, symmetry.image_row)]
        assert np.abs(images - distances).mean() < 0.08 * distances.mean(), "the spacing of the samples"
        assert symmetry.moved > LEAST_MOVED


def test_twice_a_half_turn_or_a_mirror_image_is_the_identity(brick):
    rows = np.arange(brick.config.n_search)
    distances = brick.distances_between(brick.sample_vertices[: len(rows)])
    for symmetry in brick.symmetries:
        twice = symmetry.image_row[symmetry.image_row]
        assert distances[twice, rows].mean() < 0.1


def test_symmetries_depend_neither_on_numbering_nor_on_scale(brick):
    other = prepare(disguised(box(8, 16, 24), seed=3, scale=100.0).mesh)
    rotations, mirror_images = counted(other)
    assert 1 <= rotations <= 4
    assert 2 <= mirror_images <= 5


@pytest.mark.long
def test_bodies_are_their_own_mirror_image_or_have_no_symmetry():
    symmetric, other = (prepare(creature(1500, symmetric=symmetric).mesh) for symmetric in (True, False))
    assert counted(symmetric) == (0, 1)
    assert counted(other) == (0, 0)


@pytest.mark.parametrize("name", some_later(SYMMETRIC, lambda name: name == "cube"))
def test_copies_of_symmetric_shapes_are_ambiguous(name):
    mesh = SYMMETRIC[name]()
    found = match(mesh, disguised(mesh, seed=1).mesh)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert all("rotation" in each for each in found.symmetries)


@pytest.mark.long
@pytest.mark.parametrize("name", OTHERWISE_CUT)
def test_symmetric_shapes_of_other_triangles_are_ambiguous(name):
    found = match(SYMMETRIC[name](), disguised(OTHERWISE_CUT[name](), seed=2).mesh)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS


@pytest.mark.long
def test_a_ball_is_ambiguous_however_well_a_map_fits():
    """Its triangles betray one map, beside which coarse settings find no other."""
    settings = Config(n_columns=40, rank=8, n_functions=100, n_search=300, n_refine=500, refinement="smooth")
    copy, new_vertex = relabelled(icosphere(3), 8)
    found = match(icosphere(3), copy, config=settings)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert found.quality.runner_up > settings.outcome.tie
    known = np.column_stack([np.arange(0, 600, 100), new_vertex[:600:100]])
    assert match(icosphere(3), copy, landmarks=known).outcome is Outcome.CONVERGED


@pytest.mark.long
def test_a_dent_resolves_the_symmetry():
    target = disguised(dented(box(8, 16, 24)), seed=1)
    found = match(dented(box(8, 16, 24)), target.mesh)
    assert found.outcome is Outcome.CONVERGED
    assert (found.map.vertices == target.new_vertex).mean() > 0.95


@pytest.mark.long
def test_landmarks_resolve_the_symmetry(brick):
    target = disguised(box(8, 16, 24), seed=1)
    vertices = brick.column_vertices[:6]
    found = match(brick, target.mesh, landmarks=np.column_stack([vertices, target.new_vertex[vertices]]))
    assert found.outcome is Outcome.CONVERGED
    assert (found.map.vertices == target.new_vertex).mean() > 0.95


def test_without_a_search_there_are_no_symmetries():
    config = Config(symmetry=SymmetrySettings(most=0))
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
