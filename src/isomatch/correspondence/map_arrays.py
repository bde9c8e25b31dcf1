"""The arrays of a map: checks, composition, inversion, and values carried along them."""

from __future__ import annotations

from contextlib import suppress
from math import prod

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, array_of, numbers_of
from isomatch._core.errors import DescriptorError, MapError, some
from isomatch.decimation import PlacedMesh, VertexGroups, normalised
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.surfaces import Mesh, PrecisePoints, Surface

UNMATCHED = -1  # index that a map has in place of the image of a vertex without an image
# For each kind of numpy type (`dtype.kind`), the value that a pulled back array has at unmatched vertices.
_FILLS = {"f": np.nan, "c": np.nan, "i": -1, "b": False, "U": "", "S": b""}
# An edge is torn if a map lengthens it by more than this many times the median factor; chosen.
MAX_STRETCH_RATIO = 4.0


def check_map(
    vertices: ArrayLike, n_target: int, faces: ArrayLike | None, barycentric: ArrayLike | None
) -> tuple[IntArray, PrecisePoints]:
    """Check the arrays of a `Correspondence`; return target vertices and precise images (n_source,)."""
    indices = array_of(vertices, "the vertices of a map", MapError)
    if indices.ndim != 1 or (indices.size and indices.dtype.kind not in "iu"):
        raise MapError(
            f"a map needs one integer target vertex for each source vertex, not {indices.dtype} of shape {indices.shape}"
        )
    if n_target < 0:
        raise MapError(f"n_target = {n_target} is not a number of target vertices")
    bad = np.flatnonzero((indices < UNMATCHED) | (indices >= n_target))
    if len(bad):
        raise MapError(
            f"source vertices {some(bad)} are mapped outside the target's vertices 0…{n_target - 1}; "
            "indices count from 0, and −1 means unmatched"
        )
    image = np.array(indices, dtype=np.int64)
    if (faces is None) != (barycentric is None):
        raise MapError("faces and barycentric describe the precise image together; give both or neither")
    if faces is None or barycentric is None:
        return image, PrecisePoints.at_vertices(image)
    weights = numbers_of(barycentric, "barycentric weights", MapError)
    return image, _precise(array_of(faces, "faces", MapError), weights, image, n_target)


def _precise(faces: AnyArray, weights: FloatArray, image: IntArray, n_target: int) -> PrecisePoints:
    """Check that corners and weights are precise images of the matched vertices, and return them."""
    if faces.shape != (len(image), 3) or weights.shape != (len(image), 3):
        raise MapError("faces and barycentric must both have one row of three for each source vertex")
    if faces.size and faces.dtype.kind not in "iu":
        raise MapError(f"faces have type {faces.dtype}, expected integers: three target vertices each")
    matched = image >= 0
    rows = slice(None) if matched.all() else matched  # a slice, which makes no copies, if all are matched
    if faces[rows].min(initial=0) < 0 or faces[rows].max(initial=-1) >= n_target:
        raise MapError(f"faces name vertices outside the target's 0…{n_target - 1}")
    smallest = weights[rows].min(initial=0.0)
    with np.errstate(invalid="ignore"):
        sums = weights[rows, 0] + weights[rows, 1] + weights[rows, 2]
    if smallest < -1e-9 or not (np.abs(sums - 1) <= 1e-6).all():
        raise MapError("barycentric weights must be numbers that are not negative and sum to 1 in each row")
    corners = faces.astype(np.int64)
    corners[~matched], weights[~matched] = UNMATCHED, (1.0, 0.0, 0.0)
    return PrecisePoints(corners, weights)


def pull_back_rows(
    rows: AnyArray, vertices: IntArray, faces: IntArray, barycentric: FloatArray, fill: object
) -> AnyArray:
    """Interpolate floats (n_target, ...) at precise images, or take labels; ``fill`` if unmatched."""
    if not len(rows):  # no vertex is matched
        kind = np.result_type(rows, np.float64) if rows.dtype.kind in "fc" else rows.dtype
        carried: AnyArray = np.zeros((len(vertices), *rows.shape[1:]), kind)
    elif rows.dtype.kind in "fc":
        weights = barycentric.reshape(-1, 3, *(1,) * (rows.ndim - 1))
        carried = (weights * rows[faces]).sum(axis=1)
    else:
        carried = rows[vertices]
    unmatched = vertices < 0
    return _fill_rows(carried, unmatched, fill) if unmatched.any() else carried


def push_forward_rows(
    transposed: csc_array,
    matched: BoolArray,
    values: ArrayLike,
    source_areas: ArrayLike,
    target_areas: ArrayLike | None,
) -> FloatArray:
    """Push values forward by a transposed map (n_target, n_source); see `Correspondence.push_forward`."""
    n_target, n_source = transposed.shape
    rows = array_of(values, "values", DescriptorError)
    if rows.dtype.kind != "f":
        raise DescriptorError(
            f"values have type {rows.dtype}, and labels have no mean; carry them with "
            "reversed(source, target).pull_back, or give floats"
        )
    areas = numbers_of(source_areas, "source areas", DescriptorError)
    sizes = [("values", rows.shape[:1], n_source), ("source areas", areas.shape, n_source)]
    if target_areas is not None:
        total = numbers_of(target_areas, "target areas", DescriptorError)
        sizes.append(("target areas", total.shape, n_target))
    for name, shape, n in sizes:
        if shape != (n,):
            raise DescriptorError(f"{name} have shape {shape}, expected ({n},): one for each vertex")
    if target_areas is None:
        total = transposed @ areas
    weighted = rows.reshape(n_source, prod(rows.shape[1:])) * areas[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        pushed: FloatArray = (transposed @ np.where(matched[:, None], weighted, 0.0)) / total[:, None]
    if target_areas is not None:
        has_no_image = transposed @ np.ones(n_source) == 0
        pushed[has_no_image] = 0.0  # target vertices to which no vertex is mapped, whatever their area
    return pushed.reshape(n_target, *rows.shape[1:])


def _fill_rows(labels: AnyArray, unmatched: BoolArray, fill: object) -> AnyArray:
    """Set the rows of unmatched vertices; `DescriptorError` if their type cannot hold ``fill``."""
    if fill is None:
        fill = _FILLS.get(labels.dtype.kind)
        if fill is None:
            raise DescriptorError(
                f"{unmatched.sum()} source vertices are unmatched, and nothing stands for that in values of type "
                f"{labels.dtype}; give fill"
            )
    value = np.asarray(fill)
    kind = np.result_type(labels, value) if labels.dtype.kind == value.dtype.kind in "US" else labels.dtype
    fits = False
    with suppress(TypeError, ValueError, OverflowError), np.errstate(invalid="ignore"):
        is_same = value.astype(kind) == value or (value != value and kind.kind in "fcmM")
        fits = value.ndim == 0 and bool(is_same)
    if not fits:
        raise DescriptorError(f"fill = {fill!r} is no value of type {labels.dtype}")
    rows: AnyArray = labels.astype(kind)
    rows[unmatched] = value
    return rows


def compose_arrays(
    vertices: IntArray,  # vertex (n,) of the middle surface that is the image of each source vertex
    points: PrecisePoints,  # precise images of the source vertices on the middle surface
    image: IntArray,  # vertex (m,) of the target that is the image of each middle vertex
    images: PrecisePoints,  # precise images of the middle vertices on the target
    middle: Mesh | None,
    target: Mesh | None,
) -> tuple[IntArray, PrecisePoints]:
    """Map the images under one map by another, see `Correspondence.then`: vertices (n,) and n points."""
    by_weight = np.argsort(-points.barycentric, axis=1, kind="stable")
    corners = np.take_along_axis(points.corners, by_weight, axis=1)
    weights = np.take_along_axis(points.barycentric, by_weight, axis=1)
    nearest = corners[:, 0]
    target_vertex = np.where(vertices >= 0, image[nearest], UNMATCHED)
    faces, barycentric = images.corners[nearest], images.barycentric[nearest]
    weights = np.where((image >= 0)[corners], weights, 0.0)
    inside = np.flatnonzero((target_vertex >= 0) & (weights[:, 1:] > 0).any(axis=1))
    weights = weights[inside] / weights[inside].sum(axis=1, keepdims=True)
    inner_points = PrecisePoints(corners[inside], weights)
    precise, is_precise = (
        _compose_in_faces(inner_points, images)
        if middle is None or target is None
        else _compose_on_surface(inner_points, images, middle, target)
    )
    rows = inside[is_precise]
    faces[rows], barycentric[rows] = (array[is_precise] for array in precise)
    target_vertex[rows] = faces[rows, barycentric[rows].argmax(axis=1)]
    return target_vertex, PrecisePoints(faces, barycentric)


def _compose_in_faces(points: PrecisePoints, images: PrecisePoints) -> tuple[PrecisePoints, BoolArray]:
    """Compose m points if the images of their corners lie in one triangle; tell whether they do (m,)."""
    m = len(points.corners)
    corners = images.corners[points.corners]  # (m, 3, 3)
    weights = (images.barycentric[points.corners] * points.barycentric[:, :, None]).reshape(m, 9)
    composed = PrecisePoints.at_vertices(np.full(m, -1))
    inside = np.zeros(m, dtype=bool)
    for k in range(3):
        same = corners.reshape(m, 9, 1) == corners[:, None, k]  # (m, 9, 3)
        new = ~inside & (same.any(axis=2) | (weights == 0)).all(axis=1)
        first_same = same & (same.cumsum(axis=2) == 1)
        composed.corners[new] = corners[new, k]
        composed.barycentric[new] = np.einsum("ma,mac->mc", weights[new], first_same[new])
        inside |= new
    return composed, inside


def _compose_on_surface(
    points: PrecisePoints, images: PrecisePoints, middle: Mesh, target: Mesh
) -> tuple[PrecisePoints, BoolArray]:
    """Interpolate images of corners of m points in space, and take the nearest points of the target."""
    # Corners whose image the map tears from the image of the first corner of their triangle are left out. The
    # second result tells which of the m points have more than one corner left.
    positions = normalised(target.vertices)[0]
    places = images.interpolated(positions)
    corners, surfaces = points.corners, (normalised(middle.vertices)[0], places)
    before, after = (np.linalg.norm(x[corners] - x[corners[:, :1]], axis=2) for x in surfaces)
    used = (points.barycentric > 0) & (before > 0)
    usual = np.median(after[used] / before[used]) if used.any() else 0.0
    near = used & (after <= MAX_STRETCH_RATIO * usual * before)
    near[:, 0] = True
    weights = np.where(near, points.barycentric, 0.0)
    inner_points = PrecisePoints(points.corners, weights / weights.sum(axis=1, keepdims=True))
    groups = VertexGroups.of(np.arange(target.n_vertices), target.n_vertices)
    start = images.corners[points.corners].reshape(-1, 9)
    start = np.where(start < 0, start[:, :1], start)
    composed = PlacedMesh(target, positions, groups).inverse(inner_points.interpolated(places), start)
    return composed, near[:, 1:].any(axis=1)


def invert_arrays(
    image: IntArray, images: PrecisePoints, source: Surface, target: Surface, within: float
) -> tuple[PrecisePoints, BoolArray]:
    """Find the source point whose image is nearest to each target vertex; tell which have one (n,)."""
    # The search for each target vertex starts from the source vertices whose image is nearest to it along
    # edges.
    matched = image >= 0
    n = target.n_vertices
    if not matched.any():
        return PrecisePoints.at_vertices(np.full(n, -1)), np.zeros(n, dtype=bool)
    distance, near = distance_along_edges_to_nearest(target, np.unique(image[matched]), weld=True)
    reached = distance <= within * np.sqrt(target.area)
    groups = VertexGroups.of(image, n)
    preimages = PrecisePoints.at_vertices(np.where(reached, groups.members[groups.start[near * reached]], -1))
    if isinstance(source, Mesh) and isinstance(target, Mesh):
        positions, _, _ = normalised(target.vertices)
        places = np.full((len(image), 3), np.nan)
        places[matched] = images.interpolated(positions)[matched]
        exact = PlacedMesh(source, places, groups).inverse(positions[reached], near[reached, None])
        preimages.corners[reached], preimages.barycentric[reached] = exact
    return preimages, reached
