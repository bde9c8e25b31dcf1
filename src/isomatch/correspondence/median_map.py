"""Several maps between two surfaces joined to one: the geometric median of the images on the target."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import MapError
from isomatch.correspondence.correspondence import Correspondence
from isomatch.correspondence.map_arrays import UNMATCHED
from isomatch.decimation import PlacedMesh, VertexGroups, normalised
from isomatch.io import SurfaceLike, mesh_from
from isomatch.surfaces import PrecisePoints

MAX_STEPS = 1000  # largest number of steps of the search for a geometric median; chosen
# The search for medians ends once no coordinate moves by more than this share of the spread: the largest
# difference in a coordinate between a point and the mean of the points joined with it. EXACT_STEP is for
# points, PRECISE_STEP for maps, whose errors are far larger; chosen.
EXACT_STEP, PRECISE_STEP = 1e-12, 1e-6


def median_map(
    maps: Sequence[Correspondence], target: SurfaceLike, errors: Sequence[float] | None = None
) -> Correspondence:
    """Join maps between the same two surfaces: each vertex is mapped to the geometric median of its images.

    The median lies inside a triangle, on the sheet of one of the images. A vertex is unmatched if
    fewer than half of the maps have an image. One wrong map in three moves an image little. O(n m)
    time for each of some tens of steps.

    For two maps, any point between both images is a median; given the expected error of each, the
    result is their mean, weighted by 1 / error². `MapError` if there are no maps, or they are maps of
    other surfaces.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> right, wrong = Correspondence([0, 1, 2], n_target=4), Correspondence([3, 3, 3], n_target=4)
    >>> median_map([right, wrong, right], square).vertices
    array([0, 1, 2])
    """
    if not maps:
        raise MapError("no maps to join; give at least one")
    mesh = mesh_from(target)
    first = maps[0]
    for other in maps:
        other.check_fits(target=mesh)
        if other.shape != first.shape or other.source_hash != first.source_hash:
            raise MapError(f"cannot join {first!r} with {other!r}: they start from different surfaces")
    places, _, _ = normalised(mesh.vertices)
    images = np.stack([one.pull_back(places) for one in maps])  # (m, n, 3)
    starts = np.stack([one.vertices for one in maps], axis=1)  # (n, m)
    rows = np.flatnonzero(2 * (starts >= 0).sum(axis=1) >= len(maps))
    median = geometric_median(images[:, rows], PRECISE_STEP)
    if len(maps) == 2 and errors is not None and np.min(errors) > 0:
        weight = 1 / (1 + (errors[0] / errors[1]) ** 2)  # weight of the first map, if weights are 1 / error²
        mean = weight * images[0, rows] + (1 - weight) * images[1, rows]
        median = np.where(np.isnan(mean), median, mean)
    groups = VertexGroups.of(np.arange(mesh.n_vertices), mesh.n_vertices)
    near = np.where(starts[rows] < 0, starts[rows].max(axis=1, keepdims=True), starts[rows])
    points = PlacedMesh(mesh, places, groups).inverse(median, near)
    faces, barycentric = PrecisePoints.at_vertices(np.full(len(starts), UNMATCHED))
    faces[rows], barycentric[rows] = points
    vertices, hashes = faces[:, 0].copy(), (first.source_hash, mesh.content_hash)
    return Correspondence(vertices, mesh.n_vertices, faces, barycentric, *hashes)


def geometric_median(points: FloatArray, tolerance: float = EXACT_STEP) -> FloatArray:
    """Find the points (m, 3) with the least sum of distances from points (t, m, 3); nan rows are left out.

    Examples
    --------
    >>> geometric_median(np.array([[[0.0, 0, 0]], [[1, 0, 0]], [[9, 0, 0]]])).round(6)
    array([[1., 0., 0.]])
    """
    # Weiszfeld 1937: Σ_k |p_k − x| has the gradient Σ_k (x − p_k) / |p_k − x|, which vanishes at the mean of
    # the p_k with the weights 1 / |p_k − x|: x moves to this mean until no point x moves by more than the
    # tolerance, relative to the extent of the points. If a median is one of the p_k, its weight is singular;
    # so each p_k is compared with the result. Of two points, any point between them is a median, and their
    # mean is taken.
    known = np.asarray(np.isfinite(points).all(axis=2))[:, :, None]
    points = np.where(known, points, 0.0)
    count = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        middle = points.sum(axis=0) / count
    if (count <= 2).all():
        return np.asarray(middle)
    extent = float(np.abs(np.where(known, points - np.nan_to_num(middle), 0.0)).max())
    for _ in range(MAX_STEPS if extent > 0 else 0):
        distances = np.linalg.norm(points - middle, axis=2, keepdims=True)
        weights = np.where(known, 1.0 / np.maximum(distances, tolerance * extent), 0.0)
        with np.errstate(invalid="ignore"):
            moved = (weights * points).sum(axis=0) / weights.sum(axis=0)
        step = np.nan_to_num(np.abs(moved - middle)).max()
        middle = np.where(count > 2, moved, middle)
        if step <= tolerance * extent:
            break

    def total(medians: FloatArray) -> FloatArray:
        distances = np.linalg.norm(medians - points, axis=2)
        return np.asarray(np.where(known[:, :, 0], distances, 0.0).sum(axis=0))

    best, least = middle, total(middle)
    for candidates in np.where(known, points, np.nan):
        sums = total(candidates)
        is_less = sums < least
        best, least = np.where(is_less[:, None], candidates, best), np.where(is_less, sums, least)
    return np.asarray(np.where(count > 2, best, middle))
