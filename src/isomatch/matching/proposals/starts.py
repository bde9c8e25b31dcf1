"""First maps: from priors, from the pose, from extremities, and from points far from each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import SettingError
from isomatch._core.threads import parallel_map
from isomatch.correspondence import (
    Intervals,
    alignment_from_functions,
    alignments_from_points,
    assign_points,
    nearest_rows,
    nearest_under_rotation,
    poses_between,
    with_normals,
)
from isomatch.matching.pipeline import Relation, Start, first_maps_of
from isomatch.matching.problem import ShapePair, search_pairs
from isomatch.matching.proposals.priors import FEWEST_POINTS, Priors
from isomatch.shapes import EXACTLY, PreparedShape, farthest_rows
from isomatch.surfaces import Graph, Surface


def starts_from_priors(pair: ShapePair, priors: Priors) -> Iterator[tuple[IntArray, str]]:
    """First maps from what the user knows: target rows (m_s,) of the search vertices, and where each comes from."""
    settings = pair.config.search
    if len(priors.landmarks):
        for penalty in settings.off_diagonal:
            yield _from_points(pair, priors.landmarks[None], penalty)[0], "landmarks"
    if len(priors.initial_pairs):
        yield start_from_pairs(pair, priors.initial_pairs), "initial map"
    if priors.functions[0].shape[1]:
        yield start_from_functions(pair, *priors.functions), "descriptors"
    if pair.config.start == "pose":
        for start in starts_from_pose(pair):
            yield start, "pose"


def starts_from_extremities(pair: ShapePair) -> Iterator[IntArray]:
    """First maps from every assignment of extremal points."""
    settings = pair.config.search
    for count in settings.extremity_counts:
        group = [points for points in pair.extremity_assignments if len(points) == count]
        if group:
            starts = _from_points(pair, np.array(group), settings.off_diagonal[0])
            yield from (search_pairs(pair, start) for start in starts)


def starts_from_pose(pair: ShapePair) -> list[IntArray]:
    """First maps to the nearest point in space: target rows (m_s,); `SettingError` if a shape is a graph."""
    # of the bodies, which are centred and of unit area, and of the shapes as they are
    source, target = pair.source, pair.target
    here, there = pair.source_vertices, pair.target_vertices
    bodies = _places(source.body)[here], _places(target.body)[there]
    here, there = source.user_vertex[here], target.user_vertex[there]
    shapes = _places(source.surface)[here], _places(target.surface)[there]
    return [np.asarray(cKDTree(onto).query(points)[1], dtype=np.int64) for points, onto in (bodies, shapes)]


def starts_from_poses(pair: ShapePair) -> list[IntArray]:
    """First maps to the nearest points of meshes that are alike in space, however they lie."""
    limit, orientation = pair.config.search.near_rigid, pair.config.orientation
    if not (limit and pair.oriented):
        return []
    sides = {"preserve": (False,), "reverse": (True,), "any": (False, True)}[orientation]
    source = with_normals(pair.source.mesh_body)[pair.source_vertices]
    target = with_normals(pair.target.mesh_body)[pair.target_vertices]
    several = parallel_map(lambda mirrored: poses_between(source, target, mirrored), sides)
    return [search_pairs(pair, x.nearest) for poses in several for x in poses if x.distance <= limit]


def nearest_in_pose(source: PreparedShape, target: PreparedShape, source_vertex: IntArray) -> IntArray:
    """Target vertex nearest in space to each of some source vertices (q,), the shapes as they are."""
    here, there = (_places(shape.surface)[shape.user_vertex] for shape in (source, target))
    return np.asarray(cKDTree(there).query(here[source_vertex])[1], dtype=np.int64)


def _places(surface: Surface) -> FloatArray:
    """Positions of the vertices (n, 3)."""
    if isinstance(surface, Graph):
        raise SettingError("start = 'pose', but a graph has no positions in space; leave it at 'auto'")
    return surface.vertices


def start_from_pairs(pair: ShapePair, pairs: IntArray) -> IntArray:
    """First map from a map that is known at some vertices, pairs (q, 2): target rows (m_s,) of the search vertices."""
    # search vertices without an image take that of the one that has an image and is nearest in descriptors; and an
    # image between the target's search vertices goes to the nearest of them
    source, target = pair.search_points
    image, row = np.full(pair.source.body.n_vertices, -1), np.full(pair.target.body.n_vertices, -1)
    image[pairs[::-1, 0]] = pairs[::-1, 1]  # of vertices that were welded, the first counts
    row[pair.target_vertices] = np.arange(len(pair.target_vertices))
    target_vertex = image[pair.source_vertices]
    held = np.flatnonzero(target_vertex >= 0)
    if len(held) == len(target_vertex) and (row[target_vertex] >= 0).all():
        return np.asarray(row[target_vertex])
    if len(held) < FEWEST_POINTS:  # the nearest known vertices stand in
        held = np.arange(len(target_vertex))
        points = pair.source.points.at(pairs[:, 0], len(source.signs)).coordinates
        target_vertex = pairs[cKDTree(points).query(source.coordinates)[1], 1]
    stand_in = held[cKDTree(source.coordinates[held]).query(source.coordinates)[1]]
    images = pair.target.points.at(target_vertex[stand_in], len(target.signs)).coordinates
    return np.asarray(cKDTree(target.coordinates).query(images)[1], dtype=np.int64)


def start_from_functions(pair: ShapePair, of_source: FloatArray, of_target: FloatArray) -> IntArray:
    """First map from functions on the bodies that should correspond, (n_s, q) and (n_t, q)."""
    settings = pair.config.search
    weights = pair.source.body.vertex_areas, pair.target.body.vertex_areas
    sides = pair.source.points, pair.target.points, of_source, of_target, *weights
    rotation = alignment_from_functions(
        *sides, n_columns=settings.start_columns, off_diagonal=settings.off_diagonal[0], ridge=settings.ridge
    )
    return nearest_under_rotation(*pair.search_points, rotation)


def _from_points(pair: ShapePair, points: IntArray, off_diagonal: float) -> list[IntArray]:
    """First maps from corresponding vertices (h, m, 2), source and target."""
    settings = pair.config.search
    sides = pair.source.points, pair.target.points, points[..., 0], points[..., 1]
    rotations = alignments_from_points(*sides, settings.start_columns, off_diagonal, settings.ridge)
    return parallel_map(lambda rotation: nearest_under_rotation(*pair.search_points, rotation), rotations)


N_ANCHORS = 6  # three points determine an isometry, three more its errors
N_CANDIDATES = 200  # search vertices of the target among which their images are sought; as for symmetries
SIGNATURE_WEIGHT = 0.25  # docs/lab/robustness.md, shapes without limbs
BEAM = 200  # partial assignments that are kept; chosen, not measured
# mean distance by which these differ, in average distances; chosen: 0.1 with 80 starts is no better
APART = 0.15
N_STARTS = 48  # best assignments that become first maps; chosen: of the most that extremities give
SLIDE_FUNCTIONS = 20  # functions by which signatures move a first map; the first before a candidate is made
SLIDE_STEPS = 10  # docs/lab/robustness.md, shapes without limbs


def starts_from_anchors(pair: ShapePair) -> list[IntArray]:
    """First maps of a pair of which a shape has no limbs: from points far from each other."""
    # Assign anchors a_1 … a_6, one after the other, to points b_1 … b_6 of the target by a beam search. The cost is that
    # of violated distances d(b_p, b_q) = d(a_p, a_q), see `IntervalCost`, plus for each point p
    #   w_e |ē(a_p) − ē(b_p)| + w_σ ‖σ(a_p) − σ(b_p)‖,   ē the mean of d (eccentricity), σ the signatures,
    # d over the average distance. All other vertices go where their distances to the anchors fit best; then it is slid.
    if not pair.limbless:
        return []
    source, target = pair.source, pair.target
    here = source.distances_between(pair.source_vertices) / source.intrinsic_scale
    there = target.distances_between(pair.target_vertices) / target.intrinsic_scale
    signatures = pair.search_signatures
    n = N_CANDIDATES
    anchors = farthest_rows(here[:n, :n], N_ANCHORS)
    exact, among = here[np.ix_(anchors, anchors)], there[:n, :n]
    sides = Intervals(exact, exact), Intervals(among, among)
    remoteness = np.abs(there.mean(axis=1)[:n] - here.mean(axis=1)[anchors, None])
    unlike = np.linalg.norm(signatures.target[:n] - signatures.source[anchors, None], axis=2)
    unary = pair.config.search.eccentricity_weight * remoteness + SIGNATURE_WEIGHT * unlike
    assigned, _ = assign_points(*sides, unary, EXACTLY, BEAM, APART)
    starts = [nearest_rows(there[:, images], here[:, anchors]) for images in assigned[:N_STARTS]]
    return [search_pairs(pair, start) for start in parallel_map(lambda start: slid(pair, start), starts)]


def slid(pair: ShapePair, target_row: IntArray) -> IntArray:
    """Let the signatures move a map (m_s,) of the search vertices."""
    # Of a round shape, many maps keep distances, and iterative closest points stop at any of them. Few functions leave
    # a map free to move along these directions: images are nearest neighbours in (Φ_t Fᵀ / √k, σ_t) of (Φ_s / √k, σ_s).
    spectra, signatures = pair.search_spectra, pair.search_signatures
    k = min(SLIDE_FUNCTIONS, pair.n_functions)
    for _ in range(SLIDE_STEPS):
        carried = spectra.target[:, :k] @ spectra.functional_map(target_row, k).T
        target_row = nearest_rows(
            np.hstack([carried / np.sqrt(k), signatures.target]),
            np.hstack([spectra.source.at_samples[:, :k] / np.sqrt(k), signatures.source]),
        )
    return target_row


default_starts: tuple[Start, ...] = (starts_from_extremities, starts_from_poses, starts_from_anchors)
"""The starts of a match to which none are handed; priors of the user come before them."""


def searches_by_anchors(relation: Relation) -> bool:
    """Whether a part or an elastic map is searched by anchors: not if only other starts, or only priors, lead to it."""
    # landmarks lead through anchors, in any case but where a whole map is given and nothing else may win
    starts, config, priors = relation.stages.starts, relation.pair.config, relation.priors
    only_given = config.hypotheses == "given"
    if len(priors.landmarks) and not (only_given and (not priors.only_landmarks or config.start == "pose")):
        return True
    return not only_given and (starts is None or starts_from_anchors in starts)


def first_maps_handed_in(relation: Relation) -> list[tuple[IntArray, str]]:
    """Collect the first maps (q, 2) of a user's starts, for a part or an elastic map; none where only priors may win."""
    starts = () if relation.pair.config.hypotheses == "given" else relation.stages.starts or ()
    return first_maps_of([start for start in starts if start not in default_starts], relation.pair)
