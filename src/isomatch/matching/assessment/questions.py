"""Questions: points whose images, once known, decide between a map and its alternatives."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch.correspondence import UNMATCHED
from isomatch.matching.parameters import ERRORS
from isomatch.matching.result import MatchResult
from isomatch.surfaces import Mesh


@dataclass(frozen=True)
class Question:
    """A vertex of the source, and its different images under the maps of a result.

    Parameters
    ----------
    vertex : int
        Vertex of the source.
    places : tuple of int
        Its image under the map, then different images under alternatives: vertices of the target.
    maps : tuple of int
        The first map with each image: 0, or the number of the alternative.

    Examples
    --------
    >>> Question(vertex=7, places=(12, 80), maps=(0, 1)).places
    (12, 80)
    """

    vertex: int
    places: tuple[int, ...]
    maps: tuple[int, ...]


def questions(source: Mesh, target: Mesh, result: MatchResult, most: int = 3) -> tuple[Question, ...]:
    """Ask for the points that decide between the map of a result and its alternatives.

    Each question separates many contenders that earlier questions do not separate, by a large mean distance, and lies
    far from earlier questions. Answers can be landmarks of the next match.

    Parameters
    ----------
    source, target : Mesh
        The meshes that were matched.
    result : MatchResult
        Its map and alternatives are the contenders.
    most : int
        Maximum number of questions.

    Returns
    -------
    tuple of Question
        Empty if there are no alternatives.

    Notes
    -----
    Distances between images are measured in space, as seen by eye. Linear time.

    Examples
    --------
    >>> from isomatch import match
    >>> from isomatch.datasets import example_pair
    >>> source, target = (animal.mesh for animal in example_pair())
    >>> [question.maps for question in questions(source, target, match(source, target), most=1)]
    [(0, 1, 2)]
    """
    maps = [result.map, *(other.map for other in result.alternatives)]
    if len(maps) < 2 or not result.map.matched.any():
        return ()
    size = np.sqrt(source.area), np.sqrt(target.area)
    vertices = _spread_vertices(source, result.map.matched)
    images = np.stack([map_.vertices[vertices] for map_ in maps])  # (maps, vertices)
    pairs = list(combinations(range(len(maps)), 2))
    gap = np.stack([_gaps(target, images[i], images[j]) for i, j in pairs]) / size[1]
    separation = np.where(gap < ERRORS.other_place, 0.0, np.minimum(gap, ERRORS.question_distance))
    open_pairs, asked = np.ones(len(pairs), dtype=bool), list[int]()
    to_questions = np.full(len(vertices), np.inf)  # distance of each vertex from the nearest question
    for _ in range(most):
        # Pairs of maps that no question separates yet have the most weight. All pairs have a little, so that
        # answers confirm each other.
        gain = separation[open_pairs].sum(axis=0) + separation.mean(axis=0)
        gain = gain * np.minimum(to_questions / (ERRORS.question_distance * size[0]), 1.0)
        best = int(gain.argmax())
        if not gain[best] > 0:
            break
        asked.append(best)
        open_pairs &= gap[:, best] < ERRORS.other_place
        distance = np.linalg.norm(source.vertices[vertices] - source.vertices[vertices[best]], axis=1)
        to_questions = np.minimum(to_questions, distance)
    return tuple(_question(int(vertices[k]), images[:, k], target, size[1]) for k in asked)


def _spread_vertices(source: Mesh, matched: BoolArray) -> IntArray:
    """Sample matched vertices evenly by farthest points in space."""
    inside = np.flatnonzero(matched)
    points = source.vertices[inside]
    chosen, distance = [0], np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < min(ERRORS.n_question_vertices, len(inside)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return inside[chosen]


def _gaps(target: Mesh, one: IntArray, other: IntArray) -> FloatArray:
    """Distance between two images of each vertex; 0 if a vertex lacks one of them."""
    both = (one != UNMATCHED) & (other != UNMATCHED)
    gap: FloatArray = np.linalg.norm(target.vertices[one] - target.vertices[other], axis=1)
    return np.where(both, gap, 0.0)


def _question(vertex: int, images: IntArray, target: Mesh, size: float) -> Question:
    """Make a question of the images of a vertex that can be told apart by eye."""
    maps = list[int]()
    for k in np.flatnonzero(images != UNMATCHED).tolist():
        distance = np.linalg.norm(target.vertices[images[maps]] - target.vertices[images[k]], axis=1) / size
        if (distance >= ERRORS.other_place).all():
            maps.append(k)
    return Question(vertex, tuple(images[maps].tolist()), tuple(maps))
