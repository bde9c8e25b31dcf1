"""Outliers of a point cloud: points far from all others, as stray ones of a scanner."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray

N_NEAREST = 8  # neighbours
FAR = 4.0  # mean distance to them, over the median of all points or of theirs, from which a point is far from others
SOLID = 0.06  # least of the three variances of neighbours, over their sum: of scattered points, and not of a surface


def outliers(points: FloatArray) -> BoolArray:
    """Find points (n,) whose nearest others are four times as far as is usual, but for those of thinly sampled surfaces.

    Rusu et al., *Towards 3D point cloud based object maps*, 2008, compare distances to neighbours with those of all
    points. Here, points with neighbours as far apart as they are stay if these lie on a surface. O(n log n).
    """
    kept = np.arange(len(points))
    while len(kept) > N_NEAREST + 1:
        apart, near = cKDTree(points[kept]).query(points[kept], N_NEAREST + 1)
        distance = apart[:, 1:].mean(axis=1)
        far = np.flatnonzero(distance > FAR * np.median(distance))
        around = points[kept][near[far]]
        around = around - around.mean(axis=1, keepdims=True)
        variances = np.linalg.eigvalsh(around.transpose(0, 2, 1) @ around)
        scattered = variances[:, 0] > SOLID * variances.sum(axis=1)
        far = far[scattered | (distance[far] > FAR * np.median(distance[near[far, 1:]], axis=1))]
        if not len(far):
            break
        kept = np.delete(kept, far)
    is_outlier = np.ones(len(points), dtype=bool)
    is_outlier[kept] = False
    return is_outlier
