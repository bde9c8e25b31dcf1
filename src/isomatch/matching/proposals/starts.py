"""First maps of a problem: by default from extremities, poses and anchors, and from priors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, SearchRows
from isomatch._core.errors import SettingError
from isomatch._core.threads import parallel_map
from isomatch.correspondence import (
    Intervals,
    alignment_from_functions,
    alignments_from_points,
    assign_points,
    nearest_rows,
    nearest_under_rotation,
)
from isomatch.matching.parameters import ANCHORS, SCREENING
from isomatch.matching.priors import MIN_POINTS
from isomatch.matching.problem import Problem, Start, name_of, search_pairs
from isomatch.shapes import EXACTLY, PreparedShape, farthest_rows
from isomatch.surfaces import Graph, Surface


def starts_from_anchors(pair: Problem) -> list[Int[BodyVertices, "m_s 2"]]:
    """First maps from points far from each other, if a shape has no limbs."""
    # A beam search assigns anchors a_1 … a_6 to points b_1 … b_6 of the target, one after the other. Its
    # cost is the error of d(b_p, b_q) = d(a_p, a_q), see `IntervalCost`, plus for each point p
    #   w_e |ē(a_p) − ē(b_p)| + w_σ ‖σ(a_p) − σ(b_p)‖,
    # where d is in units of the average distance, ē is the mean of d (eccentricity), σ the signature, and w_e
    # and w_σ are weights. Other vertices go where their distances to the anchors fit best; the map is then
    # relaxed.
    if not pair.limbless:
        return []
    source, target = pair.source, pair.target
    on_source = source.distances_between(pair.source_vertices) / source.intrinsic_scale
    on_target = target.distances_between(pair.target_vertices) / target.intrinsic_scale
    signatures = pair.search_signatures
    n = ANCHORS.n_candidates
    anchors = farthest_rows(on_source[:n, :n], ANCHORS.n_anchors)
    of_anchors, of_candidates = on_source[np.ix_(anchors, anchors)], on_target[:n, :n]
    sides = Intervals(of_anchors, of_anchors), Intervals(of_candidates, of_candidates)
    remoteness = np.abs(on_target.mean(axis=1)[:n] - on_source.mean(axis=1)[anchors, None])
    unlike = np.linalg.norm(signatures.target[:n] - signatures.source[anchors, None], axis=2)
    unary = pair.config.search.eccentricity_weight * remoteness + ANCHORS.signature_weight * unlike
    assigned, _ = assign_points(*sides, unary, EXACTLY, ANCHORS.beam_width, ANCHORS.same_assignment_distance)
    rows = [nearest_rows(on_target[:, x], on_source[:, anchors]) for x in assigned[: ANCHORS.n_starts]]
    starts = parallel_map(lambda start: relax_spectrally(pair, SearchRows(start)), rows)
    return [search_pairs(pair, start) for start in starts]


def relax_spectrally(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Int[SearchRows, "m_s"]:
    """Improve a map of the search vertices by signatures and a few functions."""
    # Many maps between shapes without limbs keep distances, and iterative closest points stop at any of them.
    # A few functions leave a map free to move towards agreeing signatures: the image of vertex i is the row
    # of (Φ_t Fᵀ / √k, σ_t) nearest to row i of (Φ_s / √k, σ_s), with k functions Φ, signatures σ and the
    # functional map F.
    spectra, signatures = pair.search_spectra, pair.search_signatures
    k = min(ANCHORS.n_relaxation_functions, pair.n_functions)
    for _ in range(ANCHORS.n_relaxation_steps):
        carried = spectra.target[:, :k] @ spectra.functional_map(target_row, k).T
        of_target = np.hstack([carried / np.sqrt(k), signatures.target])
        of_source = np.hstack([spectra.source.at_samples[:, :k] / np.sqrt(k), signatures.source])
        target_row = SearchRows(nearest_rows(of_target, of_source))
    return target_row


def starts_from_pose(pair: Problem) -> list[Int[SearchRows, "m_s"]]:
    """First maps to the nearest point in space; `SettingError` if a shape is a graph."""
    sides = (pair.source, pair.source_vertices), (pair.target, pair.target_vertices)
    # nearest points between the bodies, which are centred and of unit area, then between the user's surfaces
    bodies = [_positions(shape.body)[vertices] for shape, vertices in sides]
    surfaces = [_positions(shape.surface)[shape.user_vertex[vertices]] for shape, vertices in sides]
    return [
        SearchRows(np.asarray(cKDTree(onto).query(points)[1], dtype=np.int64))
        for points, onto in (bodies, surfaces)
    ]


def starts_from_poses(pair: Problem) -> list[Int[BodyVertices, "m_s 2"]]:
    """First maps to the nearest points after a rigid motion, if meshes are then close in space."""
    limit, orientation = pair.config.search.near_rigid, pair.config.orientation
    if not (limit and pair.oriented):
        return []
    poses = [] if orientation == "reverse" else [*pair.poses]
    poses += [] if orientation == "preserve" else pair.mirrored_poses
    return [search_pairs(pair, SearchRows(pose.nearest)) for pose in poses if pose.distance <= limit]


def starts_if_alike(pair: Problem) -> list[SearchRows]:
    """First maps to the nearest points after rigid motions, if one of these makes two meshes coincide nearly."""
    # Two bones of one kind, or a body in one pose, nearly coincide after one motion, and after no other
    # one. Reflections must not bring them nearer either: a left bone is the mirror image of a right one.
    # The other motions and reflections are first maps that lose, and show by how much.
    limit = pair.config.search.near_rigid
    if not (limit and pair.is_sided and pair.config.orientation == "preserve"):
        return []
    if pair.poses[0].distance > limit or not (_has_axes(pair.source) and _has_axes(pair.target)):
        return []
    # two copies of a symmetric shape coincide exactly in several poses: short distances are raised to one value,
    # so that these poses tie
    poses = *pair.poses[:2], pair.mirrored_poses[0]
    first, second, mirrored = (max(pose.distance, SCREENING.min_pose_distance) for pose in poses)
    ratios = second / first, mirrored / first
    if ratios[0] < SCREENING.min_pose_ratio or ratios[1] < SCREENING.min_mirrored_pose_ratio:
        return []
    return [SearchRows(pose.nearest) for pose in (*pair.poses, *pair.mirrored_poses)]


def _has_axes(shape: PreparedShape) -> bool:
    """Whether the principal axes of a mesh have different lengths, so that motions can be told from turns."""
    body = shape.mesh_body
    lengths = np.sqrt(np.linalg.eigvalsh(np.cov(body.vertices.T, aweights=body.vertex_areas)))
    return bool((lengths[1:] >= SCREENING.min_axis_ratio * lengths[:-1]).all())


def nearest_in_pose(
    source: PreparedShape, target: PreparedShape, source_vertex: Int[BodyVertices, "q"]
) -> Int[BodyVertices, "q"]:
    """Target vertex nearest in space to each of some source vertices, without moving the shapes."""
    points, onto = (_positions(shape.surface)[shape.user_vertex] for shape in (source, target))
    return BodyVertices(np.asarray(cKDTree(onto).query(points[source_vertex])[1], dtype=np.int64))


def _positions(surface: Surface) -> Float[FloatArray, "n 3"]:
    """Positions of the vertices."""
    if isinstance(surface, Graph):
        raise SettingError("start = 'pose', but a graph has no positions in space; leave it at 'auto'")
    return surface.vertices


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
    # A search vertex without an image takes the image of the vertex nearest to it in descriptors. An image
    # that is no search vertex of the target is replaced by the search vertex nearest to it in descriptors.
    source, target = pair.search_points
    image, row = np.full(pair.source.body.n_vertices, -1), np.full(pair.target.body.n_vertices, -1)
    image[pairs[::-1, 0]] = pairs[::-1, 1]  # of several pairs with one source vertex, the first wins
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


def starts_from_extremities(pair: Problem) -> Iterator[Int[BodyVertices, "m_s 2"]]:
    """First maps from all assignments of extremal points."""
    settings = pair.config.search
    for count in settings.extremity_counts:
        group = [points for points in pair.extremity_assignments if len(points) == count]
        if group:
            starts = first_maps_from_points(pair, BodyVertices(np.array(group)), settings.off_diagonal[0])
            yield from (search_pairs(pair, start) for start in starts)


default_starts: tuple[Start, ...] = (starts_from_extremities, starts_from_poses, starts_from_anchors)
"""The starts of a match by default; priors come before them."""


def first_maps_of(starts: Iterable[Start], pair: Problem) -> list[tuple[Int[BodyVertices, "_ 2"], str]]:
    """Collect the first maps of some starts, checked, with the name of each start."""
    first_maps = []
    sizes = pair.source.body.n_vertices, pair.target.body.n_vertices
    for start in starts:
        maps = start(pair)
        if maps is None or (isinstance(maps, np.ndarray) and maps.ndim < 3):
            what = "None" if maps is None else f"one array of shape {maps.shape}"
            raise SettingError(
                f"the start {name_of(start)} gave {what}; expected a list of first maps, which may be empty"
            )
        for pairs in map(np.asarray, maps):
            fits = pairs.ndim == 2 and pairs.shape[1] == 2 and pairs.dtype.kind in "iu" and len(pairs) >= 3
            if not fits or (pairs < 0).any() or (pairs >= sizes).any():
                raise SettingError(
                    f"the start {name_of(start)} gave an array of shape {pairs.shape} and type {pairs.dtype}; expected "
                    f"at least three rows (source vertex, target vertex) of bodies of {sizes[0]} and {sizes[1]} vertices"
                )
            first_maps.append((BodyVertices(pairs), name_of(start)))
    return first_maps
