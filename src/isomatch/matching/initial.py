"""First maps from what the user knows: landmarks, a correspondence, or descriptors."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import FloatArray, IntArray
from isomatch.descriptors import GeodesicDistanceDescriptor
from isomatch.errors import DescriptorError, LandmarkError, MapError, some
from isomatch.matching.nearest import nearest_rows

LANDMARK_COLUMNS = 20  # leading descriptor columns that a few points can determine
OFF_DIAGONAL = 0.01  # penalty on mixing columns i and j, times (i − j)² and the mean squared descriptor
WEAKER = (0.001, 0.0001)  # as well, where a few points do not tell which penalty makes a good start
RIDGE = 0.001  # penalty on every entry; decides where the landmarks do not


def rotations_from_landmarks(
    target: GeodesicDistanceDescriptor,
    source: GeodesicDistanceDescriptor,
    at_target: IntArray,
    at_source: IntArray,
    off_diagonal: float = OFF_DIAGONAL,
) -> FloatArray:
    """Align the leading columns of two clouds at a few corresponding points.

    Parameters
    ----------
    target, source : GeodesicDistanceDescriptor
        The clouds.
    at_target, at_source : (h, m) array of int
        Rows of m corresponding points, for each of h starts.
    off_diagonal : float
        Penalty on mixing columns.

    Returns
    -------
    (h, 20, 20) array of float
        For each start the C with target[:, :20] · C ≈ source[:, :20]. Each column solves
        min ‖Y c − x‖² + Σᵢ (q s (i − j)² + 0.001 s) cᵢ², q the penalty and s the mean squared norm of the target's
        rows: near-isometric shapes have nearly equal spectra, so columns far from the diagonal mix little. Columns of
        the other sign stay 0.

    Notes
    -----
    Shamai & Kimmel 2017, initialisation from feature points.
    """
    k = min(LANDMARK_COLUMNS, len(target.signature), len(source.signature))
    leading = target.coordinates[:, :k]
    s = float((leading**2).sum(axis=1).mean())
    allowed = target.signature[:k, None] == source.signature[:k]  # (i, j)
    y, x = leading[at_target], source.coordinates[at_source][..., :k]  # (h, m, k)
    offset = np.subtract.outer(np.arange(k), np.arange(k))
    penalty = s * (off_diagonal * offset**2 + RIDGE)  # (i, j)
    gram, right = y.swapaxes(1, 2) @ y, y.swapaxes(1, 2) @ x  # (h, k, k)
    # for every column j: (gram restricted to allowed rows and columns, identity elsewhere) c = right_j
    mask = allowed.T[:, :, None] & allowed.T[:, None, :]  # (j, i, i')
    systems = np.where(mask, gram[:, None], 0.0) + np.eye(k) * penalty.T[:, None, :]
    columns = np.linalg.solve(systems, (right * allowed).swapaxes(1, 2)[..., None])[..., 0]  # (h, j, i)
    rotations: FloatArray = columns.swapaxes(1, 2)
    return rotations


def images_from_rotation(
    target: GeodesicDistanceDescriptor, source: GeodesicDistanceDescriptor, rotation: FloatArray
) -> IntArray:
    """Nearest target row of each source row, in as many leading columns as the rotation has."""
    k_target, k_source = rotation.shape
    return nearest_rows(target.coordinates[:, :k_target] @ rotation, source.coordinates[:, :k_source])


def rotation_from_functions(
    target: GeodesicDistanceDescriptor,
    source: GeodesicDistanceDescriptor,
    target_functions: FloatArray,
    source_functions: FloatArray,
    target_weights: FloatArray,
    source_weights: FloatArray,
) -> FloatArray:
    """Align two clouds by functions that should correspond: least squares F₁ᵀ W₁ C = F₂ᵀ W₂.

    Parameters
    ----------
    target, source : GeodesicDistanceDescriptor
        Clouds of all vertices.
    target_functions, source_functions : (n_t, q), (n_s, q) arrays of float
        Values of the same q functions (WKS, HKS, segments, anything) on both shapes.
    target_weights, source_weights : (n_t,), (n_s,) arrays of float
        Vertex areas.

    Returns
    -------
    (k_t, k_s) array of float
        C, with the same penalties off the diagonal as for landmarks.

    Notes
    -----
    Shamai & Kimmel 2017, initialisation from descriptors. Columns of X = Q W are orthogonal in the areas, so that XᵀA f
    holds W times the coefficients of f.
    """
    f_target = target.coordinates.T @ (target_weights[:, None] * target_functions)  # (k_t, q)
    f_source = source.coordinates.T @ (source_weights[:, None] * source_functions)
    rows = np.arange(f_target.shape[1])[None]
    as_target = GeodesicDistanceDescriptor(f_target.T, target.signature)
    as_source = GeodesicDistanceDescriptor(f_source.T, source.signature)
    rotation: FloatArray = rotations_from_landmarks(as_target, as_source, rows, rows)[0]
    return rotation


def checked_landmarks(landmarks: ArrayLike, n_source: int, n_target: int) -> IntArray:
    """Return landmarks as an (m, 2) integer array after checking type, shape, range and repetition."""
    pairs = np.asarray(landmarks)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise LandmarkError(
            f"landmarks have shape {pairs.shape} and type {pairs.dtype}; expected one row "
            "(source vertex, target vertex) of two integers for each landmark"
        )
    if len(pairs) < 3:
        raise LandmarkError(
            f"{len(pairs)} landmarks do not fix an alignment; give at least 3, better 5 at extremities"
        )
    for column, (side, n) in enumerate((("source", n_source), ("target", n_target))):
        bad = pairs[(pairs[:, column] < 0) | (pairs[:, column] >= n), column]
        if len(bad):
            raise LandmarkError(
                f"landmarks name {side} vertices {some(bad)}, outside 0…{n - 1}; indices count from 0, "
                "and the first column belongs to the source"
            )
        values, counts = np.unique(pairs[:, column], return_counts=True)
        if (counts > 1).any():
            raise LandmarkError(f"landmarks use {side} vertices {some(values[counts > 1])} more than once")
    return pairs.astype(np.int64)


def checked_initial_map(initial_map: ArrayLike, n_source: int, n_target: int) -> IntArray:
    """Return an initial map as an (n_source,) integer array after checking type, length and range."""
    image = np.asarray(getattr(initial_map, "vertices", initial_map))
    if image.shape != (n_source,) or image.dtype.kind not in "iu":
        raise MapError(
            f"initial map has shape {image.shape} and type {image.dtype}; expected one integer target vertex for "
            f"each of the {n_source} source vertices"
        )
    bad = np.flatnonzero((image < -1) | (image >= n_target))
    if len(bad):
        raise MapError(
            f"initial map sends source vertices {some(bad)} outside the target's vertices 0…{n_target - 1}; is it "
            "the map of the other direction?"
        )
    return image.astype(np.int64)


def checked_descriptors(
    descriptors: tuple[ArrayLike, ArrayLike], n_source: int, n_target: int
) -> tuple[FloatArray, FloatArray]:
    """Return initial descriptors as (n_source, q) and (n_target, q) arrays after checking them."""
    if len(descriptors) != 2:
        raise DescriptorError(f"initial descriptors are {len(descriptors)} arrays; expected (source, target)")
    source, target = (np.asarray(values, dtype=np.float64) for values in descriptors)
    if source.ndim != 2 or target.ndim != 2 or source.shape[1:] != target.shape[1:]:
        raise DescriptorError(
            f"initial descriptors have shapes {source.shape} and {target.shape}; expected (n_source, q), (n_target, q)"
        )
    for side, values, n in (("source", source, n_source), ("target", target, n_target)):
        if len(values) != n:
            raise DescriptorError(f"{side} descriptors have {len(values)} rows for {n} vertices")
        if not np.isfinite(values).all():
            raise DescriptorError(f"{side} descriptors hold values that are not finite")
    return source, target
