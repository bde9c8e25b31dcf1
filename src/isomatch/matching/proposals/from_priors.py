"""First maps of the search vertices from priors."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, SearchRows
from isomatch._core.threads import parallel_map
from isomatch.correspondence import alignment_from_functions, alignments_from_points, nearest_under_rotation
from isomatch.matching.priors import MIN_POINTS
from isomatch.matching.problem import Problem
from isomatch.matching.proposals.pose import starts_from_pose


def starts_from_priors(pair: Problem) -> Iterator[tuple[Int[SearchRows, "m_s"], str]]:
    """First maps of the search vertices from priors, each with its origin."""
    settings, priors = pair.config.search, pair.priors
    if len(priors.landmarks):
        for penalty in settings.off_diagonal:
            yield first_maps_from_points(pair, BodyVertices(priors.landmarks[None]), penalty)[0], "landmarks"
    if len(priors.initial_pairs):
        yield start_from_pairs(pair, priors.initial_pairs), "initial map"
    if priors.has_functions:
        yield start_from_functions(pair, *priors.functions), "descriptors"
    if pair.config.start == "pose":
        for start in starts_from_pose(pair):
            yield start, "pose"


def start_from_pairs(pair: Problem, pairs: Int[BodyVertices, "_ 2"]) -> Int[SearchRows, "m_s"]:
    """First map of the search vertices from a map that is known at some vertices."""
    # A search vertex without an image takes the image of the vertex that is nearest in descriptors.
    # An image that is no search vertex of the target is replaced by the nearest one.
    source, target = pair.search_points
    image, row = np.full(pair.source.body.n_vertices, -1), np.full(pair.target.body.n_vertices, -1)
    image[pairs[::-1, 0]] = pairs[::-1, 1]  # the first of welded vertices counts
    row[pair.target_vertices] = np.arange(len(pair.target_vertices))
    target_vertex = image[pair.source_vertices]
    held = np.flatnonzero(target_vertex >= 0)
    if len(held) == len(target_vertex) and (row[target_vertex] >= 0).all():
        return SearchRows(row[target_vertex])
    if len(held) < MIN_POINTS:  # too few search vertices have images: use the nearest given vertices
        held = np.arange(len(target_vertex))
        points = pair.source.points.at(pairs[:, 0], len(source.signs)).coordinates
        target_vertex = pairs[cKDTree(points).query(source.coordinates)[1], 1]
    stand_in = held[cKDTree(source.coordinates[held]).query(source.coordinates)[1]]
    images = pair.target.points.at(target_vertex[stand_in], len(target.signs)).coordinates
    return SearchRows(np.asarray(cKDTree(target.coordinates).query(images)[1], dtype=np.int64))


def start_from_functions(
    pair: Problem, of_source: Float[FloatArray, "n_s q"], of_target: Float[FloatArray, "n_t q"]
) -> Int[SearchRows, "m_s"]:
    """First map from functions on the bodies that should correspond."""
    settings = pair.config.search
    weights = pair.source.body.vertex_areas, pair.target.body.vertex_areas
    sides = pair.source.points, pair.target.points, of_source, of_target, *weights
    rotation = alignment_from_functions(
        *sides, n_columns=settings.start_columns, off_diagonal=settings.off_diagonal[0], ridge=settings.ridge
    )
    return SearchRows(nearest_under_rotation(*pair.search_points, rotation))


def first_maps_from_points(
    pair: Problem, points: Int[BodyVertices, "h m 2"], off_diagonal: float
) -> list[Int[SearchRows, "m_s"]]:
    """First maps from corresponding vertices, source and target."""
    settings = pair.config.search
    sides = pair.source.points, pair.target.points, points[..., 0], points[..., 1]
    rotations = alignments_from_points(*sides, settings.start_columns, off_diagonal, settings.ridge)
    return parallel_map(lambda x: SearchRows(nearest_under_rotation(*pair.search_points, x)), rotations)
