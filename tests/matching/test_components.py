"""Shapes of several components: partners, one map of all, and an honest outcome."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from isomatch import Config, LandmarkError, Mesh, NotConvergedError, Outcome, match, prepare
from isomatch.datasets import ground_truth
from isomatch.matching import Isometry, Problem
from isomatch.matching.components import Carrier
from isomatch.shapes import components_of
from isomatch_lab.procedural import creature
from shapes import box, disguised, flat_grid, icosphere, two_spheres
from zoo.made import together

pytestmark = pytest.mark.usefixtures("prepared_once")
BALL = icosphere(2)
HAT = icosphere(3).submesh(icosphere(3).vertices[:, 2] > -0.1)[0]
EYE = 0.022  # radius
EYES = {"left": (-0.08, 0.8, 1.01), "right": (0.08, 0.8, 1.01)}  # in the rest pose
HEAD = (0.0, 0.85, 1.04)


def moved_with(made, points):
    """Carry points beside the rest pose of a creature rigidly with its skin near their centre."""
    near = cKDTree(made.rest).query(points.mean(axis=0), 60)[1]
    rest, moved = made.rest[near], made.mesh.vertices[near]
    turn, _ = Rotation.align_vectors(moved - moved.mean(axis=0), rest - rest.mean(axis=0))
    return (points - rest.mean(axis=0)) @ turn.as_matrix().T + moved.mean(axis=0)


@dataclass
class Dressed:
    """A creature that wears some things, as one mesh."""

    made: object
    things: dict

    @classmethod
    def of(cls, made, *names, seed=0):
        """Eyes and a hat on the head in the rest pose; each seed turns the triangulations of the eyes."""
        ball = EYE * BALL.vertices @ Rotation.random(random_state=seed).as_matrix()
        things = {side: Mesh(ball + place, BALL.faces) for side, place in EYES.items()}
        hat = HAT.vertices * [0.07, 0.10, 0.06]
        hat[:, 2] += 0.3 * np.maximum(hat[:, 1], 0)  # its front is higher
        things["hat"] = Mesh(hat + HEAD, HAT.faces)
        return cls(made, {name: things[name] for name in names})

    @property
    def mesh(self):
        worn = [Mesh(moved_with(self.made, thing.vertices), thing.faces) for thing in self.things.values()]
        return together(self.made.mesh, *worn)

    def rows(self, name):
        """Vertices of one of the things."""
        start = self.made.mesh.n_vertices
        for other, thing in self.things.items():
            if other == name:
                return np.arange(start, start + thing.n_vertices)
            start += thing.n_vertices
        raise KeyError(name)


@pytest.fixture(scope="module")
def creatures():
    return [creature(2000, triangulation=i, pose=i) for i in (1, 2)]


@pytest.fixture(scope="module")
def found(creatures):
    """A creature with two eyes and a hat, matched to itself in another pose, in disguise."""
    source, target = (
        Dressed.of(made, *names, seed=seed)
        for seed, (made, names) in enumerate(
            zip(creatures, (("left", "right", "hat"), ("hat", "right", "left")))
        )
    )
    hidden = disguised(target.mesh, 5, scale=3.0)
    return source, target, hidden, match(source.mesh, hidden.mesh)


def error(found, name):
    """Distances between the images of a thing's vertices and where they belong / √area of the target."""
    source, target, hidden, result = found
    rows = source.rows(name)
    belongs = moved_with(target.made, source.things[name].vertices)
    back = np.argsort(hidden.new_vertex)
    images = target.mesh.vertices[back[result.map.vertices[rows]]]
    return np.linalg.norm(images - belongs, axis=1) / np.sqrt(target.made.mesh.area)


def test_every_component_is_matched_to_its_partner(found):
    source, target, hidden, result = found
    assert result.outcome is Outcome.CONVERGED
    assert result.map.matched.all()
    assert result.quality.matched == 1
    assert result.quality.coverage == pytest.approx(1, abs=0.01)
    for name in ("left", "right", "hat"):
        images = result.map.vertices[source.rows(name)]
        assert np.isin(images, hidden.new_vertex[target.rows(name)]).all()


def test_what_symmetry_leaves_open_is_decided_by_the_place(found):
    """A ball may turn by itself, but a head tells where an eye looks to."""
    for name in ("left", "right"):
        assert error(found, name).mean() < 0.2 * EYE
    assert error(found, "hat").mean() < 0.01
    assert sum("it moves along rigidly" in note for note in found[3].notes) >= 2


@pytest.mark.long
def test_components_without_partner_are_named(creatures):
    source, target = Dressed.of(creatures[0], "left", "hat"), Dressed.of(creatures[1], "right")
    result = match(source.mesh, target.mesh)
    vertices = result.map.vertices
    assert (vertices[: creatures[0].mesh.n_vertices] >= 0).all()
    for name in ("left", "hat"):
        assert (vertices[source.rows(name)] == -1).all()
        size = f"({source.things[name].n_vertices} vertices"
        assert any(
            note.startswith("source") and size in note and "no partner" in note for note in result.notes
        )
    assert any(note.startswith("target") and "no partner" in note for note in result.notes)
    assert not any("smaller components" in note for note in result.notes)
    assert result.outcome is Outcome.PARTIAL


def trousers(made):
    """Cloth over the hind half of a creature, on its mesh; and the vertex of the creature below each of its."""
    cloth, below = made.mesh.submesh(made.rest[:, 1] < 0.1)
    vertices = cloth.vertices + 0.01 * made.mesh.vertex_normals[below]
    return together(made.mesh, Mesh(vertices, cloth.faces)), below


@pytest.mark.long
def test_clothes_bend(creatures):
    (one, below), (other, below_other) = map(trousers, creatures)
    n, m = (made.mesh.n_vertices for made in creatures)
    result = match(one, other)
    images = result.map.vertices[n:] - m
    assert result.outcome is Outcome.CONVERGED
    assert (images >= 0).all()
    target = creatures[1].mesh
    truth = target.vertices[ground_truth(*creatures).vertices[below]]
    distance = np.linalg.norm(target.vertices[below_other[images]] - truth, axis=1)
    assert distance.mean() < 0.02 * np.sqrt(target.area)


@pytest.mark.long
@pytest.mark.parametrize(("height", "outcome"), [(1.0, "CONVERGED"), (2.7, "SYMMETRY_AMBIGUOUS")])
def test_a_large_ball_is_sure_only_where_it_is_held(creatures, height, outcome):
    turns = Rotation.random(2, 0).as_matrix()
    balls = [Mesh(0.3 * BALL.vertices @ turn + np.array([0, 0, height]), BALL.faces) for turn in turns]
    result = match(*(together(made.mesh, ball) for made, ball in zip(creatures, balls)))
    assert result.map.matched.all()
    assert result.outcome.name == outcome


@pytest.mark.long
def test_a_thing_that_is_another_is_no_sure_match(creatures):
    """A bar where the other shape has a sheet of as much area, larger than a hand: the outcome tells."""
    sheet = flat_grid(30, 30)
    bar = box(4, 4, 60)
    things = [placed(mesh, 0.6 / np.sqrt(mesh.area), (0, 0, 1.5)) for mesh in (sheet, bar)]
    result = match(*(together(made.mesh, thing) for made, thing in zip(creatures, things)))
    matched = result.map.vertices[creatures[0].mesh.n_vertices :] >= 0
    assert matched.any()
    assert result.outcome is Outcome.LOW_CONFIDENCE


def halves(made):
    """Left and right half of a creature, in its mesh, not joined; and the vertex of the whole of each of theirs."""
    x = made.rest[made.mesh.faces].mean(axis=1)[:, 0]
    parts, originals = [], []
    for side in (x < 0, x >= 0):
        used, faces = np.unique(made.mesh.faces[side], return_inverse=True)
        shift = [0.3 * (len(parts) - 0.5), 0, 0]
        parts.append(Mesh(made.mesh.vertices[used] + shift, faces.reshape(-1, 3)))
        originals.append(used)
    return together(*parts), np.concatenate(originals), np.repeat([0, 1], [len(part) for part in originals])


@pytest.mark.long
@pytest.mark.parametrize("symmetric", [False, True])
def test_hemispheres_are_not_exchanged(symmetric):
    source, target = (creature(2000, triangulation=i, pose=i, symmetric=symmetric) for i in (1, 2))
    (one, original, half), (other, original_other, half_other) = halves(source), halves(target)
    hidden = disguised(other, 3)
    result = match(one, hidden.mesh)
    back = np.argsort(hidden.new_vertex)[result.map.vertices]
    assert result.outcome is Outcome.CONVERGED
    np.testing.assert_array_equal(half_other[back], half)
    truth = target.mesh.vertices[ground_truth(source, target).vertices[original]]
    distance = np.linalg.norm(target.mesh.vertices[original_other[back]] - truth, axis=1)
    assert distance.mean() < 0.02 * np.sqrt(target.mesh.area)


def placed(mesh, size, at):
    return Mesh(size * (mesh.vertices - mesh.vertices.mean(axis=0)) + at, mesh.faces)


@pytest.mark.long
def test_boxes_beside_a_body(creatures):
    """Boxes of different size go to their like, wherever they stand in the file."""
    pairs = []
    for made, order in zip(creatures, (1, -1)):
        back = made.rest[np.argmax(made.rest[:, 2] - 9 * np.abs(made.rest[:, 1]))]
        boxes = [
            placed(box(6, 3, 2), size, np.add(back, (0, y, 0.1))) for size, y in ((0.02, 0.1), (0.026, -0.1))
        ]
        worn = [Mesh(moved_with(made, box.vertices), box.faces) for box in boxes]
        pairs.append(together(*[made.mesh, *worn][::order]))
    n = box(6, 3, 2).n_vertices
    result = match(*pairs)
    assert result.map.matched.all()
    np.testing.assert_array_equal(result.map.vertices[-2 * n : -n] // n, 1)
    np.testing.assert_array_equal(result.map.vertices[-n:] // n, 0)


@pytest.mark.long
def test_nothing_tells_two_equal_balls_apart():
    balls = together(placed(BALL, 1, (0, 0, 0)), placed(BALL, 1, (3, 0, 0)))
    result = match(balls, disguised(balls, 1).mesh)
    assert result.outcome.value in ("low confidence", "symmetry ambiguous")
    assert any("may as well be exchanged" in note for note in result.notes)


@pytest.mark.long
def test_landmarks_join_components(creatures):
    """Landmarks on an eye make it the partner of the other eye, which place alone would not."""
    source, target = Dressed.of(creatures[0], "left"), Dressed.of(creatures[1], "right")
    pairs = np.column_stack([source.rows("left")[:4], target.rows("right")[:4]])
    body = prepare(creatures[0].mesh).column_vertices[:5]
    truth = ground_truth(*creatures).vertices
    both = np.vstack([pairs, np.column_stack([body, truth[body]])])
    result = match(source.mesh, target.mesh, landmarks=both)
    assert np.isin(result.map.vertices[source.rows("left")], target.rows("right")).all()
    assert not any("left out" in note for note in result.notes)
    with pytest.raises(LandmarkError, match="at least 3"):
        match(source.mesh, target.mesh, landmarks=np.vstack([both[:2], both[-1:]]))


def test_one_component_has_no_others(creatures):
    shape = prepare(creatures[0].mesh)
    assert shape.others == ()
    assert shape.share == pytest.approx(1)


@pytest.mark.long
def test_prepared_components_are_kept(found):
    shape = prepare(found[0].mesh)
    assert [len(component.user_vertex) for component in components_of(shape)[1:]] == [
        thing.n_vertices for thing in (HAT, BALL, BALL)
    ]
    assert components_of(shape) is components_of(shape)
    assert sum(component.share for component in components_of(shape)) == pytest.approx(1)
    for component in components_of(shape):
        np.testing.assert_array_equal(
            component.body_vertex[component.user_vertex], np.arange(component.body.n_vertices)
        )
    only = prepare(found[0].mesh, Config.from_dict({"preparation": {"most_components": 0}}))
    assert len(components_of(only)) == 1


@pytest.mark.long
def test_a_rigid_motion_is_carried_exactly(creatures):
    """Beside a body that moves rigidly and grows, everything does."""
    dressed = Dressed.of(creatures[0], "hat").mesh
    turn = Rotation.random(random_state=1)
    source = prepare(dressed)
    target = prepare(Mesh(2 * dressed.vertices @ turn.as_matrix().T + 1, dressed.faces))
    main = Problem(components_of(source)[0], components_of(target)[0], source.config)
    result = match(main.source, main.target)
    carrier = Carrier.of([SimpleNamespace(pair=main, map=result.map, quality=result.quality)])
    hats = components_of(source)[1], components_of(target)[1]
    assert carrier.length_ratio(*hats) == pytest.approx(1, abs=0.01)
    assert carrier.offset(carrier.move(hats[0]).mean(axis=0), hats[1]) < 0.01


class OfLargeOnes(Isometry):
    """A relation that finds no map of small components."""

    def propose(self, timer):
        if self.source.share < 0.5:
            raise NotConvergedError("none was found")
        return super().propose(timer)


@pytest.mark.long
def test_components_without_a_map_are_noted():
    ball = two_spheres(2, 0.4)
    flat = ball.vertices * np.where(ball.components[:, None] == ball.components[-1], [1.0, 1.0, 0.5], 1.0)
    found = match(ball, Mesh(flat, ball.faces), relation=OfLargeOnes)
    assert any("was not matched to the component" in n and "none was found" in n for n in found.notes)
