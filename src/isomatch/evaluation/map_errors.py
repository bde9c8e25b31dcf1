"""The Princeton protocol: geodesic errors of a map against the truth, and their cumulative curve."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MapError
from isomatch._core.settings import generator
from isomatch.correspondence import Correspondence
from isomatch.geodesics import DistanceEngine, distance_engine, pair_distances
from isomatch.matching import COVERAGE_RADIUS, covered_share
from isomatch.repair import without_seams
from isomatch.surfaces import Mesh, PrecisePoints

CURVE_LIMIT = 0.25  # largest error that curves show, in √(target area); as in published curves
THRESHOLDS = np.linspace(0.0, CURVE_LIMIT, 101)  # errors of the points of a curve, in √(target area); chosen
# tables have the shares of points with at most these errors, in √(target area); chosen
TABLE_THRESHOLDS = (0.05, 0.10, 0.25)
# error of a vertex without an image in mean errors, in √(target area); chosen: about the size of the shape
UNMATCHED_ERROR = 1.0


@dataclass(frozen=True, eq=False)
class SidedErrors:
    """Errors (q,) of one map by `geodesic_errors`, against the direct and, if known, the mirrored truth."""

    direct: FloatArray
    mirrored: FloatArray | None = None

    @property
    def flipped(self) -> bool:
        """Whether the mirrored truth has the smaller mean error."""
        return self.mirrored is not None and bool(counted(self.mirrored).mean() < counted(self.direct).mean())

    @property
    def better(self) -> FloatArray:
        """(q,) errors against the better truth: one decision for the whole map, not one for each vertex."""
        return self.mirrored if self.mirrored is not None and self.flipped else self.direct


def geodesic_errors(
    target: Mesh,
    correspondence: Correspondence,
    truth: IntArray,
    n_points: int | None = None,
    seed: int = 0,
    engine: DistanceEngine | None = None,
    *,
    points: PrecisePoints | None = None,
    unit: float | None = None,
) -> FloatArray:
    """Geodesic distance on the target between image and truth, divided by √(target area).

    Parameters
    ----------
    target, correspondence : Mesh, Correspondence
        The vertices of the map source → target are judged.
    truth : (q, 2) array of int
        Rows (source vertex, target vertex).
    n_points, seed : int, optional
        Number of rows to judge, drawn without replacement, and seed of the draw; all by default.
    engine : DistanceEngine, optional
        Distances on the target; by default by fast marching.
    points : PrecisePoints, optional
        The q true images in triangles, if known; they replace the target vertices of ``truth``.
    unit : float, optional
        Length that divides distances instead, such as √area of the whole if the target is a part.

    Returns
    -------
    (q,) or (n_points,) array of float
        Errors; ``inf`` where the map has no image.

    Notes
    -----
    Kim, Lipman & Funkhouser, *Blended Intrinsic Maps*, SIGGRAPH 2011. One front for each distinct
    true image, which by fast marching goes no farther than the image; no n × n matrix.
    """
    if n_points is not None and n_points < len(truth):
        rows = np.sort(generator(seed).choice(len(truth), n_points, replace=False))
        truth = truth[rows]
        points = None if points is None else PrecisePoints(points.corners[rows], points.barycentric[rows])
    image = correspondence.vertices[truth[:, 0]]
    matched = image >= 0
    errors = np.full(len(truth), np.inf)
    engine = engine or distance_engine(target)
    if points is None:
        distances = pair_distances(engine, np.column_stack([truth[matched, 1], image[matched]]))
    else:
        points = PrecisePoints(points.corners[matched], points.barycentric[matched])
        distances = _distances_to_points(target, engine, image[matched], points)
    errors[matched] = distances / (np.sqrt(target.area) if unit is None else unit)
    return errors


def _distances_to_points(
    target: Mesh, engine: DistanceEngine, vertices: IntArray, points: PrecisePoints
) -> FloatArray:
    """Distance (m,) from each of m vertices to a point in a triangle."""
    # The distance is interpolated between the distances to the corners of the triangle; from a corner
    # itself, it is the length of a straight line.
    pairs = np.column_stack([np.repeat(vertices, 3), points.corners.ravel()])
    to_corners = pair_distances(engine, pairs).reshape(-1, 3)
    weights = points.barycentric
    interpolated = np.where(weights > 0, weights * to_corners, 0.0).sum(axis=1)  # 0 × inf is 0 here
    straight = np.linalg.norm(points.interpolated(target.vertices) - target.vertices[vertices], axis=1)
    is_corner = (points.corners == vertices[:, None]).any(axis=1)
    return np.asarray(np.where(is_corner, straight, interpolated))


def sided_errors(
    target: Mesh,
    correspondence: Correspondence,
    truth: IntArray,
    mirrored: IntArray | None = None,
    n_points: int | None = None,
    seed: int = 0,
    engine: DistanceEngine | None = None,
    *,
    points: PrecisePoints | None = None,
    unit: float | None = None,
) -> SidedErrors:
    """Geodesic errors against the direct and the mirrored truth of symmetric shapes, on the same rows.

    ``mirrored`` (q, 2) is the truth after a left–right flip of one shape, with the same source vertex
    in each row; ``points`` belong to the direct truth. Other options are as for `geodesic_errors`.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> rows = np.arange(4)
    >>> flip = Correspondence([1, 0, 3, 2], 4)
    >>> errors = sided_errors(square, flip, np.column_stack([rows, rows]), np.column_stack([rows, [1, 0, 3, 2]]))
    >>> errors.flipped, errors.direct.tolist(), errors.better.tolist()
    (True, [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0])
    """
    if mirrored is not None and not np.array_equal(truth[:, 0], mirrored[:, 0]):
        raise MapError("direct and mirrored truth differ in their source vertices; give the same rows")
    options = n_points, seed, engine
    direct = geodesic_errors(target, correspondence, truth, *options, points=points, unit=unit)
    if mirrored is None:
        return SidedErrors(direct)
    return SidedErrors(direct, geodesic_errors(target, correspondence, mirrored, *options, unit=unit))


def smallest(sides: Iterable[SidedErrors]) -> SidedErrors:
    """Take, point by point, the smallest error of several maps that read one result in equally good ways."""
    sides = list(sides)
    direct = np.min([side.direct for side in sides], axis=0)
    mirrored = [side.mirrored for side in sides if side.mirrored is not None]
    return SidedErrors(direct, np.min(mirrored, axis=0) if mirrored else None)


def counted(errors: FloatArray) -> FloatArray:
    """Errors as they enter means: a vertex without an image counts as √(target area)."""
    return np.where(np.isfinite(errors), errors, UNMATCHED_ERROR)


def cumulative_curve(errors: FloatArray, thresholds: ArrayLike = THRESHOLDS) -> FloatArray:
    """Share of errors at or below each threshold."""
    return np.searchsorted(np.sort(errors), thresholds, side="right") / max(len(errors), 1)


def area_under_curve(errors: FloatArray, limit: float = CURVE_LIMIT) -> float:
    """Area under the cumulative curve on [0, limit], divided by the limit: 0 to 1, where 1 is perfect.

    >>> area_under_curve(np.array([0.0, 0.125, np.inf, np.inf]))
    0.375
    """
    return float(np.clip(1 - errors / limit, 0, 1).mean())  # exact, as the curve is a step function


def coverage(target: Mesh, correspondence: Correspondence, reach: float = COVERAGE_RADIUS) -> float:
    """Share of the target's area that is near an image, as in ``Quality.coverage``.

    A target vertex is covered, with its area, when an image lies within the reach along edges, in
    √(target area). With 0, only images themselves are covered: even a good map between independent
    triangulations then stays well below 1, and a coarse source covers little of a fine target.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> half = Correspondence([0, 0, 1, 1], 4)
    >>> round(coverage(square, half), 3), round(coverage(square, half, reach=1.0), 3)
    (0.5, 1.0)
    """
    if correspondence.n_target != target.n_vertices:
        message = f"{correspondence!r} does not fit {target!r}; give the target that the map was made for"
        raise MapError(message)
    images, (welded, seams) = correspondence.vertices[correspondence.matched], without_seams(target)
    return covered_share(welded, seams.new_index[images] if seams else images, reach)


def cycle_errors(
    source: Mesh,
    forth: Correspondence,
    back: Correspondence,
    n_points: int | None = None,
    seed: int = 0,
    engine: DistanceEngine | None = None,
) -> FloatArray:
    """Geodesic distance on the source from a vertex to its image under both maps, over √(source area).

    For n_points random vertices, or all; ``inf`` where either map has no image. It computes
    distances from each of these vertices.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> cycle_errors(square, Correspondence([1, 2, 3, 0], 4), Correspondence([3, 0, 1, 1], 4))
    array([0., 0., 1., 0.])
    """
    cycle = forth.then(back)
    if cycle.shape != (source.n_vertices, source.n_vertices):
        raise MapError(
            f"{forth!r} and {back!r} do not lead from {source!r} to itself; give maps source → target and back"
        )
    vertices = np.arange(source.n_vertices)
    return geodesic_errors(source, cycle, np.column_stack([vertices, vertices]), n_points, seed, engine)
