"""Symmetries of one shape: maps onto itself, other than the identity, that keep its distances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from isomatch.correspondence import (
    IntervalCost,
    SignedPoints,
    alignment_residual,
    assign_points,
    iterative_closest_points,
    nearest_rows,
    nearest_under_rotation,
    signed_procrustes,
)
from isomatch.settings import SymmetrySettings
from isomatch.values.arrays import FloatArray, IntArray

# samples, far from each other, that determine a map;
# three points determine an isometry of a surface, two more its errors
N_ANCHORS = 5

BEAM = 60  # partial assignments that are kept; docs/lab/benchmarks.md, symmetry

GENERATORS = 6  # symmetries whose products are tried, too; chosen, not measured

# mean cosine between normals, of either sign, from which a map is a symmetry; docs/lab/benchmarks.md, symmetry
LEAST_ORIENTATION = 0.7

N_SAMPLES = 200  # samples among which symmetries are searched; chosen: spacing 0.08, less than SAME_SYMMETRY

STEPS = 12  # iterations of closest points from each assignment; docs/lab/benchmarks.md, symmetry

# mean distance, in √area, from which a map is not the identity; selection.rival_distance: less is a variant
LEAST_MOVED = 0.15

SAME_SYMMETRY = 0.1  # mean distance, in √area, from which two maps differ; the spacing of the samples

# residual, over the largest of a symmetry, up to which a map serves in products; chosen, not measured
NEAR = 1.5

# the same, up to which its orientation need not be clear, as of one-sided surfaces; chosen, not measured
EXACT = 0.75

EXACTLY = IntervalCost(tolerance=0.0, inside=0.0)


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A map of a shape onto itself that nearly keeps distances.

    Parameters
    ----------
    image_row : (r,) array of int
        Sample that each sample goes to.
    residual : float
        Misfit of the distance descriptors, in units of √(average distance): about 0.1 for an exact symmetry, from the
        spacing of the samples.
    orientation : float
        Near 1 for a rotation, near −1 for a mirror image; 0 where the shape has no triangles.
    moved : float
        Mean distance between a sample and its image, in √area.
    """

    image_row: IntArray
    residual: float
    orientation: float
    moved: float


def find_symmetries(
    points: SignedPoints,
    distances: FloatArray,
    orientation: Callable[[IntArray], float],
    settings: SymmetrySettings,
) -> tuple[Symmetry, ...]:
    """Find maps of a shape onto itself.

    Parameters
    ----------
    points : SignedPoints
        Descriptors of r samples, evenly spread, as is every prefix of them.
    distances : (r, r) array of float
        Geodesic distances between them, in √area.
    orientation : callable
        Orientation of a map of the samples (r,).
    settings : SymmetrySettings

    Returns
    -------
    tuple of Symmetry
        Best residual first. Of a continuous group, or one of many elements, some.

    Notes
    -----
    Points far from each other are assigned to other samples so that all distances agree, point by point, with the best
    partial assignments kept that differ. Each assignment is a first alignment of the descriptors with themselves, for
    iterative closest points. O(beam · samples · log) for the assignments and O(starts · samples² · rank) for the rest.
    """
    n = min(N_SAMPLES, len(distances))
    largest = settings.largest_residual / np.sqrt(len(distances))
    few, between = points.at(np.arange(n)), distances[:n, :n]
    anchors = farthest_rows(between, N_ANCHORS)
    assigned = _assignments(between, anchors, settings)
    if not len(assigned):
        return ()
    to_anchors = between[:, anchors]
    starts = np.array([nearest_rows(between[:, images], to_anchors) for images in assigned])
    alignments = iterative_closest_points(few, few, starts, STEPS)
    found: list[tuple[Symmetry, FloatArray]] = []

    def add(rotation: FloatArray) -> None:
        image_row = nearest_under_rotation(points, points, rotation)
        moved = distances[image_row, np.arange(len(distances))].mean()
        repeats = any(distances[image_row, known.image_row].mean() < SAME_SYMMETRY for known, _ in found)
        if moved < LEAST_MOVED or repeats:
            return
        rotation = signed_procrustes(points, points.at(image_row))
        image_row = nearest_under_rotation(points, points, rotation)
        images = points.at(image_row)
        rotation = signed_procrustes(points, images)
        residual = alignment_residual(points, images, rotation)
        if residual > NEAR * largest:
            return
        side = orientation(image_row)
        if side == 0 or abs(side) >= LEAST_ORIENTATION or residual <= EXACT * largest:
            found.append((Symmetry(image_row, residual, side, float(moved)), rotation))

    for alignment in sorted(alignments, key=lambda each: each.residual):
        add(alignment.rotation)
    generators = [rotation for _, rotation in found[:GENERATORS]]
    for first, second in product(generators, repeat=2):  # two mirror images make a rotation
        add(second @ first)
    symmetries = [symmetry for symmetry, _ in found if symmetry.residual <= largest]
    return tuple(sorted(symmetries, key=lambda each: each.residual))


def describe_symmetries(symmetries: Sequence[Symmetry]) -> str:
    """Count the symmetries in words; empty if there are none. Groups are not always found whole."""
    sides = np.sign([symmetry.orientation for symmetry in symmetries])
    counts = [
        ((sides > 0).sum(), "rotation", "rotations"),
        ((sides < 0).sum(), "mirror image", "mirror images"),
        ((sides == 0).sum(), "map onto itself", "maps onto itself"),
    ]
    named = [f"{n} {several if n > 1 else one}" for n, one, several in counts if n]
    return ("at least " if len(symmetries) > 1 else "") + " and ".join(named)


def farthest_rows(distances: FloatArray, count: int, first: Sequence[int] = ()) -> IntArray:
    """Rows far from each other, after some first ones; by default after the most remote one."""
    rows = list(first) or [int(distances.mean(axis=1).argmax())]
    while len(rows) < min(count, len(distances)):
        rows.append(int(distances[rows].min(axis=0).argmax()))
    return np.array(rows)


def _assignments(distances: FloatArray, anchors: IntArray, settings: SymmetrySettings) -> IntArray:
    """Rows (h, m) that m anchors are assigned to, with like distances; no two alike, none near the identity."""
    remoteness = distances.mean(axis=1)
    exact = distances[np.ix_(anchors, anchors)]
    unary = 0.5 * np.abs(remoteness - remoteness[anchors, None])
    assigned, _ = assign_points(distances, exact, exact, unary, EXACTLY, BEAM, LEAST_MOVED)
    moved = distances[assigned, anchors].mean(axis=1)
    far: IntArray = assigned[moved > LEAST_MOVED][: settings.most]
    return far
