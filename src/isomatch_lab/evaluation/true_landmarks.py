"""True landmarks: the few correct pairs of points that a benchmark gives to methods that need them."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import LandmarkError
from isomatch._core.settings import generator
from isomatch.geodesics import DistanceEngine, distance_engine
from isomatch_lab.sets import BenchmarkPair

N_LANDMARKS = 5  # number of true landmarks that a method is given, as in the paper
N_REFERENCES = 30  # number of true pairs with which all others are compared; chosen
RELIABLE_SHARE = 0.95  # share of the truth (distances agree best) that may be landmarks; chosen


def true_landmarks(
    pair: BenchmarkPair,
    count: int = N_LANDMARKS,
    seed: int = 0,
    engines: tuple[DistanceEngine, DistanceEngine] | None = None,
) -> IntArray:
    """Draw true pairs far from one another: farthest points of the source among those whose image is known.

    Parameters
    ----------
    pair : BenchmarkPair
        Two shapes and the truth.
    count : int
        Number of landmarks.
    seed : int
        Seed of the draw of references. The first landmark is the point farthest from the first reference.
    engines : two DistanceEngine, optional
        Distances on the source and on the target; by default by fast marching.

    Returns
    -------
    (count, 2) array of int
        Rows (source vertex, target vertex).

    Raises
    ------
    LandmarkError
        If the truth has too few reliable rows.

    Notes
    -----
    Published truth has a few wrong rows where limbs touch, such as one hand in place of the other. So distances to the
    references are compared on both shapes, and the 5 % of the rows with the largest differences are excluded.
    """
    references = pair.truth[generator(seed).integers(len(pair.truth), size=N_REFERENCES)]
    source, target = engines or (distance_engine(pair.source), distance_engine(pair.target))
    from_source = source.distances_from(references[:, 0])[:, pair.truth[:, 0]] / np.sqrt(pair.source.area)
    from_target = target.distances_from(references[:, 1])[:, pair.truth[:, 1]] / np.sqrt(pair.target.area)
    connected = np.isfinite(from_source) & np.isfinite(from_target)
    # points on other components count as √area apart
    difference = np.subtract(from_source, from_target, where=connected, out=np.ones(from_source.shape))
    descriptor_distance = np.abs(difference).mean(axis=0)
    reliable = np.flatnonzero(
        connected[0] & (descriptor_distance <= np.quantile(descriptor_distance, RELIABLE_SHARE))
    )
    if len(reliable) < count:
        raise LandmarkError(
            f"{pair.name}: only {len(reliable)} of {len(pair.truth)} true points are reliable, too few for {count} "
            "landmarks; ask for fewer, or use a set with denser truth"
        )
    rows = [reliable[from_source[0, reliable].argmax()]]
    nearest = np.full(len(reliable), np.inf)
    while len(rows) < count:
        distances = source.distances_from(pair.truth[rows[-1:], 0])[0]
        nearest = np.minimum(nearest, distances[pair.truth[reliable, 0]])
        rows.append(reliable[nearest.argmax()])
    return pair.truth[rows]
