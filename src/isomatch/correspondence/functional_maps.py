"""Vertex maps and functional maps, turned into one another.

A functional map F (k, k) carries functions of the target to the source: Φ_source F ≈ Φ_target[image], with Φ the
Laplace–Beltrami functions, one column each, and image the target vertex of each source vertex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import polar, solve_triangular

from isomatch.bases import LaplaceBasis
from isomatch.correspondence.nearest_neighbours import nearest_rows
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

NearestVertices = Callable[[FloatArray, FloatArray], IntArray]
"""Of candidates (n, d) and queries (m, d): the index (m,) of the candidate nearest to each query."""


class Embedding(NamedTuple):
    """Coordinates of both shapes in one space; the image of a source vertex is the nearest target vertex.

    Parameters
    ----------
    source : (n_s, d) array of float
    target : (n_t, d) array of float
    """

    source: FloatArray
    target: FloatArray


def spectral_embedding(
    functional_map: FloatArray, source_functions: FloatArray, target_functions: FloatArray
) -> Embedding:
    """Φ_source and Φ_target Fᵀ: the space in which images under a functional map (k_s, k_t) are nearest neighbours."""
    k_source, k_target = functional_map.shape
    return Embedding(source_functions[:, :k_source], target_functions[:, :k_target] @ functional_map.T)


def fit_functional_map(source_functions: FloatArray, target_functions: FloatArray) -> FloatArray:
    """Least-squares functional map (k_s, k_t) from functions at q corresponding points, (q, k_s) and (q, k_t)."""
    source, target = source_functions.astype(np.float64), target_functions.astype(np.float64)
    return np.asarray(np.linalg.lstsq(source, target, rcond=None)[0])


@dataclass(frozen=True, eq=False, repr=False)
class FunctionalMap:
    """A map as a matrix between Laplace–Beltrami functions, target → source, as functions are pulled back.

    Parameters
    ----------
    matrix : (k, k) array of float
        C: column j holds the coefficients, on the source, of the pulled back target function j. For a map P that leaves
        no vertex out, C = Φ_sᵀ A_s P Φ_t.
    source, target : LaplaceBasis
        Φ_s and Φ_t, with k functions each, and the areas A_s and A_t.
    """

    matrix: FloatArray
    source: LaplaceBasis
    target: LaplaceBasis

    def __repr__(self) -> str:
        return f"FunctionalMap({self.target!r} → {self.source!r})"

    def pull_back(self, values: FloatArray) -> FloatArray:
        """Pull the smooth part of target functions back to the source, Φ_s C Φ_tᵀ A_t f: (n_t, q) → (n_s, q)."""
        pulled: FloatArray = self.source.vectors @ (self.matrix @ self.target.coefficients(values))
        return pulled


@dataclass(frozen=True, eq=False)
class SampledBasis:
    """Functions of a surface, to which values known at some vertices are fitted.

    Parameters
    ----------
    functions : (n, K) array of float
        Functions at all vertices.
    vertices : (m,) array of int
        Vertices at which values are known.
    """

    functions: FloatArray
    vertices: IntArray

    @cached_property
    def at_samples(self) -> FloatArray:
        """The functions at the sampled vertices, (m, K), in double precision."""
        return self.functions[self.vertices].astype(np.float64)

    @cached_property
    def _triangular(self) -> tuple[FloatArray, FloatArray]:
        """Q and R⁻¹."""
        q, r = np.linalg.qr(self.at_samples)
        return q, solve_triangular(r, np.eye(len(r)), check_finite=False)

    def fit(self, values: FloatArray, k: int) -> FloatArray:
        """Least-squares coefficients (k, q) of values (m, q) in the first k functions.

        One QR decomposition serves every k, because its leading columns are that of the leading functions, and the
        leading block of R⁻¹ is the inverse of that of R.
        """
        q, inverse = self._triangular
        coefficients: FloatArray = inverse[:k, :k] @ (q[:, :k].T @ values)
        return coefficients


@dataclass(frozen=True, eq=False)
class SpectralPair:
    """The bases of two shapes: vertex maps and functional maps between them.

    Parameters
    ----------
    source : SampledBasis
        Basis of the source; its m sampled vertices are mapped.
    target : (n_t, K) array of float
        Basis of the target, at the vertices among which images are sought.
    nearest : callable
        Finds nearest rows among n_t; by default `nearest_rows`.
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

    def upsampled(self, functional_map: FloatArray, sizes: Iterable[int]) -> FloatArray:
        """Alternate images and the functional map that fits them best, while its size grows.

        Notes
        -----
        Melzi, Ren, Rodolà, Sharma, Wonka & Ovsjanikov, *ZoomOut*, SIGGRAPH Asia 2019; images of the sampled vertices
        only, which is their acceleration.
        """
        for k in sizes:
            functional_map = self.functional_map(self.image(functional_map), k)
        return functional_map

    def grown(self, image: IntArray, sizes: Sequence[int]) -> FloatArray:
        """Fit the functional map of the first size to a vertex map (m,), and upsample it through the others."""
        return self.upsampled(self.functional_map(image, sizes[0]), sizes[1:])

    def orthogonal_icp(
        self, functional_map: FloatArray, k: int, steps: int, weights: FloatArray
    ) -> FloatArray:
        """Alternate images and the orthogonal functional map of k functions that fits them best.

        On the sampled vertices until nothing changes, or for a number of steps; then once on all n_s vertices, with
        their areas (n_s,) as weights.

        Notes
        -----
        Ovsjanikov et al., *Functional Maps*, SIGGRAPH 2012, section 6.2.
        """
        image = np.zeros(0, dtype=np.int64)
        for _ in range(steps):
            previous, image = image, self.image(functional_map)
            if np.array_equal(image, previous):
                break
            functional_map = polar(self.functional_map(image, k))[0]
        source, target = self.embedding(functional_map)
        on_target = weights[:, None] * self.target[self.nearest(target, source), :k]
        return np.asarray(polar(self.source.functions[:, :k].T @ on_target)[0], dtype=np.float64)
