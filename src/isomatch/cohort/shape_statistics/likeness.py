"""The likeness of shapes: distances, tree and map; and shapes that hardly belong to a sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import compress, permutations
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.cluster.hierarchy import linkage
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import squareform

from isomatch import spectral
from isomatch._core.arrays import BoolArray, FloatArray, numbers_of
from isomatch._core.errors import InputError, SettingError
from isomatch.cohort.shape_statistics.procrustes import generalised_procrustes, procrustes_distances
from isomatch.cohort.shape_statistics.shapes import CorrespondedShapes
from isomatch.geodesics import distance_engine, euclidean_farthest_points

# The agreement of two shapes is from −1 (one fits the mirror image of the other) to 1, see `_find_mirrored`. Once the
# shapes that seem mirrored are turned over, the agreement is measured again. If its median over all pairs is at most the
# first bound, poses differ too much, and no shape is called mirrored; nor is a shape whose median agreement with the
# other shapes is at most the second bound. With these bounds, 202 of 208 mirror images are found in seven sets, and no
# other shape is called mirrored.
MIN_SAMPLE_AGREEMENT = 0.35
MIN_SHAPE_AGREEMENT = 0.15
# Among fewer than `MIN_SHAPES` shapes, a shape is mirrored only if the distance of its mirror image from another shape,
# over its own distance from that shape, is below this; chosen.
MIRROR_RATIO = 0.7
# The thickness of a shape is its Procrustes distance from its own mirror image, over its size. If the geometric mean
# of the thicknesses of two shapes is below this, neither side agrees better, and the agreement is set to 0; chosen.
MIN_THICKNESS = 0.01
SAME_SHAPE = 1e-5  # two shapes are the same up to this Procrustes distance over their size; chosen
# A shape is called far only if the distance of its centroid from the median of all centroids, over the median size of
# the shapes (root mean square distance of the vertices from the centroid), exceeds this; chosen.
FAR_SIZES = 10.0
# Take the median Procrustes distance of each shape from the other shapes. A shape is called unlike only if its median,
# over the median of the medians of all shapes, exceeds this; chosen.
UNLIKE_RATIO = 2.0
MIN_SHAPES = 4  # among fewer shapes, it is not known what is usual, and none is called far or unlike; chosen
DoubtKind: TypeAlias = Literal["units", "mirrored", "twice", "far", "unlike"]  # kinds of doubt about a shape
N_SAMPLES = 100  # number of vertices between which geodesic distances are compared; chosen


class Doubt(NamedTuple):
    """Shapes that hardly belong to a sample: kind, see `doubtful_shapes`, and reason."""

    kind: DoubtKind
    names: tuple[str, ...]
    reason: str


def doubtful_shapes(shapes: CorrespondedShapes) -> list[Doubt]:
    """Find shapes that hardly belong to a sample as they are; look at them before a model is made.

    - *units*: the size is so different from others that it may be a matter of units, see
      `size_factors`.
    - *mirrored*: mirror images are nearer, in Procrustes distance without size, to most of the
      other shapes. They are not found among bodies whose poses differ more than left and right.
    - *twice*: two shapes are equal up to a motion and their size.
    - *far*: the centroid lies more than ten median sizes from the middle of all, and is an outlier
      of six standard deviations, among four shapes or more. Alignment removes it.
    - *unlike*: the median distance from the others is an outlier of six standard deviations, at
      least twice the usual one, among four shapes or more; or all vertices are at one position.

    All vertices count alike. O(m² n) time for m shapes.

    Examples
    --------
    >>> corner = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1.0]])
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> sample = [corner, 1.01 * corner, corner * [1, 1, 1.02], 1000 * corner * [1.01, 1, 1], corner * [-1.01, 1.02, 1]]
    >>> for doubt in doubtful_shapes(CorrespondedShapes("abcde", sample, faces)):
    ...     print(doubt.kind, *doubt.names)
    units d
    mirrored e
    twice a b
    """
    return doubtful_positions(shapes.names, shapes.vertices)


def doubtful_positions(names: Sequence[str], vertices: FloatArray) -> list[Doubt]:
    """Find the same from names and corresponding positions (m, n, 3), all finite."""
    sizes = np.sqrt(((vertices - vertices.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))
    has_size = (sizes > 0) & np.ptp(vertices, axis=1).any(axis=1)
    if not has_size.all():
        points, kept = (tuple(compress(names, which)) for which in (~has_size, has_size))
        reason = "has no size: all its vertices are at one position"
        doubts = [Doubt("unlike", (name,), reason) for name in points]
        return doubts + (doubtful_positions(kept, vertices[has_size]) if kept else [])
    if len(names) < 2:
        return []
    distances = procrustes_distances(vertices / sizes[:, None, None], scale="remove")
    reflected = procrustes_distances(vertices / sizes[:, None, None], scale="remove", mirrored=True)
    factors = size_factors(sizes)
    mirrored = _find_mirrored(distances, reflected)
    opposite, nearer = mirrored[:, None] != mirrored, "fits the others better as its mirror image"
    reasons: dict[DoubtKind, dict[int, str]] = {
        "units": {i: size_in_words(factors[i]) for i in np.flatnonzero(factors != 1).tolist()},
        "mirrored": dict.fromkeys(np.flatnonzero(mirrored).tolist(), nearer),
        "far": _far(vertices.mean(axis=1), sizes, factors),
        "unlike": _unlike(np.where(opposite, reflected, distances)),
    }
    doubts = [Doubt(kind, (names[i],), found[i]) for kind, found in reasons.items() for i in found]
    n_groups, group = connected_components(distances <= SAME_SHAPE, directed=False)
    alike = [tuple(compress(names, group == i)) for i in range(n_groups)]
    reason = "are the same shape, but for a motion and their size"
    return doubts + [Doubt("twice", same, reason) for same in alike if len(same) > 1]


def _find_mirrored(distances: FloatArray, reflected: FloatArray) -> BoolArray:
    """Tell which shapes, (m,), are mirror images of most."""
    # The agreement of two shapes is 1 if their thinnest directions are the same, and −1 if they are opposite, so that the
    # mirror image is nearer. The leading eigenvector of the agreements has one sign for each side. With the least
    # singular value σ₃ of the product XᵀWY of centred vertices X and Y and weights W, reflected² − distance² = ±4 σ₃;
    # for a shape and itself, 4 σ₃ is the square of its thickness.
    m = len(distances)
    thickness = np.diag(reflected)
    scale = thickness[:, None] * thickness
    thick = scale > MIN_THICKNESS**2
    agreement = np.divide(reflected**2 - distances**2, scale, out=np.zeros((m, m)), where=thick)
    side = np.where(np.linalg.eigh(agreement)[1][:, -1] < 0, -1.0, 1.0)
    if side.sum() < 0 or (side.sum() == 0 and side[0] < 0):
        side = -side
    others = _without_diagonal(agreement * side[:, None] * side)
    is_clear = np.median(others, axis=1) > MIN_SHAPE_AGREEMENT
    if m < MIN_SHAPES:
        is_clear &= (reflected < MIRROR_RATIO * distances).any(axis=1)
    return np.asarray((side < 0) & is_clear & (np.median(others) > MIN_SAMPLE_AGREEMENT))


def _without_diagonal(values: FloatArray) -> FloatArray:
    m = len(values)
    return np.asarray(values[~np.eye(m, dtype=bool)].reshape(m, m - 1))


def _far(centroids: FloatArray, sizes: FloatArray, factors: FloatArray) -> dict[int, str]:
    away = np.linalg.norm(centroids - np.median(centroids, axis=0), axis=1)
    limit = max(FAR_SIZES * float(np.median(sizes)), MAX_DEVIATIONS * MAD_TO_SD * float(np.median(away)))
    is_far = (away > limit) & (factors == 1) & (len(sizes) >= MIN_SHAPES)
    rows = np.flatnonzero(is_far).tolist()
    return {i: f"lies {away[i]:.4g} away from the others, which alignment removes" for i in rows}


def _unlike(distances: FloatArray) -> dict[int, str]:
    if len(distances) < MIN_SHAPES:
        return {}
    typical = np.median(_without_diagonal(distances), axis=1)
    usual = float(np.median(typical))
    spread = MAD_TO_SD * float(np.median(np.abs(typical - usual)))
    limit = max(UNLIKE_RATIO * usual, usual + MAX_DEVIATIONS * spread, SAME_SHAPE)
    start, ending = "differs from the others by", f"of its size; they differ by {usual:.3g}"
    return {i: f"{start} {typical[i]:.3g} {ending}" for i in np.flatnonzero(typical > limit).tolist()}


METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}  # metres in each unit of length
"""Units of length, in metres."""
# A size might be in another unit if it is more than this times the median size, or if the median is more than this times
# the size; units explain a ratio of sizes if they give it within this factor; chosen.
MIN_SIZE_RATIO = 2.0
MIN_SIZE_GAP = 5.0  # sizes are in two units if a size, over the next smaller size, exceeds this; chosen
MAX_DEVIATIONS = 6.0  # standard deviations from the median, beyond which a value is an outlier; chosen
MAD_TO_SD = 1.4826  # standard deviation over median absolute deviation, in a normal distribution
# (unit of a shape, unit of the other shapes), or the reverse; the first pair is taken if several explain a ratio equally
USUAL_UNITS = ("mm", "m"), ("mm", "cm"), ("cm", "m"), ("mm", "in")


def size_factors(sizes: FloatArray) -> FloatArray:
    """Find sizes so different from the others that it may be a matter of units.

    Such a size is more than twice or less than half the median, and farther from it than six
    standard deviations (robust, of the logarithms); or sizes (m,) > 0 fall in two groups, one five
    times as large. Returns their ratio to the median of the others, and 1 for all others.

    Examples
    --------
    >>> size_factors(np.array([1.0, 1.2, 1050.0, 0.9, 1.1])).tolist()
    [1.0, 1.0, 1000.0, 1.0, 1.0]
    """
    if not len(sizes):
        return np.ones(0)
    logarithms = np.log(sizes)
    off = np.abs(logarithms - np.median(logarithms))
    odd = np.asarray(off > max(np.log(MIN_SIZE_RATIO), MAX_DEVIATIONS * MAD_TO_SD * float(np.median(off))))
    ordered = np.sort(sizes)
    gaps = ordered[1:] / ordered[:-1]
    if not odd.any() and gaps.max(initial=1.0) > MIN_SIZE_GAP:
        i = int(gaps.argmax())
        odd = sizes > ordered[i] if 2 * (i + 1) >= len(sizes) else sizes <= ordered[i]
    return np.where(odd, sizes / np.median(sizes[~odd]), 1.0)


def likely_units(factor: float) -> tuple[str, str] | None:
    """Find the units, of a shape and of the others, that explain a ratio of sizes; None if none do.

    >>> likely_units(940), likely_units(1 / 27), likely_units(1.3), likely_units(1e9)
    (('mm', 'm'), ('in', 'mm'), None, None)
    """
    pairs = [*USUAL_UNITS, *(pair[::-1] for pair in USUAL_UNITS), *permutations(METRES, 2)]
    errors = [abs(np.log(factor * METRES[unit] / METRES[usual])) for unit, usual in pairs]
    best = int(np.round(errors, 9).argmin())
    return pairs[best] if errors[best] < min(abs(np.log(factor)), np.log(MIN_SIZE_RATIO)) else None


def size_in_words(factor: float) -> str:
    """Tell the ratio of a size to the size of the others, and which units would explain it."""
    text = f"is {factor:.4g} times as large as the others"
    units = likely_units(factor)
    return f"{text}: in {units[0]}, if they are in {units[1]}?" if units else text


def geodesic_distortions(
    shapes: CorrespondedShapes,
    *,
    n_samples: int = N_SAMPLES,
    engine: str | None = None,
    progress: Callable[[str], None] = lambda name: None,
) -> FloatArray:
    """Compute how much geodesic distances differ between each pair of m shapes, in any pose.

    Returns root mean square differences (m, m) of distances over √(area of the shape), between
    n_samples farthest points of the mean, beginning with the vertex farthest from its centroid.
    See `distance_engine` for engines; progress is called with the name of each shape before its
    distances are computed. O(m n_samples n log n) time.
    """
    if n_samples < 1:
        raise SettingError(f"n_samples = {n_samples} is not at least 1")
    shares = shapes.area_weights
    used = np.flatnonzero(shares > 0)
    points = generalised_procrustes(shapes.vertices, shares, "remove").mean[used]
    start = int(np.linalg.norm(points - shares[used] @ points, axis=1).argmax())
    samples = used[euclidean_farthest_points(points, min(n_samples, len(used)), start)]
    columns = []
    for i, name in enumerate(shapes.names):
        progress(name)
        mesh = shapes.mesh(i)
        between = distance_engine(mesh, engine).distances_from(samples)[:, samples]
        columns.append((between + between.T).ravel() / (2 * np.sqrt(mesh.area)))
    distances = np.array(columns)
    distances = distances[:, np.isfinite(distances).all(axis=0)]
    return np.array([np.sqrt(((distances - row) ** 2).mean(axis=1)) for row in distances])


def shape_tree(distances: FloatArray) -> FloatArray:
    """Merge the nearest groups of shapes repeatedly, by the average of symmetric distances (m, m).

    Returns a linkage matrix of ``scipy.cluster.hierarchy``, (m − 1, 4).
    """
    checked = _check_distances(distances)
    if len(checked) < 2:
        raise InputError("a tree needs at least two shapes")
    return np.asarray(linkage(squareform(checked, checks=False), "average"))


def classical_scaling(distances: FloatArray, dim: int = 2) -> FloatArray:
    """Place shapes as points (m, dim) that approximate symmetric distances (m, m).

    Coordinates are centred, in decreasing order of spread, and 0 along axes that are not needed.

    >>> classical_scaling([[0, 1, 3], [1, 0, 2], [3, 2, 0]], dim=1).round(6).ravel()
    array([-1.333333, -0.333333,  1.666667])
    """
    checked = _check_distances(distances)
    m = len(checked)
    points = np.zeros((m, dim))
    points[:, :m] = spectral.classical_scaling(checked**2, np.ones(m), dim)[0]
    farthest = np.take_along_axis(points, np.abs(points).argmax(axis=0)[None], axis=0)
    return points * np.where(farthest < 0, -1.0, 1.0)


def _check_distances(distances: FloatArray) -> FloatArray:
    checked = numbers_of(distances, "distances", InputError)
    shape = checked.shape
    if len(shape) != 2 or shape[0] != shape[1] or not (np.isfinite(checked).all() and (checked >= 0).all()):
        raise InputError(f"distances of shape {shape}; give a square matrix of finite numbers of at least 0")
    if not np.allclose(checked, checked.T) or checked.diagonal().any():
        raise InputError("distances are not symmetric, or not 0 from a shape to itself")
    return checked
