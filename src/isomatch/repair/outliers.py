"""Outliers of a point cloud: points far from all others, such as stray points of a scanner."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray

N_NEIGHBOURS = 8  # number of nearest points over which the distance from a point is averaged; chosen
# A point is far if its mean distance is more than this times the median mean distance of all points, and an
# outlier if it is also more than this times the median over its neighbours; chosen.
FAR_RATIO = 4.0
# A far point is also an outlier if its neighbours are scattered: the least of the three principal variances
# of their positions is more than this share of the sum, unlike on a surface; chosen.
SCATTER_SHARE = 0.06


def find_outliers(points: FloatArray) -> BoolArray:
    """Find points (n,) whose neighbours are four times the usual distance away, except on thin samples.

    Rusu et al., *Towards 3D point cloud based object maps*, 2008, compare distances to neighbours with
    those of all points. Here, a point stays if its neighbours are as far apart and lie on a surface.
    O(n log n).
    """
    kept = np.arange(len(points))
    while len(kept) > N_NEIGHBOURS + 1:
        distances, neighbours = cKDTree(points[kept]).query(points[kept], N_NEIGHBOURS + 1)
        distance = distances[:, 1:].mean(axis=1)
        far = np.flatnonzero(distance > FAR_RATIO * np.median(distance))
        around = points[kept][neighbours[far]]
        around = around - around.mean(axis=1, keepdims=True)
        variances = np.linalg.eigvalsh(around.transpose(0, 2, 1) @ around)
        scattered = variances[:, 0] > SCATTER_SHARE * variances.sum(axis=1)
        far = far[scattered | (distance[far] > FAR_RATIO * np.median(distance[neighbours[far, 1:]], axis=1))]
        if not len(far):
            break
        kept = np.delete(kept, far)
    is_outlier = np.ones(len(points), dtype=bool)
    is_outlier[kept] = False
    return is_outlier
