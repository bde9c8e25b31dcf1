"""Which shapes are alike: distances between shapes, their tree, and a map of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.cluster.hierarchy import linkage
from scipy.spatial.distance import squareform

from isomatch import spectral
from isomatch._core.arrays import FloatArray, numbers_of
from isomatch._core.errors import InputError, SettingError
from isomatch.cohort.shape_statistics.procrustes import generalised_procrustes
from isomatch.cohort.shape_statistics.shapes import CorrespondedShapes
from isomatch.geodesics import distance_engine, euclidean_farthest_points

N_SAMPLES = 100


def geodesic_distortions(
    shapes: CorrespondedShapes,
    *,
    n_samples: int = N_SAMPLES,
    engine: str | None = None,
    progress: Callable[[str], None] = lambda name: None,
) -> FloatArray:
    """Compute how much geodesic distances differ between each pair of m shapes; a change of pose counts little.

    Returns root mean square differences (m, m) between distances, each divided by √(area of its shape), of n_samples
    farthest points of the mean, beginning with the vertex farthest from its centroid. `distance_engine` has the engines;
    progress is given the name of each shape before its distances are computed. O(m n_samples n log n) time.
    """
    if n_samples < 1:
        raise SettingError(f"n_samples = {n_samples} is not at least 1")
    shares = shapes.area_weights
    used = np.flatnonzero(shares > 0)
    points = generalised_procrustes(shapes.vertices, shares, "remove").mean[used]
    start = int(np.linalg.norm(points - shares[used] @ points, axis=1).argmax())
    samples = used[euclidean_farthest_points(points, min(n_samples, len(used)), start)]
    columns = []
    for i, name in enumerate(shapes.names):
        progress(name)
        mesh = shapes.mesh(i)
        between = distance_engine(mesh, engine).distances_from(samples)[:, samples]
        columns.append((between + between.T).ravel() / (2 * np.sqrt(mesh.area)))
    distances = np.array(columns)
    distances = distances[:, np.isfinite(distances).all(axis=0)]
    return np.array([np.sqrt(((distances - row) ** 2).mean(axis=1)) for row in distances])


def shape_tree(distances: FloatArray) -> FloatArray:
    """Merge the nearest groups of shapes again and again, by the average of their symmetric distances (m, m).

    Returns a linkage matrix of ``scipy.cluster.hierarchy``, (m − 1, 4).
    """
    checked = _checked(distances)
    if len(checked) < 2:
        raise InputError("a tree needs at least two shapes")
    return np.asarray(linkage(squareform(checked, checks=False), "average"))


def classical_scaling(distances: FloatArray, dim: int = 2) -> FloatArray:
    """Place shapes as points (m, dim) whose distances approximate symmetric ones (m, m), by classical scaling.

    Coordinates are centred, in decreasing order of spread; 0 along axes that the distances do not need.

    >>> classical_scaling([[0, 1, 3], [1, 0, 2], [3, 2, 0]], dim=1).round(6).ravel()
    array([-1.333333, -0.333333,  1.666667])
    """
    checked = _checked(distances)
    m = len(checked)
    points = np.zeros((m, dim))
    points[:, :m] = spectral.classical_scaling(checked**2, np.ones(m), dim)[0]
    farthest = np.take_along_axis(points, np.abs(points).argmax(axis=0)[None], axis=0)
    return points * np.where(farthest < 0, -1.0, 1.0)


def _checked(distances: FloatArray) -> FloatArray:
    checked = numbers_of(distances, "distances", InputError)
    shape = checked.shape
    if len(shape) != 2 or shape[0] != shape[1] or not (np.isfinite(checked).all() and (checked >= 0).all()):
        raise InputError(f"distances of shape {shape}; give a square matrix of finite numbers of at least 0")
    if not np.allclose(checked, checked.T) or checked.diagonal().any():
        raise InputError("distances are not symmetric, or not 0 from a shape to itself")
    return checked
