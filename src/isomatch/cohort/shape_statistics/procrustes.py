"""Generalised Procrustes analysis: shapes moved onto their mean; their centroid sizes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import MeshError, NotConvergedError, SettingError
from isomatch._core.memory import require_memory
from isomatch._core.settings import require_one_of
from isomatch._core.threads import serial_blas
from isomatch.correspondence import nearest_rotation

Scale = Literal["keep", "remove"]  # whether shapes keep their sizes, or are brought to one size

# Share of the size of the shapes: they are aligned once an iteration moves no shape by more (root mean square over its
# vertices); chosen.
TOLERANCE = 1e-11
MAX_ITERATIONS = 1000  # number of iterations after which an alignment fails if shapes still move; chosen


@dataclass(frozen=True, eq=False)
class ProcrustesAlignment:
    """Aligned shapes: ``scales[s] * vertices[s] @ rotations[s].T + translations[s]``."""

    aligned: FloatArray  #: (m, n, d) aligned shapes, in tangent space if asked for
    rotations: FloatArray  #: (m, d, d) rotation of each shape
    translations: FloatArray  #: (m, d) translation of each shape
    scales: FloatArray  #: (m,) factor of each shape; 1 if the scale is kept
    #: size of all aligned shapes, root mean square distance from the centroid; None if sizes are kept
    size: float | None
    n_iterations: int  #: number of times that all shapes were turned to their mean

    @property
    def mean(self) -> FloatArray:
        """(n, d) mean of the aligned shapes."""
        return np.asarray(self.aligned.mean(axis=0))


def generalised_procrustes(
    vertices: FloatArray,
    weights: FloatArray | None = None,
    scale: Scale = "keep",
    *,
    tangent: bool = False,
    most_iterations: int = MAX_ITERATIONS,
) -> ProcrustesAlignment:
    """Move shapes so that the sum of squared distances from their mean is least.

    The mean centroid of the shapes is kept, and the rotations are as near as possible to the
    identity. Up to this common motion, the result does not depend on the order, the places or the
    orientations of the shapes, nor on their sizes if those are removed.

    Parameters
    ----------
    vertices : (m, n, d) array of float
        Corresponding vertices or landmarks of m shapes in d = 2 or 3 dimensions, all finite.
    weights : (n,) array of float, optional
        Weight of each vertex, such as `CorrespondedShapes.area_weights`; by default all are equal.
    scale : {"keep", "remove"}
        Whether shapes are only moved, or also brought to one size, the geometric mean of the sizes
        of all shapes: of root mean square distances from the centroid.
    tangent : bool
        Project the aligned shapes, without size, on the space tangent to all shapes of that size at
        their mean.
    most_iterations : int
        Number of iterations after which shapes that still move raise a `NotConvergedError`.

    Notes
    -----
    Gower, *Generalized Procrustes analysis*, Psychometrika 1975, without reflections, started from
    the shape whose distances to all others are least. O(m² n) time, O(m²) for each iteration, and
    216 m² bytes.

    Examples
    --------
    >>> corner = np.eye(3)
    >>> turned = corner[:, [1, 2, 0]]
    >>> aligned = generalised_procrustes(np.array([corner, turned])).aligned
    >>> bool(np.allclose(aligned[0], aligned[1]))
    True
    """
    share = shares_of(vertices, weights)
    centroids = np.einsum("i,sij->sj", share, vertices)
    centred = vertices - centroids[:, None]
    size, scales = _common_size(centred, share, scale)
    centred = centred * scales[:, None, None]
    products = _products(centred, share)
    rotations, n_iterations = _rotate_onto_mean(products, most_iterations)
    # All shapes are turned alike, so that their mean rotation is the identity.
    rotations = _nearest_rotations(rotations.sum(axis=0)) @ rotations
    translations = centroids.mean(axis=0) - scales[:, None] * np.einsum("sij,sj->si", rotations, centroids)
    aligned = centred @ rotations.transpose(0, 2, 1)
    if tangent:
        if size is None:
            raise SettingError("shapes with their sizes have no tangent space; remove the scale")
        mean = aligned.mean(axis=0)
        mean *= size / np.sqrt(np.einsum("i,ij,ij->", share, mean, mean))
        along = np.einsum("i,ij,sij->s", share, mean, aligned) / size**2
        # We replace the component of each shape along the mean by the mean itself.
        aligned += (1 - along)[:, None, None] * mean
    aligned += centroids.mean(axis=0)
    return ProcrustesAlignment(aligned, rotations, translations, scales, size, n_iterations)


def procrustes_distances(
    vertices: FloatArray, weights: FloatArray | None = None, scale: Scale = "keep", *, mirrored: bool = False
) -> FloatArray:
    """Compute the distance of each pair of shapes, (m, m), after the best motion.

    It is a root mean square over vertices. Arguments are those of `generalised_procrustes`. If
    ``mirrored``, one shape of each pair is replaced by its mirror image first. A squared distance
    is a difference of squared sizes, so equal shapes are up to 1e-8 of their size apart.

    Examples
    --------
    >>> corner = np.eye(3)
    >>> distances = procrustes_distances(np.array([corner, corner + 1, 2 * corner]))
    >>> (distances[0] * 3 / 2**0.5).round(6)
    array([0.      , 0.      , 1.732051])
    """
    share = shares_of(vertices, weights)
    centred = vertices - np.einsum("i,sij->sj", share, vertices)[:, None]
    centred = centred * _common_size(centred, share, scale)[1][:, None, None]
    return _pair_distances(_products(centred, share), mirrored)


def aligned_to(
    target: FloatArray, vertices: FloatArray, weights: FloatArray, size: float | None = None
) -> FloatArray:
    """Move one shape (n, d) onto another, after bringing it to a size, if one is given."""
    share = shares_of(target[None], weights)
    centre = share @ target
    centred = (vertices - share @ vertices)[None]
    if size is not None:
        centred = centred * (size / _positive_sizes(centred, share))
    rotation = _nearest_rotations(centred[0].T @ (share[:, None] * (target - centre)))
    return np.asarray(centred[0] @ rotation.T + centre)


def shares_of(vertices: FloatArray, weights: FloatArray | None) -> FloatArray:
    """(n,) share of each vertex of shapes (m, n, d) in the weights (n,), by default 1 / n."""
    n = vertices.shape[1]
    if weights is None:
        return np.full(n, 1 / n)
    if weights.shape != (n,) or not (weights >= 0).all() or not 0 < weights.sum() < np.inf:
        remedy = f"give {n} finite ones of at least 0, not all 0"
        raise SettingError(f"weights have shape {weights.shape}; {remedy}")
    return np.asarray(weights / weights.sum())


def _common_size(centred: FloatArray, share: FloatArray, scale: Scale) -> tuple[float | None, FloatArray]:
    """Find the size that all shapes get, None if sizes are kept, and their factors (m,)."""
    require_one_of("scale", scale, Scale)
    if scale == "keep":
        return None, np.ones(len(centred))
    sizes = _positive_sizes(centred, share)
    size = float(np.exp(np.log(sizes).mean()))
    return size, size / sizes


def _positive_sizes(centred: FloatArray, share: FloatArray) -> FloatArray:
    """Root mean square distance from the centroid of each shape, (m,)."""
    sizes = np.asarray(np.sqrt(np.einsum("i,sij,sij->s", share, centred, centred)))
    if not (sizes > 0).all():
        problem = f"shape {sizes.argmin()} is a single point, whose size cannot be removed"
        raise MeshError(f"{problem}; leave it out")
    return sizes


def scalar_products(parts: FloatArray, share: FloatArray) -> FloatArray:
    """Weighted scalar products (m, m) of displacements (m, n, d)."""
    rows = (parts * np.sqrt(share)[:, None]).reshape(len(parts), -1)
    with serial_blas():
        return np.asarray(rows @ rows.T)


def _products(centred: FloatArray, share: FloatArray) -> FloatArray:
    """Weighted products XᵀWY of each pair of shapes, (m, m, d, d)."""
    m, _, d = centred.shape
    require_memory(3 * 72.0 * m**2, f"Procrustes analysis of {m} shapes", "use fewer shapes")
    rows = centred.transpose(0, 2, 1).reshape(d * m, -1) * np.sqrt(share)
    with serial_blas():
        return np.ascontiguousarray((rows @ rows.T).reshape(m, d, m, d).transpose(0, 2, 1, 3))


def _nearest_rotations(products: FloatArray) -> FloatArray:
    """Rotations (…, d, d) that maximise the trace of their products with given matrices."""
    return np.swapaxes(nearest_rotation(products), -1, -2)


def _pair_distances(products: FloatArray, mirrored: bool = False) -> FloatArray:
    """Distances of pairs, (m, m), after the best rotation, or the best reflection."""
    # For the centred vertices X and Y of two shapes and the weights W, the least |X Rᵀ − Y|² over rotations R is |X|² +
    # |Y|² − 2 (σ₁ + σ₂ ± σ₃) with the singular values σ of XᵀWY (Kabsch 1976). The sign is − if the determinant of
    # XᵀWY is negative, as the nearest orthogonal matrix is a reflection then.
    values = np.linalg.svd(products, compute_uv=False)
    values[..., -1] *= np.where((np.linalg.det(products) < 0) != mirrored, -1.0, 1.0)
    squares = np.einsum("ssii->s", products)
    distances = np.sqrt(np.maximum(squares[:, None] + squares - 2 * values.sum(axis=-1), 0.0))
    if not mirrored:
        np.fill_diagonal(distances, 0.0)
    return np.asarray((distances + distances.T) / 2)


def _rotate_onto_mean(products: FloatArray, most: int) -> tuple[FloatArray, int]:
    """Rotations (m, d, d) of all shapes onto their mean, and the number of iterations."""
    medoid = int((_pair_distances(products) ** 2).sum(axis=1).argmin())
    rotations = _nearest_rotations(products[:, medoid])
    moments = np.einsum("ssij->sij", products)
    size = np.sqrt(max(np.einsum("sii->s", moments).mean(), np.finfo(float).tiny))
    for iteration in range(most):
        # For the centred vertices Xₛ of each shape s, Σₜ Xₛᵀ W Xₜ Rₜᵀ / m = Xₛᵀ W (mean): the 3 × 3 products of pairs
        # suffice. The rotation Rₛ onto the mean maximises the trace of Rₛ Xₛᵀ W (mean); then the mean is renewed (Gower).
        to_mean = np.einsum("stij,tkj->sik", products, rotations) / len(products)
        turned = _nearest_rotations(to_mean)
        change = turned - rotations
        rotations = turned
        # The squared movement of a shape, |Xₛ ΔRᵀ|², is tr(ΔR Xₛᵀ W Xₛ ΔRᵀ).
        moved = np.sqrt(np.maximum(np.einsum("sij,sjk,sik->s", change, moments, change), 0.0))
        if moved.max() <= TOLERANCE * size:
            return rotations, iteration + 1
    problem = f"the shapes still move by {moved.max() / size:.1e} of their size after {most} iterations"
    remedy = "they may be too different for one mean: leave out outliers"
    raise NotConvergedError(f"Procrustes analysis: {problem}; {remedy}")


def centroid_sizes(vertices: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """Compute centroid sizes (m,): roots of the sums of squared distances from the centroid.

    With weights, such as `CorrespondedShapes.area_weights`, a vertex counts n times its share of
    the sum, so that the size does not depend on where vertices are dense; by default all count
    once. Sizes, in the units of the shapes, grow with √n, and compare shapes of one topology only.

    Examples
    --------
    >>> square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0.0]])
    >>> centroid_sizes(np.array([square, 3 * square])).round(3)
    array([2.828, 8.485])
    """
    n, share = vertices.shape[1], shares_of(vertices, weights)
    centred = vertices - np.einsum("i,sij->sj", share, vertices)[:, None]
    return np.asarray(np.sqrt(n * np.einsum("i,sij,sij->s", share, centred, centred)))
