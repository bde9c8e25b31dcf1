"""Individuals of one kind, made of round cones: half turns are told, arms alike counted, and joints bend as they do."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch import Outcome, Verification, match
from isomatch._core.arrays import BodyVertices
from isomatch.correspondence import SurfaceIndex, VertexCells
from isomatch.matching import Isometry, prepare_pair
from isomatch.matching.bending import BentShape, Surroundings
from isomatch.matching.isometric.candidates import Screening, extend_map
from isomatch.matching.maps import Candidate
from isomatch.matching.problem import target_rows_near
from isomatch.matching.proposals.flips import mirrored_variants
from isomatch_lab.procedural.implicit import Skin
from isomatch_lab.procedural.tessellation import tessellate
from shapes import disguised, flat_grid
from zoo.made import moved

pytestmark = pytest.mark.usefixtures("prepared_once")
N_VERTICES = 5000


def individual(bones, seed, marks):
    """Tessellate chains of round cones, (points, radii) each; the mesh, and the vertices nearest to some marks."""
    cones = np.array(
        [
            [*a, *b, r, s]
            for points, radii in bones
            for a, b, r, s in zip(points, points[1:], radii, radii[1:])
        ]
    )
    skin = Skin(cones, np.arange(len(cones)), 0.02)
    mesh = tessellate(skin, N_VERTICES, seed)
    on_skin = skin.project(np.array(marks), 30)
    return mesh, np.array([np.linalg.norm(mesh.vertices - mark, axis=1).argmin() for mark in on_skin])


def pliers(seed):
    """Two levers across each other; marked are both handles and jaws of either side."""
    rng = np.random.default_rng(seed)
    half, length, jaw, width, bow = (
        rng.uniform(*x) for x in ((0.12, 0.3), (0.9, 1.3), (0.3, 0.5), (0.05, 0.08), (0, 0.25))
    )
    bones, marks = [], []
    for side in (1, -1):
        turn = Rotation.from_rotvec([0, 0, side * half]).as_matrix().T
        handle = [[0, 0, side * 0.03], [side * 0.1, -0.3 * length, side * 0.03]]
        handle += [[side * (0.1 + bow), -0.7 * length, side * 0.02], [side * 0.12, -length, 0]]
        handle, jaws = (
            np.array(handle) @ turn,
            np.array([[0, 0, side * 0.03], [-side * 0.09, jaw / 2, 0], [-side * 0.03, jaw, 0]]) @ turn,
        )
        bones += [(handle, width * np.array([1.4, 1, 1, 0.9])), (jaws, width * np.array([1.4, 1.1, 0.6]))]
        marks += [
            handle[-1] - [0, width, 0],
            jaws[-1] + [0, width, 0],
            jaws[1] + [0, 0, width],
            jaws[1] - [0, 0, width],
        ]
    return individual(bones, seed, marks)


def octopus(seed):
    """A head on eight arms alike; marked are their tips."""
    rng = np.random.default_rng(seed)
    height, radius, length = (rng.uniform(*x) for x in ((0.25, 0.4), (0.2, 0.28), (0.8, 1.2)))
    bones, marks = [([[0, 0, 0], [0, 0, height]], [0.18, radius])], []
    for angle in np.arange(8) * np.pi / 4:
        out, aside = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        points, way = [0.1 * out - [0, 0, 0.05], 0.35 * out - [0, 0, 0.1]], out
        bend, rise, length_of_leg = (
            rng.uniform(-0.15, 0.15),
            rng.uniform(-0.15, 0.06),
            length * rng.uniform(0.95, 1.05),
        )
        for _ in range(4):
            way = way + bend * aside + [0, 0, rise]
            way = way / np.linalg.norm(way)
            points.append(points[-1] + length_of_leg / 4 * way)
        bones.append((points, [0.1, 0.08, 0.07, 0.06, 0.045, 0.03]))
        marks.append(points[-1] + 0.03 * way)
    return individual(bones, seed, marks)


def insect(seed, bends):
    """A body of three segments on six legs, which rise by ``bends`` from piece to piece; marked are their tips."""
    rng = np.random.default_rng(seed)
    bones = [
        ([[-0.9, 0, 0], [-0.35, 0, 0]], [rng.uniform(0.2, 0.24), 0.14]),
        ([[-0.25, 0, 0], [0.25, 0, 0]], [0.1, 0.1]),
        ([[0.25, 0, 0], [0.5, 0, 0]], [0.07, rng.uniform(0.16, 0.2)]),
    ]
    marks = []
    for side in (1, -1):
        for x, forward in ((-0.2, -0.5), (0.02, 0.0), (0.24, 0.5)):
            points, way = [np.array([x, 0.06 * side, 0.0])], np.array([forward, side, 0.0])
            for bend in bends:
                points.append(points[-1] + 0.22 * way / np.linalg.norm(way))
                way = way / np.linalg.norm(way) + [0, 0, bend]
            bones.append((points, [0.05, 0.045, 0.04, 0.035, 0.03]))
            marks.append(points[-1])
    return individual(bones, seed, marks)


def off(image, marks, truth, target):
    """Mean distance between images of marks and where they belong, in √area."""
    offset = target.vertices[image[marks]] - target.vertices[truth]
    return np.linalg.norm(offset, axis=1).mean() / np.sqrt(target.area)


@pytest.mark.long
@pytest.mark.parametrize(("first", "second"), [(0, 2), (2, 3)])
def test_a_half_turn_of_pliers_is_told_and_offered(first, second):
    """Half a turn about the long axis keeps the orientation, and fits as well as the right map."""
    (source, marks), (target, truth) = pliers(first), pliers(second)
    copy = disguised(target, second)
    found = match(source, copy.mesh)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    maps = [found.map, *(other.map for other in found.alternatives)]
    assert min(off(map_.vertices, marks, copy.new_vertex[truth], copy.mesh) for map_ in maps) < 0.05


@pytest.mark.long
def test_a_mirror_image_that_is_turned_over_is_a_half_turn():
    """Left and right are exchanged, and so are back and belly: the orientation is kept."""
    (source, marks), (target, _) = insect(1, (0, -0.2, -0.3, -0.3)), insect(2, (0.5, 0.1, -0.5, -0.8))
    pair = prepare_pair(source, target)
    image = pair.target.body_vertex[match(source, target).map.vertices[pair.source.user_vertex]]
    rows = target_rows_near(pair, image[pair.source_vertices])
    screen = Screening(pair)
    (winner,) = screen([Candidate.of_rows(rows, "found")])
    (mirrored,) = screen(mirrored_variants(pair, winner.target_row))
    (turned,) = screen(Isometry(pair)._half_turns(winner))
    assert winner.orientation > 0.5
    assert mirrored.orientation < -0.5
    assert turned.orientation > 0.5
    found, exchanged = (extend_map(pair, c.target_row, BodyVertices(marks)) for c in (winner, turned))
    assert pair.target.mean_distance(exchanged, np.roll(found, 3)) < 0.1
    assert pair.target.mean_distance(exchanged, found) > 0.5


@pytest.mark.long
def test_arms_alike_are_counted():
    (source, marks), (target, truth) = octopus(0), octopus(3)
    found = match(source, target)
    assert found.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert all("7 rotations" in words for words in found.symmetries)
    turns = [off(found.map.vertices, marks, np.roll(truth, k), target) for k in range(8)]
    assert min(turns) < 0.06  # one of the eight is right


def bent(rest, vertices):
    """A mesh that was bent, onto itself."""
    moved = rest.moved(vertices)
    index = SurfaceIndex(moved.faces, VertexCells.of(np.array([0]), np.zeros(len(vertices), dtype=int)))
    return BentShape(rest, moved, Surroundings(moved, index))


def test_a_motion_turns_nothing():
    rest = moved(flat_grid(12, 40), scale=0.05)
    turned = rest.vertices @ Rotation.from_rotvec([0.3, 1.0, -2.0]).as_matrix().T + [1, 2, 3]
    assert bent(rest, turned).turning < 1e-6


@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_a_rolled_strip_turns_by_its_curvature(radius):
    """Along the strip rotations differ by length / radius, across it not at all."""
    rest = moved(flat_grid(12, 40), scale=0.05)
    x, y, _ = rest.vertices.T
    rolled = np.column_stack([radius * np.sin(x / radius), y, radius * (1 - np.cos(x / radius))])
    i, j = rest.edges.T
    expected = np.abs(x[i] - x[j]).mean() / radius
    assert bent(rest, rolled).turning == pytest.approx(expected, rel=0.08)


def test_sixteen_times_the_turning_costs_twice_as_much():
    found = Verification(1.0, 0.3, 4e-4, 9e-4, 0.1, 1.0, 0.2)
    assert found.cost == pytest.approx(6e-4 * np.exp(6 * 0.3))
    assert replace(found, turning=1.6).cost == pytest.approx(2 * found.cost)
