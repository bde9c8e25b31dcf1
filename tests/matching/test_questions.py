"""Questions: the points whose image decides between the maps that a match was left with."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Correspondence, Mesh, Question, questions
from shapes import icosphere

SPHERE = icosphere(3)
BODY = Mesh(SPHERE.vertices * [1.0, 2.0, 0.6], SPHERE.faces)
N, SIZE = BODY.n_vertices, np.sqrt(BODY.area)


def turned(signs, where=None):
    """Map a part of the body to where a turn by signs sends it, and leave the rest."""
    from scipy.spatial import KDTree

    image = KDTree(BODY.vertices).query(BODY.vertices * signs)[1]
    return image if where is None else np.where(where, image, np.arange(N))


def left_with(*images):
    """Make as much of a result as is looked at."""
    maps = [Correspondence(image, N) for image in images]
    return SimpleNamespace(map=maps[0], alternatives=[SimpleNamespace(map=other) for other in maps[1:]])


IDENTITY = np.arange(N)
FLIPS = [turned(signs) for signs in ([-1, 1, -1], [1, -1, -1], [-1, -1, 1])]


def test_with_one_map_there_is_nothing_to_ask():
    assert questions(BODY, BODY, left_with(IDENTITY)) == ()
    assert questions(BODY, BODY, left_with(IDENTITY, IDENTITY)) == ()


def test_it_asks_where_maps_differ_and_for_their_places():
    cap = BODY.vertices[:, 1] > 1.2
    other = turned([-1, 1, -1], cap)
    asked = questions(BODY, BODY, left_with(IDENTITY, other))
    assert asked
    for question in asked:
        assert cap[question.vertex]
        assert question.places == (question.vertex, other[question.vertex])
        assert question.maps == (0, 1)


@pytest.mark.parametrize("right", range(4))
def test_answers_by_any_of_four_maps_leave_that_one(right):
    maps = [IDENTITY, *FLIPS]
    asked = questions(BODY, BODY, left_with(*maps))
    assert len(asked) == 3
    left = [
        k for k, map_ in enumerate(maps) if all(near(map_[q.vertex], maps[right][q.vertex]) for q in asked)
    ]
    assert left == [right]
    vertices = BODY.vertices[[question.vertex for question in asked]]
    assert min(np.linalg.norm(a - b) for a, b in combinations(vertices, 2)) > 0.2 * SIZE


def near(one, other):
    return np.linalg.norm(BODY.vertices[one] - BODY.vertices[other]) < 0.1 * SIZE


def test_what_has_no_image_is_not_asked_for():
    hidden = BODY.vertices[:, 0] > 0
    images = [np.where(hidden, -1, map_) for map_ in (IDENTITY, FLIPS[2])]
    asked = questions(BODY, BODY, left_with(*images), most=5)
    assert asked
    assert not any(hidden[question.vertex] or -1 in question.places for question in asked)
    nothing = np.full(N, -1)
    assert questions(BODY, BODY, left_with(IDENTITY, nothing)) == ()
    assert questions(BODY, BODY, left_with(nothing, IDENTITY)) == ()


def test_motion_scale_and_numbering_change_nothing():
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    asked = questions(BODY, BODY, left_with(IDENTITY, *FLIPS))
    moved = Mesh(1e3 * BODY.vertices @ turn.T + 5, BODY.faces)
    assert questions(moved, moved, left_with(IDENTITY, *FLIPS)) == asked
    assert all(isinstance(question, Question) for question in asked)
