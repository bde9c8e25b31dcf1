"""Metric distortion: how much a map changes geodesic distances, at most and in the mean square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MapError
from isomatch._core.settings import generator
from isomatch.correspondence import Correspondence
from isomatch.geodesics import DistanceEngine, distance_engine
from isomatch.surfaces import Mesh

BLOCK_COLUMNS = 64  # number of distance columns in memory at a time; chosen


@dataclass(frozen=True)
class MetricDistortion:
    """Differences between distances d₁ of points and d₂ of their images.

    Parameters
    ----------
    linf : float
        ``½ max |d₁ − d₂|``; the Gromov–Hausdorff distance is its infimum over all maps.
    l2 : float
        Mean of (d₁ − d₂)², in squared units.
    truth : MetricDistortion, optional
        Distortion of the true correspondence, which is not 0 because real shapes are only nearly isometric.
    """

    linf: float
    l2: float
    truth: MetricDistortion | None = None


def metric_distortion(
    source: Mesh,
    target: Mesh,
    correspondence: Correspondence,
    truth: IntArray | None = None,
    *,
    n_rows: int = 1000,
    n_columns: int = 1000,
    same_points: bool = False,
    normalised: bool = True,
    seed: int = 0,
    engines: tuple[DistanceEngine, DistanceEngine] | None = None,
    unit: float | None = None,
) -> MetricDistortion:
    """Compare geodesic distances between random points with those between their images.

    Parameters
    ----------
    source, target : Mesh
        The surfaces.
    correspondence : Correspondence
        Map source → target; its vertices are judged. Vertices without an image are left out.
    truth : (q, 2) array of int, optional
        Rows (source vertex, target vertex). If given, points are drawn from these source vertices, and the distortion
        of the truth is returned as well.
    n_rows, n_columns : int
        Number of points, drawn without replacement, at the two ends of the distances.
    same_points : bool
        Take the rows from among the columns, as in the paper's table, so that the distances are those within one set of
        points. By default both are drawn independently.
    normalised : bool
        Divide the distances of each shape by its √area, so that scale does not count; otherwise keep mesh units.
    seed : int
        Seed of the draws.
    engines : two DistanceEngine, optional
        Distances on the source and on the target; by default by fast marching.
    unit : float, optional
        By what the distances of both shapes are divided, in place of each shape's √area: √area of the whole, for two
        parts.

    Returns
    -------
    MetricDistortion
        ``inf`` if two connected points have images that are not connected, or the reverse. Pairs that are not connected
        on either shape are left out.

    Raises
    ------
    MapError
        If the map does not fit the shapes, or no point has an image.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017; their table has the mean square over the distances of
    1000 random points. Computes n_rows distance columns on the source and up to as many on the target (twice with truth),
    and holds n_rows × n_columns numbers. Over a sample of points, ``linf`` is a lower bound.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> double = Mesh(2 * square.vertices, square.faces)
    >>> same = Correspondence([0, 1, 2, 3], 4)
    >>> metric_distortion(square, double, same)
    MetricDistortion(linf=0.0, l2=0.0, truth=None)
    >>> round(metric_distortion(square, double, same, normalised=False).linf, 4)  # half the diagonal
    0.7071
    """
    if correspondence.shape != (source.n_vertices, target.n_vertices):
        raise MapError(
            f"{correspondence!r} does not fit {source!r} and {target!r}; give the shapes that the map was made for"
        )
    image = correspondence.vertices
    pairs = np.column_stack([np.arange(len(image)), image]) if truth is None else truth
    pairs = pairs[correspondence.matched[pairs[:, 0]]]
    if not len(pairs):
        raise MapError(
            f"{correspondence!r} maps none of the points to be judged, so that no distances can be compared"
        )
    rng = generator(seed)
    if same_points:
        columns = pairs[rng.choice(len(pairs), min(n_columns, len(pairs)), replace=False)]
        rows = columns[:n_rows]
    else:
        rows, columns = (pairs[rng.permutation(len(pairs))[:count]] for count in (n_rows, n_columns))
    units = [unit or np.sqrt(mesh.area) if normalised else 1.0 for mesh in (source, target)]
    source_engine, target_engine = engines or (distance_engine(source), distance_engine(target))
    source_distances = distance_table(source_engine, rows[:, 0], columns[:, 0]) / units[0]

    def against(row_images: IntArray, column_images: IntArray) -> tuple[float, float]:
        target_distances = distance_table(target_engine, row_images, column_images) / units[1]
        joined = np.isfinite(source_distances) | np.isfinite(target_distances)
        change = np.abs(source_distances[joined] - target_distances[joined])
        return float(change.max(initial=0.0) / 2), float((change**2).sum() / max(change.size, 1))

    true = None if truth is None else MetricDistortion(*against(rows[:, 1], columns[:, 1]))
    return MetricDistortion(*against(image[rows[:, 0]], image[columns[:, 0]]), true)


def distance_table(engine: DistanceEngine, rows: IntArray, columns: IntArray) -> FloatArray:
    """Distances (r, c) between two lists of points.

    Costs one distance column for each distinct row; 64 columns are held at a time.
    """
    sources, place = np.unique(rows, return_inverse=True)
    blocks = [
        engine.distances_from(sources[first : first + BLOCK_COLUMNS])[:, columns]
        for first in range(0, len(sources), BLOCK_COLUMNS)
    ]
    table: FloatArray = np.concatenate(blocks)[place]
    return table
