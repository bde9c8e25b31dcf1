"""Landmarks that several templates give for one shape, as one: their geometric median on the surface."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from isomatch.assets import SurfaceLike, surface_from
from isomatch.correspondence import geometric_median
from isomatch.errors import LandmarkError
from isomatch.landmarks.curves import drawn_curve, equally_spaced
from isomatch.landmarks.placing import nearest_on_surface
from isomatch.landmarks.shape_landmarks import Landmarks
from isomatch.surfaces import Graph, Mesh, PointCloud
from isomatch.values.arrays import FloatArray

logger = logging.getLogger(__name__)

COMMON = (
    0.5  # share of a template's expected error that is the same of all; measured with 3, 6 and 19 templates
)


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
        curve are equally spaced again. ``spread`` is the mean distance of the given points from them, nan of one.
        ``expected_error`` is the root of e² / 4 + spread² / t, where e is the median of those given by t templates; of
        one template it is e.

    Raises
    ------
    LandmarkError
        If there are none, or the names do not tell which belong together.

    Notes
    -----
    The geometric median minimises the sum of distances (Weiszfeld 1937), so that one wrong template in three moves a
    point little. Zhang et al., *Automated landmarking via multiple templates*, PLOS ONE 2022, use medians likewise. What
    templates do not have in common averages out; the other half of their error stays.

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
    count = np.isfinite(apart).sum(axis=0)
    apart[:, count == 1] = np.nan  # one template has no spread
    spread, alone = _over_templates(np.mean, apart), _over_templates(np.median, errors)
    together = np.hypot(COMMON * alone, spread / np.sqrt(np.maximum(count, 1)))
    expected = np.where(count == 1, alone, together)
    return Landmarks(positions, first.names, first.curves, expected, spread, first.systems)


def respaced_curve(
    surface: Mesh | PointCloud, points: FloatArray, n: int, closed: bool, name: str
) -> FloatArray:
    """Draw a curve through points of a surface, and return n points of the surface at equal distances along it."""
    path = drawn_curve(surface, points, closed, name)
    piece, share = equally_spaced(path, n, closed)
    between = path[piece] + share[:, None] * (path[piece + 1] - path[piece])
    return nearest_on_surface(surface, between).interpolated(surface.vertices)


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
