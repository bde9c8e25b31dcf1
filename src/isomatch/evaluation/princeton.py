"""The Princeton protocol: geodesic error of a map against truth, and its cumulative curve."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.geodesics import distance_engine
from isomatch.maps import Correspondence
from isomatch.surfaces import Mesh

THRESHOLDS = np.linspace(0.0, 0.25, 101)


def geodesic_errors(
    target: Mesh, correspondence: Correspondence, truth: IntArray, n_points: int | None = None, seed: int = 0
) -> FloatArray:
    """Geodesic distance on the target between image and truth, divided by √(target area).

    Parameters
    ----------
    target : Mesh
        Target surface.
    correspondence : Correspondence
        Map source → target; its vertices are judged.
    truth : (q, 2) array of int
        Rows (source vertex, target vertex).
    n_points : int, optional
        Judge this many rows, drawn without replacement; all by default.
    seed : int
        Seeds the draw.

    Returns
    -------
    (q,) or (n_points,) array of float
        Errors; ``inf`` where the map has no image.

    Notes
    -----
    Kim, Lipman & Funkhouser, *Blended Intrinsic Maps*, SIGGRAPH 2011. One distance column for each distinct true image,
    in batches; no n × n matrix.
    """
    if n_points is not None and n_points < len(truth):
        truth = truth[np.sort(np.random.default_rng(seed).choice(len(truth), n_points, replace=False))]
    engine = distance_engine(target)
    image = correspondence.vertices[truth[:, 0]]
    wanted, column = np.unique(truth[:, 1], return_inverse=True)
    errors = np.zeros(len(truth))
    for first in range(0, len(wanted), 64):
        distances = engine.distances_from(wanted[first : first + 64])
        rows = np.flatnonzero((column >= first) & (column < first + 64))
        errors[rows] = distances[column[rows] - first, image[rows]]
    return np.where(image < 0, np.inf, errors / np.sqrt(target.area))


def cumulative_curve(errors: FloatArray, thresholds: FloatArray = THRESHOLDS) -> FloatArray:
    """Share of errors at or below each threshold."""
    return np.searchsorted(np.sort(errors), thresholds, side="right") / max(len(errors), 1)
