"""Questions: points of the source whose image, once known, decides between the maps that a match was left with."""

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
    """A vertex of the source, and its different places by the maps of a result, as vertices of the target.

    Parameters
    ----------
    vertex : int
        Vertex of the source.
    places : tuple of int
        Where the map puts it, and then the alternatives, as far as they differ.
    maps : tuple of int
        The first map that puts it there: 0, or the number of the alternative.

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

    Each question separates as many contenders as possible that none before does, on average as far apart as possible,
    away from the earlier ones. Answers are landmarks of a match again.

    Parameters
    ----------
    source, target : Mesh
        The meshes that were matched.
    result : MatchResult
        Its map and alternatives are the contenders.
    most : int
        Most questions.

    Returns
    -------
    tuple of Question
        None if there are no alternatives.

    Notes
    -----
    Places are compared through space, which tells apart what is apart to the eye. Linear time.

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
    images = np.stack([each.vertices[vertices] for each in maps])  # (maps, candidates)
    pairs = list(combinations(range(len(maps)), 2))
    gap = np.stack([_gaps(target, images[i], images[j]) for i, j in pairs]) / size[1]
    open_pairs, asked = np.ones(len(pairs), dtype=bool), list[int]()
    away = np.full(len(vertices), np.inf)  # from the questions asked
    for _ in range(most):
        told = np.minimum(gap, ERRORS.question_distance)
        told[gap < ERRORS.other_place] = 0.0
        # pairs that are still open first, then all pairs, so that later answers confirm the earlier ones
        worth = told[open_pairs].sum(axis=0) + told.mean(axis=0)
        worth = worth * np.minimum(away / (ERRORS.question_distance * size[0]), 1.0)
        best = int(worth.argmax())
        if not worth[best] > 0:
            break
        asked.append(best)
        open_pairs &= gap[:, best] < ERRORS.other_place
        apart = np.linalg.norm(source.vertices[vertices] - source.vertices[vertices[best]], axis=1)
        away = np.minimum(away, apart)
    return tuple(_question(int(vertices[k]), images[:, k], target, size[1]) for k in asked)


def _spread_vertices(source: Mesh, matched: BoolArray) -> IntArray:
    """Vertices spread over what has an image by the map, farthest points first."""
    inside = np.flatnonzero(matched)
    points = source.vertices[inside]
    chosen, away = [0], np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < min(ERRORS.n_question_vertices, len(inside)):
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return inside[chosen]


def _gaps(target: Mesh, one: IntArray, other: IntArray) -> FloatArray:
    """Distance between two images of each vertex; of one that only one map has, none is known, and 0 counts."""
    both = (one != UNMATCHED) & (other != UNMATCHED)
    gap: FloatArray = np.linalg.norm(target.vertices[one] - target.vertices[other], axis=1)
    return np.where(both, gap, 0.0)


def _question(vertex: int, images: IntArray, target: Mesh, size: float) -> Question:
    """Ask for the images of a vertex that are told apart."""
    maps = list[int]()
    for k in np.flatnonzero(images != UNMATCHED).tolist():
        apart = np.linalg.norm(target.vertices[images[maps]] - target.vertices[images[k]], axis=1) / size
        if (apart >= ERRORS.other_place).all():
            maps.append(k)
    return Question(vertex, tuple(images[maps].tolist()), tuple(maps))
