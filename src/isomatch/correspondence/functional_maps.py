"""Conversion between vertex maps and functional maps.

A functional map F (k, k) carries functions of the target to the source: Φ_source F ≈
Φ_target[image], with Φ the Laplace–Beltrami functions, one column each, and image the target vertex
of each source vertex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import polar, solve_triangular

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch.correspondence.nearest import nearest_rows
from isomatch.spectral import LaplaceBasis

NearestVertices = Callable[[FloatArray, FloatArray], IntArray]
"""Maps candidates (n, d) and queries (m, d) to the index (m,) of the candidate nearest to each query."""


class Embedding(NamedTuple):
    """Coordinates (n_s, d) and (n_t, d) of both shapes in one space, in which images are nearest neighbours.

    Examples
    --------
    >>> both = Embedding(source=np.zeros((3, 2)), target=np.ones((4, 2)))
    >>> both.source.shape, both.target.shape
    ((3, 2), (4, 2))
    """

    source: FloatArray
    target: FloatArray


def spectral_embedding(
    functional_map: FloatArray, source_functions: FloatArray, target_functions: FloatArray
) -> Embedding:
    """Place both shapes so that images under a functional map (k_s, k_t) are nearest neighbours.

    It uses the first k_s and k_t of the functions (n_s, K_s) and (n_t, K_t). O(n_t k_s k_t).

    Examples
    --------
    The map exchanges the two vertices, so that the second function changes its sign.

    >>> functions = np.array([[1.0, 1.0], [1.0, -1.0]])
    >>> source, target = spectral_embedding(np.diag([1.0, -1.0]), functions, functions)
    >>> nearest_rows(target, source)
    array([1, 0])
    """
    # Ovsjanikov et al., *Functional Maps*, SIGGRAPH 2012: the coefficients of the indicator of a
    # vertex, divided by its area, are its row of Φ. F takes the coefficients of the image to those
    # of the vertex, F Φ_target[image]ᵀ ≈ Φ_source[vertex]ᵀ. So the image is the row of Φ_target Fᵀ
    # that is nearest to the row of Φ_source.
    k_source, k_target = functional_map.shape
    return Embedding(source_functions[:, :k_source], target_functions[:, :k_target] @ functional_map.T)


def fit_functional_map(source_functions: FloatArray, target_functions: FloatArray) -> FloatArray:
    """Fit F (k_s, k_t) to functions at q corresponding points by min ‖Φ_source F − Φ_target‖.

    If there are several, it is the smallest one. To weight a point, multiply its row on both sides
    by the root of the weight. O(q k²), in double precision.

    Examples
    --------
    >>> functions = np.array([[1.0, 1.0], [1.0, 0.0], [1.0, -1.0]])
    >>> fit_functional_map(functions, functions[::-1]).round(6) + 0.0
    array([[ 1.,  0.],
           [ 0., -1.]])
    """
    source, target = source_functions.astype(np.float64), target_functions.astype(np.float64)
    return np.asarray(np.linalg.lstsq(source, target, rcond=None)[0])


@dataclass(frozen=True, eq=False, repr=False)
class FunctionalMap:
    """A map as a matrix between Laplace–Beltrami functions, target → source, as functions are pulled back.

    Parameters
    ----------
    matrix : (k, k) array of float
        C: column j holds the coefficients, on the source, of the pulled back target function j. For
        a map P of all vertices, C = Φ_sᵀ A_s P Φ_t.
    source, target : LaplaceBasis
        Φ_s and Φ_t, with k functions each, and the areas A_s and A_t.

    Examples
    --------
    >>> from isomatch import Correspondence, Mesh, laplace_basis
    >>> wedge = Mesh([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> basis = laplace_basis(wedge, k=3)
    >>> identity = Correspondence(range(4), n_target=4).to_functional(basis, basis, k=3)
    >>> identity
    FunctionalMap(LaplaceBasis(4 points, 3 functions) → LaplaceBasis(4 points, 3 functions))
    >>> bool(np.allclose(identity.matrix, np.eye(3)))
    True
    """

    matrix: FloatArray
    source: LaplaceBasis
    target: LaplaceBasis

    def __repr__(self) -> str:
        return f"FunctionalMap({self.target!r} → {self.source!r})"

    def pull_back(self, values: FloatArray) -> FloatArray:
        """Pull the smooth part of target functions (n_t, q) back to the source, Φ_s C Φ_tᵀ A_t f."""
        return np.asarray(self.source.vectors @ (self.matrix @ self.target.coefficients(values)))


@dataclass(frozen=True, eq=False)
class SampledBasis:
    """Functions (n, K) of a surface, to which values known at some vertices (m,) are fitted.

    Examples
    --------
    The coefficients of a line through values at two of five vertices:

    >>> basis = SampledBasis(np.column_stack([np.ones(5), np.arange(5.0)]), vertices=np.array([1, 3]))
    >>> basis.fit(np.array([[30.0], [50.0]]), k=2).ravel().round(6)
    array([20., 10.])
    """

    functions: FloatArray
    vertices: IntArray

    @cached_property
    def at_samples(self) -> FloatArray:
        """The functions at the sampled vertices, (m, K), in double precision."""
        return self.functions[self.vertices].astype(np.float64)

    @cached_property
    def _factors(self) -> tuple[FloatArray, FloatArray]:
        """Q and R⁻¹ of the functions at the samples, Φ = Q R."""
        q, r = np.linalg.qr(self.at_samples)
        return q, solve_triangular(r, np.eye(len(r)), check_finite=False)

    def fit(self, values: FloatArray, k: int) -> FloatArray:
        """Least-squares coefficients (k, q) of values (m, q) in the first k functions."""
        # The QR decomposition Φ = Q R of the functions at the samples gives values v the coefficients c = R⁻¹
        # Qᵀ v. One decomposition serves every k: the leading columns of Q and the leading block of R
        # decompose the leading functions, and the leading block of R⁻¹ inverts the leading block of the
        # triangular R.
        q, inverse = self._factors
        return np.asarray(inverse[:k, :k] @ (q[:, :k].T @ values))


@dataclass(frozen=True, eq=False)
class SpectralPair:
    """The bases of two shapes, which convert vertex maps of the samples to functional maps and back.

    Examples
    --------
    A cycle of eight vertices is turned by two: images of three vertices determine the map of all.

    >>> angle = np.arange(8) * np.pi / 4
    >>> fourier = np.column_stack([np.ones(8), np.cos(angle), np.sin(angle)])
    >>> pair = SpectralPair(SampledBasis(fourier, vertices=np.array([0, 3, 5])), fourier)
    >>> source, target = pair.embedding(pair.functional_map(np.array([2, 5, 7]), k=3))
    >>> nearest_rows(target, source)
    array([2, 3, 4, 5, 6, 7, 0, 1])
    """

    source: SampledBasis
    target: FloatArray
    nearest: NearestVertices = nearest_rows

    def functional_map(self, image: IntArray, k: int) -> FloatArray:
        """Fit F (k, k) to a vertex map (m,) of the sampled vertices."""
        return self.source.fit(self.target[image, :k], k)

    def embedding(self, functional_map: FloatArray) -> Embedding:
        """Coordinates of all vertices, see `spectral_embedding`."""
        return spectral_embedding(functional_map, self.source.functions, self.target)

    def image(self, functional_map: FloatArray) -> IntArray:
        """Image (m,) of each sampled vertex: the nearest target vertex in the spectral domain."""
        source, target = spectral_embedding(functional_map, self.source.at_samples, self.target)
        return self.nearest(target, source)

    def upsample(self, functional_map: FloatArray, sizes: Iterable[int]) -> FloatArray:
        """Alternate images and the functional map that fits them best, while its size grows."""
        # ZoomOut, Melzi, Ren, Rodolà, Sharma, Wonka & Ovsjanikov, SIGGRAPH Asia 2019: F of size k gives a
        # vertex map P, in which the image of a vertex is the target vertex nearest in k functions, and P
        # gives F = Φ_source⁺ P Φ_target of a larger size. Section 4.2 derives both steps from the minimum of
        # Σ_k ‖F_kᵀ F_k − I‖² / k, where F_k is the leading block of size k: the pull-back by an isometry
        # commutes with the Laplacian, so that all leading blocks are orthogonal. As in their accelerated
        # version, only sampled vertices have images.
        for k in sizes:
            functional_map = self.functional_map(self.image(functional_map), k)
        return functional_map

    def fit_and_upsample(self, image: IntArray, sizes: Sequence[int]) -> FloatArray:
        """Fit the functional map of the first size to a vertex map (m,), and upsample it to the others."""
        return self.upsample(self.functional_map(image, sizes[0]), sizes[1:])

    def orthogonal_icp(
        self, functional_map: FloatArray, k: int, steps: int, weights: FloatArray
    ) -> FloatArray:
        """Alternate images and the orthogonal functional map of k functions that fits them best."""
        # Ovsjanikov et al. 2012, section 6.2: the matrix of an isometry is orthogonal in orthonormal bases.
        # The orthogonal matrix nearest to a fit F = U Σ Vᵀ is its polar factor U Vᵀ. Images and matrices
        # alternate on the sampled vertices until no image changes, and then once on all n_s vertices, with
        # their areas (n_s,) as weights, F = Φ_sᵀ A P Φ_t.
        image = np.zeros(0, dtype=np.int64)
        for _ in range(steps):
            previous, image = image, self.image(functional_map)
            if np.array_equal(image, previous):
                break
            functional_map = polar(self.functional_map(image, k))[0]
        source, target = self.embedding(functional_map)
        on_target = weights[:, None] * self.target[self.nearest(target, source), :k]
        return np.asarray(polar(self.source.functions[:, :k].T @ on_target)[0], dtype=np.float64)
