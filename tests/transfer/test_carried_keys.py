"""Laws of carried shape keys: what moves by one vector does so on the receiver, and what rests stays at rest."""

import numpy as np
import pytest

from data import real_file, tosca
from isomatch import Asset, Attribute, Correspondence, Mesh, carry_attributes, match
from isomatch.datasets import animal_head, closest_points
from isomatch.decimation import decimate
from zoo.made import moved, together

TURN = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])  # as a rotation moves columns
SPREAD = (
    6.0,
    20.0,
)  # degrees between the directions of a key that moves by one vector: median, and 95 % of the pairs
MORE_TURNED, LONGER = 0.02, 0.05  # faces turned over beyond those of the giver; mean length


def carried(images, receiver, giver, keys):
    """Displacements of a mesh by keys of another, by name."""
    giver = Asset.of_mesh(giver, [Attribute(name, "point", "key", moves) for name, moves in keys.items()])
    found = carry_attributes(images, Asset.of_mesh(receiver), giver, "keys").asset
    return {name: found.attribute(name).values for name in keys}


def truth(receiver, giver):
    """The exact map between two heads."""
    faces = giver.mesh.faces
    images = closest_points(receiver.directions, Mesh(giver.directions, faces))
    return Correspondence(images.vertices, len(giver.directions), faces[images.faces], images.barycentric)


def lengths(moves):
    return np.linalg.norm(moves, axis=1)


def spread(moves):
    """Median and 95 % quantile of the angles between displacements, in degrees."""
    size = lengths(moves)
    unit = moves[size > 0.25 * size.max()] / size[size > 0.25 * size.max(), None]
    cosines = (unit @ unit.T)[np.triu_indices(len(unit), 1)]
    return np.quantile(np.degrees(np.arccos(np.clip(cosines, -1, 1))), [0.5, 0.95])


def turned(mesh, moves):
    """Share of the faces that move which a key turns over."""
    before, after = mesh.face_cross, mesh.moved(mesh.vertices + moves).face_cross
    moving = (lengths(moves) > 0)[mesh.faces].any(axis=1)
    return (np.einsum("fi,fi->f", before, after) < 0)[moving].mean()


def require_as_good(images, receiver, giver, keys, rigid):
    """Require of keys what a face needs: directions, faces, lengths, and rest."""
    found, placed, grown = carried(images, receiver, giver, keys), images.matched, []
    for name, moves in found.items():
        interpolated = images.pull_back(keys[name])
        assert not moves[placed & ~interpolated.any(axis=1)].any(), name
        assert turned(receiver, moves) <= turned(giver, keys[name]) + MORE_TURNED, name
        grown.append(lengths(moves[placed]).sum() / lengths(interpolated[placed]).sum())
        if name in rigid:
            assert (spread(keys[name]) < 1e-3).all()
            assert (spread(moves) <= SPREAD).all(), (name, spread(moves))
    assert max(grown) <= (1 + LONGER) * min(grown)
    assert grown[0] == pytest.approx(np.sqrt(receiver.area / giver.area), rel=0.15)


@pytest.fixture(scope="module")
def cat():
    return animal_head("cat", 3000)


@pytest.fixture(scope="module")
def lion():
    return animal_head("lion", 3500, triangulation=1)


def keys_of(head):
    """Nose, jaw, smile and blink of a head."""
    x, y, z = head.directions.T
    nose = np.hypot(x, y + 0.05) < 0.2
    eye = np.clip(1 - ((np.abs(x) - 0.4) ** 2 + (y - 0.2) ** 2) / 0.03, 0, None) ** 2 * (z > 0)
    rigid = {
        "nose": np.where((nose & (z > 0))[:, None], [0.02, 0.05, 0.1], 0.0),
        "blink": eye[:, None] * [0, -0.05, 0.0],
    }
    return head.keys | rigid


@pytest.mark.parametrize("species", ["cat", "lion"])
@pytest.mark.parametrize("individual", [0, 1, 2])
def test_keys_of_a_face_on_other_faces(species, individual, cat):
    other = animal_head(species, 2500 + 500 * individual, individual=individual, triangulation=individual + 1)
    require_as_good(truth(other, cat), other.mesh, cat.mesh, keys_of(cat), ["nose", "blink"])


def test_steps_turn_no_more_faces_than_on_the_giver(cat, lion):
    """Where a few faces move, and their neighbours rest, chance decides on one face; so many keys are counted."""
    images, keys, random = truth(lion, cat), {}, np.random.default_rng(0)
    edge = cat.mesh.edge_lengths.mean()
    for vertex in random.choice(3000, 60, replace=False):
        near = lengths(cat.mesh.vertices - cat.mesh.vertices[vertex]) < 1.5 * edge
        move = cat.mesh.vertex_normals[vertex] + 0.9 * random.normal(size=3)
        keys[f"{vertex}"] = near[:, None] * (1.4 * edge * move / np.linalg.norm(move))
    found = carried(images, lion.mesh, cat.mesh, keys)
    before = np.mean([turned(cat.mesh, moves) for moves in keys.values()])
    assert before > MORE_TURNED  # steps of more than an edge turn faces of the giver
    assert np.mean([turned(lion.mesh, moves) for moves in found.values()]) <= before


@pytest.mark.parametrize("size", [1.0, 1e-3, 40.0])
def test_one_vector_becomes_one_vector(size, cat):
    """On a copy that is turned, enlarged and triangulated otherwise."""
    copy = animal_head("cat", 4000, triangulation=3)
    moved = copy.mesh.moved(size * copy.mesh.vertices @ TURN.T + size)
    key = {"step": np.tile([0.1, 0.2, 0.3], (3000, 1))}
    found = carried(truth(copy, cat), moved, cat.mesh, key)["step"]
    expected = size * np.array([0.1, 0.2, 0.3]) @ TURN.T
    assert np.abs(found - expected).max() < 0.02 * lengths(expected[None])


@pytest.mark.parametrize("n", [1500, 6000])
def test_a_head_carries_its_keys_to_itself(n):
    """Also where rotations are averaged on a coarser mesh."""
    head, order = animal_head("lion", n), np.arange(n)
    found = carried(Correspondence(order, n), head.mesh, head.mesh, keys_of(head))
    for name, moves in keys_of(head).items():
        np.testing.assert_allclose(found[name], moves, atol=1e-6)


def test_keys_grow_with_the_receiver(cat, lion):
    images, keys = truth(lion, cat), keys_of(cat)
    plain = carried(images, lion.mesh, cat.mesh, keys)
    large = carried(images, lion.mesh.moved(7 * lion.mesh.vertices), cat.mesh, keys)
    for name in keys:
        np.testing.assert_allclose(large[name], 7 * plain[name], atol=1e-9)


@pytest.fixture
def with_hole(cat, lion):
    """The map, without images around the nose."""
    images = truth(lion, cat)
    hole = np.hypot(*(lion.directions[:, :2] - [0.1, -0.05]).T) < 0.15
    hole &= lion.directions[:, 2] > 0
    return Correspondence(np.where(hole, -1, images.vertices), 3000, images.faces, images.barycentric), hole


def test_keys_are_linear(cat, lion, with_hole):
    keys = keys_of(cat)
    found = carried(
        with_hole[0], lion.mesh, cat.mesh, {"sum": 2 * keys["jaw_open"] - 3 * keys["nose"], **keys}
    )
    np.testing.assert_allclose(found["sum"], 2 * found["jaw_open"] - 3 * found["nose"], atol=1e-12)


def test_a_hole_moves_with_its_rim(cat, lion, with_hole):
    images, hole = with_hole
    rests = cat.directions[:, 2] < 0
    keys = {"all": np.tile([0, 0, 0.1], (3000, 1)), "back": np.where(rests[:, None], [0, 0.1, 0], 0)}
    found = carried(images, lion.mesh, cat.mesh, keys)
    whole = carried(truth(lion, cat), lion.mesh, cat.mesh, keys)
    assert np.abs(found["all"] - whole["all"])[hole].max() < 0.02
    assert not found["back"][hole].any()


def test_parts_without_a_counterpart_rest(cat, lion):
    """Such as teeth that the giver lacks; the head itself moves as without them."""
    images, n = truth(lion, cat), lion.mesh.n_vertices
    teeth = together(lion.mesh, moved(lion.mesh, scale=0.1))
    both = Correspondence(np.append(images.vertices, np.full(n, -1)), 3000)
    alone = Correspondence(images.vertices, 3000)
    found = carried(both, teeth, cat.mesh, cat.keys)["jaw_open"]
    assert not found[n:].any()
    np.testing.assert_allclose(
        found[:n], carried(alone, lion.mesh, cat.mesh, cat.keys)["jaw_open"], atol=1e-2
    )


def test_flat_faces_and_unused_vertices_hardly_count(cat, lion):
    images, n = truth(lion, cat), lion.mesh.n_vertices
    worse = Mesh(np.vstack([lion.mesh.vertices, [9, 9, 9]]), np.vstack([lion.mesh.faces, [0, 1, 1]]))
    found = carried(Correspondence(np.append(images.vertices, 0), 3000), worse, cat.mesh, cat.keys)
    alone = carried(Correspondence(images.vertices, 3000), lion.mesh, cat.mesh, cat.keys)
    for name in cat.keys:
        np.testing.assert_allclose(found[name][:n], alone[name], atol=1e-5)


def human_keys(x):
    """Nose, jaw, smile, blink and belly of a person who looks to z, one unit a decimetre."""
    nose = x[np.where(x[:, 1] > 6.6, x[:, 2], -np.inf).argmax()]

    def bump(middle, width, stretch=(1, 1, 1)):
        square = (((x - middle) / stretch) ** 2).sum(axis=1) / width**2
        return np.clip(1 - square, 0, None)[:, None] ** 2

    sides = [np.array([side, 1, 1]) for side in (-1, 1)]
    down, back = nose[1] - 0.28 - x[:, 1], x[:, 2] - nose[2]
    jaw = np.clip(down / 0.35, 0, 1) * np.clip((back + 0.95) / 0.5, 0, 1) * np.clip(2.3 - 2.5 * down, 0, 1)
    angle, place = 0.25, x - nose - [0, 0.05, -0.9]
    opened = (
        place @ np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]).T
    )
    navel = x[np.where(np.abs(x[:, 1] - 2) < 0.5, x[:, 2], -np.inf).argmax()]
    return {
        "nose": (lengths(x - nose) < 0.28)[:, None] * [0.05, 0.06, 0.12],
        "jaw": jaw[:, None] * (opened - place),
        "smile": sum(
            bump(nose + side * [0.27, -0.42, -0.25], 0.4) * (side * [0.07, 0.08, -0.04]) for side in sides
        ),
        "blink": sum(
            bump(nose + side * [0.33, 0.42, -0.3], 0.25, (1.2, 0.6, 1)) * [0, -0.07, 0.01] for side in sides
        ),
        "belly": bump(navel, 1.5) * [0, 0, 0.5],
    }


@pytest.mark.long
@pytest.mark.parametrize("pose", ["david0", "victoria0"])
def test_keys_of_one_person_on_another(pose):
    """The map is found, too: 13,380 vertices give, 20,000 receive."""
    with np.load(real_file("cc0_makehuman/human.npz"), allow_pickle=False) as file:
        giver = Mesh(file["human_rest"].astype(float), file["faces"])
    receiver = decimate(tosca(pose), 20_000).mesh
    require_as_good(
        match(receiver, giver).map, receiver, giver, human_keys(giver.vertices), ["nose", "blink", "belly"]
    )
