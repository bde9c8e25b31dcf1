"""How alike shapes are: distances, tree and map; and which hardly belong to a sample as they are."""

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

# Of seven sets of animals and people in many poses, of which up to a half was mirrored at random, these find 202 of 208,
# none of TOSCA victoria, whose poses differ most, and nothing wrong in any.
SAMPLE_AGREES = 0.35  # median agreement of all shapes: with less, poses differ too much to tell
SHAPE_AGREES = 0.15  # the same of one shape with the others
MIRRORED = 0.7  # times its distance: of fewer shapes, a mirror image must also be nearer by this
THINNEST = 0.01  # times its size: a shape twice as thick has no mirror image
SAME = 1e-5  # of its size: distance of one shape from itself in another file
FAR = 10.0  # sizes from the middle of all centroids
UNLIKE = 2.0  # times the usual distance from the others
FEWEST = 4  # shapes that tell what is usual
Kind: TypeAlias = Literal["units", "mirrored", "twice", "far", "unlike"]
N_SAMPLES = 100


class Doubt(NamedTuple):
    """Why shapes hardly belong to a sample as they are: a kind, see `doubtful_shapes`, and a reason in words."""

    kind: Kind
    names: tuple[str, ...]
    reason: str


def doubtful_shapes(shapes: CorrespondedShapes) -> list[Doubt]:
    """Find shapes that hardly belong to a sample as they are; look at them before a model is made.

    - *units*: the size is so different from others that it may be a matter of units, see `size_factors`.
    - *mirrored*: mirror images are nearer, in Procrustes distance without size, to most of the other shapes. They are
      not found among bodies whose poses differ more than left and right.
    - *twice*: two shapes are the same but for a motion and their size.
    - *far*: of four shapes or more, the centroid lies more than ten median sizes from the middle of all, and is an
      outlier of six standard deviations. Alignment removes it.
    - *unlike*: of four shapes or more, the median distance from the others is an outlier of six standard deviations,
      at least twice the usual one; or all vertices are at one position.

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
    """Find the same by names and finite corresponding positions (m, n, 3) alone, such as of some of the vertices."""
    sizes = np.sqrt(((vertices - vertices.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))
    has_size = (sizes > 0) & np.ptp(vertices, axis=1).any(axis=1)
    if not has_size.all():
        points, kept = (tuple(compress(names, which)) for which in (~has_size, has_size))
        reason = "has no size: all its vertices are at one position"
        told = [Doubt("unlike", (name,), reason) for name in points]
        return told + (doubtful_positions(kept, vertices[has_size]) if kept else [])
    if len(names) < 2:
        return []
    distances = procrustes_distances(vertices / sizes[:, None, None], scale="remove")
    reflected = procrustes_distances(vertices / sizes[:, None, None], scale="remove", mirrored=True)
    factors = size_factors(sizes)
    mirrored = _mirrored(distances, reflected)
    opposite = mirrored[:, None] != mirrored
    reasons: dict[Kind, dict[int, str]] = {
        "units": {i: told_factor(factors[i]) for i in np.flatnonzero(factors != 1).tolist()},
        "mirrored": dict.fromkeys(
            np.flatnonzero(mirrored).tolist(), "fits the others better as its mirror image"
        ),
        "far": _far(vertices.mean(axis=1), sizes, factors),
        "unlike": _unlike(np.where(opposite, reflected, distances)),
    }
    doubts = [Doubt(kind, (names[i],), told[i]) for kind, told in reasons.items() for i in told]
    n_groups, group = connected_components(distances <= SAME, directed=False)
    alike = [tuple(compress(names, group == each)) for each in range(n_groups)]
    reason = "are the same shape, but for a motion and their size"
    return doubts + [Doubt("twice", each, reason) for each in alike if len(each) > 1]


def _mirrored(distances: FloatArray, reflected: FloatArray) -> BoolArray:
    """Tell which shapes, (m,), are mirror images of most."""
    # two shapes agree by 1 if their thinnest directions do, and by −1 if these are opposite, so that the mirror image is
    # nearer. Signs of the leading eigenvector of the agreements tell the two sides.
    # reflected² − distance² = ±4 σ₃, with the least singular value σ₃ of XᵀWY: of a shape and itself, thickness²
    m = len(distances)
    thickness = np.diag(reflected)
    scale = thickness[:, None] * thickness
    agreement = np.divide(reflected**2 - distances**2, scale, out=np.zeros((m, m)), where=scale > THINNEST**2)
    side = np.where(np.linalg.eigh(agreement)[1][:, -1] < 0, -1.0, 1.0)
    if side.sum() < 0 or (side.sum() == 0 and side[0] < 0):
        side = -side
    others = (agreement * side[:, None] * side)[~np.eye(m, dtype=bool)].reshape(m, m - 1)
    is_clear = np.median(others, axis=1) > SHAPE_AGREES
    if m < FEWEST:
        is_clear &= (reflected < MIRRORED * distances).any(axis=1)
    return np.asarray((side < 0) & is_clear & (np.median(others) > SAMPLE_AGREES))


def _far(centroids: FloatArray, sizes: FloatArray, factors: FloatArray) -> dict[int, str]:
    away = np.linalg.norm(centroids - np.median(centroids, axis=0), axis=1)
    limit = max(FAR * float(np.median(sizes)), DEVIATIONS * TO_STANDARD * float(np.median(away)))
    is_far = (away > limit) & (factors == 1) & (len(sizes) >= FEWEST)
    rows = np.flatnonzero(is_far).tolist()
    return {i: f"lies {away[i]:.4g} away from the others, which alignment removes" for i in rows}


def _unlike(distances: FloatArray) -> dict[int, str]:
    m = len(distances)
    if m < FEWEST:
        return {}
    typical = np.median(distances[~np.eye(m, dtype=bool)].reshape(m, m - 1), axis=1)
    usual = float(np.median(typical))
    spread = TO_STANDARD * float(np.median(np.abs(typical - usual)))
    rows = np.flatnonzero(typical > max(UNLIKE * usual, usual + DEVIATIONS * spread, SAME)).tolist()
    return {
        i: f"differs from the others by {typical[i]:.3g} of its size; they differ by {usual:.3g}"
        for i in rows
    }


METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Units of length, in metres."""
SIZE_FACTOR = 2.0  # from the median size: less is not a matter of units, of which 2.54 is the smallest factor
SIZE_GAP = 5.0  # between two sizes that follow each other: no sample of one kind has it
DEVIATIONS = 6.0  # median absolute deviations, scaled to standard ones, from the median: beyond is an outlier
TO_STANDARD = 1.4826  # times the median absolute deviation is the standard deviation of a normal distribution
# of two pairs with one factor, what is tried first
USUAL = ("mm", "m"), ("mm", "cm"), ("cm", "m"), ("mm", "in")


def size_factors(sizes: FloatArray) -> FloatArray:
    """Find sizes so different from the others that it may be a matter of units.

    That is more than twice or less than half the median, and farther from it than six standard deviations (robust, of
    the logarithms), or where sizes (m,) > 0 fall in two groups, one five times as large. Returns how many times as large
    as the median of the others each of these is, and 1 for all others.

    Examples
    --------
    >>> size_factors(np.array([1.0, 1.2, 1050.0, 0.9, 1.1])).tolist()
    [1.0, 1.0, 1000.0, 1.0, 1.0]
    """
    if not len(sizes):
        return np.ones(0)
    logarithms = np.log(sizes)
    off = np.abs(logarithms - np.median(logarithms))
    odd = np.asarray(off > max(np.log(SIZE_FACTOR), DEVIATIONS * TO_STANDARD * float(np.median(off))))
    ordered = np.sort(sizes)
    gaps = ordered[1:] / ordered[:-1]
    if not odd.any() and gaps.max(initial=1.0) > SIZE_GAP:
        at = int(gaps.argmax())
        odd = sizes > ordered[at] if 2 * (at + 1) >= len(sizes) else sizes <= ordered[at]
    return np.where(odd, sizes / np.median(sizes[~odd]), 1.0)


def likely_units(factor: float) -> tuple[str, str] | None:
    """Name the units, of the shape and of the others, that explain why it is so many times as large; None if none does.

    >>> likely_units(940), likely_units(1 / 27), likely_units(1.3), likely_units(1e9)
    (('mm', 'm'), ('in', 'mm'), None, None)
    """
    turned = tuple((others, own) for own, others in USUAL)
    pairs = [*USUAL, *turned, *permutations(METRES, 2)]
    apart = [abs(np.log(factor * METRES[own] / METRES[others])) for own, others in pairs]
    best = int(np.round(apart, 9).argmin())
    return pairs[best] if apart[best] < min(abs(np.log(factor)), np.log(SIZE_FACTOR)) else None


def told_factor(factor: float) -> str:
    """Say that a shape is so many times as large as the others, and which units would explain it."""
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
    """Compute how much geodesic distances differ between each pair of m shapes; a change of pose counts little.

    Returns root mean square differences (m, m) between distances, each divided by √(area of its shape), of n_samples
    farthest points of the mean, beginning with the vertex farthest from its centroid. `distance_engine` has the engines;
    progress is given the name of each shape before its distances are computed. O(m n_samples n log n) time.
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
    """Merge the nearest groups of shapes again and again, by the average of their symmetric distances (m, m).

    Returns a linkage matrix of ``scipy.cluster.hierarchy``, (m − 1, 4).
    """
    checked = _checked(distances)
    if len(checked) < 2:
        raise InputError("a tree needs at least two shapes")
    return np.asarray(linkage(squareform(checked, checks=False), "average"))


def classical_scaling(distances: FloatArray, dim: int = 2) -> FloatArray:
    """Place shapes as points (m, dim) whose distances approximate symmetric ones (m, m), by classical scaling.

    Coordinates are centred, in decreasing order of spread; 0 along axes that the distances do not need.

    >>> classical_scaling([[0, 1, 3], [1, 0, 2], [3, 2, 0]], dim=1).round(6).ravel()
    array([-1.333333, -0.333333,  1.666667])
    """
    checked = _checked(distances)
    m = len(checked)
    points = np.zeros((m, dim))
    points[:, :m] = spectral.classical_scaling(checked**2, np.ones(m), dim)[0]
    farthest = np.take_along_axis(points, np.abs(points).argmax(axis=0)[None], axis=0)
    return points * np.where(farthest < 0, -1.0, 1.0)


def _checked(distances: FloatArray) -> FloatArray:
    checked = numbers_of(distances, "distances", InputError)
    shape = checked.shape
    if len(shape) != 2 or shape[0] != shape[1] or not (np.isfinite(checked).all() and (checked >= 0).all()):
        raise InputError(f"distances of shape {shape}; give a square matrix of finite numbers of at least 0")
    if not np.allclose(checked, checked.T) or checked.diagonal().any():
        raise InputError("distances are not symmetric, or not 0 from a shape to itself")
    return checked
