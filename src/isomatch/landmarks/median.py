"""Landmarks that several templates give for one shape, as one: their geometric median on the surface."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from isomatch.assets import SurfaceLike, surface_from
from isomatch.errors import LandmarkError
from isomatch.landmarks.curves import drawn_curve, equally_spaced
from isomatch.landmarks.placing import nearest_on_surface
from isomatch.landmarks.shape_landmarks import Landmarks
from isomatch.surfaces import Graph, Mesh, PointCloud
from isomatch.values.arrays import BoolArray, FloatArray

logger = logging.getLogger(__name__)

MOST_STEPS = 1000
TOLERANCE = 1e-12  # of the extent of the points: movement in the last step


def median_landmarks(several: Sequence[Landmarks], surface: SurfaceLike) -> Landmarks:
    """Join the landmarks that several templates give for one shape.

    Parameters
    ----------
    several : sequence of Landmarks
        Of one shape, such as `carry_landmarks` returns for each template. They are joined by name, or in order if all
        have the same names.
    surface : Mesh, PointCloud, path_like, tuple or object
        The shape.

    Returns
    -------
    Landmarks
        The geometric medians, moved to the nearest points of the surface, in the order of the first template; points of a
        curve are equally spaced again. ``spread`` is the mean distance of the given points from them, nan of one, and
        ``expected_error`` the median of those given.

    Raises
    ------
    LandmarkError
        If there are none, or the names do not tell which belong together.

    Notes
    -----
    The geometric median minimises the sum of distances (Weiszfeld 1937), so that one wrong template in three moves a
    point little. Zhang et al., *Automated landmarking via multiple templates*, PLOS ONE 2022, use medians likewise.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> several = [Landmarks([[1, 1, 0]]), Landmarks([[1, 1, 0]]), Landmarks([[4, 4, 0]])]
    >>> joined = median_landmarks(several, square)
    >>> joined.positions.round(6).tolist(), joined.spread.round(3).tolist()
    ([[1.0, 1.0, 0.0]], [1.414])
    """
    if not several:
        raise LandmarkError("no landmarks to join; give those of at least one template")
    shape = surface_from(surface)
    if isinstance(shape, Graph):
        raise LandmarkError("landmarks have positions, and a graph has none; give a mesh or points")
    first = several[0]
    rows = _joined(several)
    points = np.stack([_taken(each.positions, own) for each, own in zip(several, rows)])  # (t, m, 3)
    errors = np.stack([_taken(each.expected_error, own) for each, own in zip(several, rows)])
    positions = geometric_median(points)
    found = np.asarray(np.isfinite(positions).all(axis=1))
    if found.any():
        near = nearest_on_surface(shape, positions[found])
        positions[found] = near.interpolated(shape.vertices)
    for curve in first.curves:
        of = list(curve.rows)
        if found[of].all() and len(of) > 1:
            positions[of] = respaced_curve(shape, positions[of], len(of), curve.closed, curve.name)
    apart = np.linalg.norm(points - positions, axis=2)
    apart[:, np.isfinite(apart).sum(axis=0) == 1] = np.nan  # one template has no spread
    return Landmarks(
        positions, first.names, first.curves, _over_templates(np.median, errors),
        _over_templates(np.mean, apart), first.systems,
    )  # fmt: skip


def respaced_curve(
    surface: Mesh | PointCloud, points: FloatArray, n: int, closed: bool, name: str
) -> FloatArray:
    """Draw a curve through points of a surface, and return n points of the surface at equal distances along it."""
    path = drawn_curve(surface, points, closed, name)
    piece, share = equally_spaced(path, n, closed)
    between = path[piece] + share[:, None] * (path[piece + 1] - path[piece])
    return nearest_on_surface(surface, between).interpolated(surface.vertices)


def geometric_median(points: FloatArray) -> FloatArray:
    """Find the points (m, 3) with the least sum of distances from points (t, m, 3); nan rows are left out.

    Examples
    --------
    >>> geometric_median(np.array([[[0.0, 0, 0]], [[1, 0, 0]], [[9, 0, 0]]])).round(6)
    array([[1., 0., 0.]])
    """
    there = np.asarray(np.isfinite(points).all(axis=2))[:, :, None]
    given = np.where(there, points, 0.0)
    count = there.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        middle = given.sum(axis=0) / count
    if (count <= 2).all():
        return np.asarray(middle)
    extent = float(np.abs(np.where(there, given - np.nan_to_num(middle), 0.0)).max())
    for _ in range(MOST_STEPS if extent > 0 else 0):
        apart = np.linalg.norm(given - middle, axis=2, keepdims=True)
        weights = np.where(there, 1.0 / np.maximum(apart, TOLERANCE * extent), 0.0)
        with np.errstate(invalid="ignore"):
            moved = (weights * given).sum(axis=0) / weights.sum(axis=0)
        step = np.nan_to_num(np.abs(moved - middle)).max()
        middle = np.where(count > 2, moved, middle)
        if step <= TOLERANCE * extent:
            break
    return np.where(count > 2, _least(given, there, middle), middle)


def _least(given: FloatArray, there: BoolArray, middle: FloatArray) -> FloatArray:
    """Of points (m, 3) and those given, the ones with the least sum of distances: a median may be one that is given."""
    among = np.stack([middle, *np.where(there, given, np.nan)])
    apart = np.linalg.norm(among[:, None] - given, axis=3)  # (q, t, m)
    total = np.where(there[:, :, 0], apart, 0.0).sum(axis=1)
    best = np.where(np.isnan(total), np.inf, total).argmin(axis=0)
    return np.asarray(among[best, np.arange(among.shape[1])])


def _joined(several: Sequence[Landmarks]) -> list[list[int | None]]:
    """For each template, which of its landmarks belongs to each of the first."""
    names = several[0].names
    if all(each.names == names for each in several):
        return [list(range(len(names))) for _ in several]
    rows = []
    for each in several:
        place = {name: i for i, name in enumerate(each.names)}
        if len(place) < len(each) or "" in place:
            raise LandmarkError(
                "templates with different landmarks, of which several have one name, or none; give each a name of its own"
            )
        if alone := set(names) ^ set(place):
            logger.warning("not in all templates: %s", ", ".join(sorted(alone)))
        rows.append([place.get(name) for name in names])
    return rows


def _taken(values: FloatArray, rows: list[int | None]) -> FloatArray:
    padded = np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])
    return np.asarray(padded[[-1 if row is None else row for row in rows]])


def _over_templates(statistic: Callable[[FloatArray], Any], values: FloatArray) -> FloatArray:
    """Statistic over templates (t, m) of what is known; nan where nothing is."""
    return np.array(
        [statistic(each[np.isfinite(each)]) if np.isfinite(each).any() else np.nan for each in values.T]
    )
