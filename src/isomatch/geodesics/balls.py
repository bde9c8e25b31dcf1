"""Geodesic balls: the points near some centres and their distances, without whole columns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from isomatch.geodesics.front import Balls
from isomatch.geodesics.protocol import DistanceEngine

BLOCK = 64  # columns held at a time


def geodesic_balls(engine: DistanceEngine, centres: ArrayLike, radius: float) -> Balls:
    """Find the points within a distance of some centres.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of a space of n points.
    centres : (m,) array_like of int
        Points.
    radius : float
        In the units of the distances.

    Returns
    -------
    Balls
        The points of each ball, in increasing order, and their distances from its centre.

    Raises
    ------
    MeshError
        If ``centres`` names a point that does not exist.

    Notes
    -----
    The fronts of an engine that has a method ``balls``, as fast marching does, end at the radius. Of any other engine
    whole columns are asked, 64 at a time.

    Examples
    --------
    >>> from isomatch import distance_engine
    >>> line = np.abs(np.subtract.outer(np.arange(5.0), np.arange(5.0)))
    >>> geodesic_balls(distance_engine(line), [0, 3], 1.0)
    Balls(start=array([0, 2, 5]), points=array([0, 1, 2, 3, 4]), distances=array([0., 1., 1., 0., 1.]))
    """
    wanted = np.atleast_1d(np.asarray(centres))
    if hasattr(engine, "balls"):
        found: Balls = engine.balls(wanted, radius)
        return found
    parts = []
    for first in range(0, len(wanted), BLOCK):
        columns = engine.distances_from(wanted[first : first + BLOCK])
        parts += [
            (inside, column[inside]) for column in columns for inside in [np.flatnonzero(column <= radius)]
        ]
    return Balls.of(parts)
