"""Two shapes seen at a few hundred vertices each: the small problem in which starts are tried and compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map
from isomatch.descriptors import GeodesicDistanceDescriptor
from isomatch.errors import MeshError, SettingError
from isomatch.matching.config import Config
from isomatch.matching.nearest import nearest_rows
from isomatch.matching.prepare import PreparedShape, prepare
from isomatch.surfaces import Surface

SEARCH_RANK = (
    30  # descriptor columns while hypotheses are compared; the rest only sharpens a map already found
)
PREPARATION = ("n_columns", "rank", "n_functions", "weights", "n_search", "n_refine")  # settings of `prepare`


@dataclass(frozen=True, eq=False)
class Glimpse:
    """A prepared shape at some of its body vertices.

    Parameters
    ----------
    shape : PreparedShape
        The shape.
    rows : (m,) array of int
        Body vertices.
    """

    shape: PreparedShape
    rows: IntArray

    @cached_property
    def cloud(self) -> GeodesicDistanceDescriptor:
        """Leading columns of the geodesic distance descriptors, (m, 30)."""
        return self.shape.cloud.at(self.rows, SEARCH_RANK)

    @cached_property
    def functions(self) -> FloatArray:
        """Laplace–Beltrami functions, (m, K)."""
        return self.shape.laplace.vectors[self.rows]

    @cached_property
    def _triangular(self) -> tuple[FloatArray, FloatArray]:
        q, r = np.linalg.qr(self.functions)
        return q, r

    def fit(self, values: FloatArray, k: int) -> FloatArray:
        """Least-squares coefficients of (m, q) values in the first k functions, (k, q).

        One QR decomposition serves every k, since its leading columns are that of the leading functions.
        """
        q, r = self._triangular
        coefficients: FloatArray = solve_triangular(r[:k, :k], q[:, :k].T @ values, check_finite=False)
        return coefficients


@dataclass(frozen=True, eq=False)
class Pair:
    """Source and target at the vertices on which hypotheses are searched."""

    source: Glimpse
    target: Glimpse

    @classmethod
    def of(cls, source: PreparedShape, target: PreparedShape) -> Pair:
        """Take the first ``n_search`` spread vertices of each shape."""
        rows = (shape.spread[: shape.config.n_search] for shape in (source, target))
        return cls(Glimpse(source, next(rows)), Glimpse(target, next(rows)))

    @cached_property
    def refinement(self) -> Glimpse:
        """The source at its refinement vertices; kept, because its decomposition serves every fit."""
        shape = self.source.shape
        return Glimpse(shape, shape.spread[: shape.config.n_refine])

    @property
    def sided(self) -> bool:
        """Whether both shapes have an inside and an outside, so that normals and curvature can be compared."""
        return self.source.shape.triangles is not None and self.target.shape.triangles is not None

    @cached_property
    def signatures(self) -> tuple[FloatArray, FloatArray]:
        """Point signatures that both shapes have: of the target (n_t, q), of the source (n_s, q)."""
        of_target, of_source = self.target.shape.signatures, self.source.shape.signatures
        common = min(of_target.shape[1], of_source.shape[1])
        return of_target[:, :common], of_source[:, :common]

    def functional_map(self, image: IntArray, k: int) -> FloatArray:
        """F (k, k) with Φ_source F ≈ Φ_target[image]: carries functions of the target to the source."""
        return self.source.fit(self.target.functions[image, :k], k)

    def image_of(self, functional_map: FloatArray) -> IntArray:
        """Nearest target row of each source row in the spectral domain."""
        k_source, k_target = functional_map.shape
        return nearest_rows(
            self.target.functions[:, :k_target] @ functional_map.T, self.source.functions[:, :k_source]
        )

    def upsampled(self, image: IntArray, sizes: range | tuple[int, ...]) -> IntArray:
        """Spectral upsampling (Melzi et al., ZoomOut, 2019): alternate both of the above while k grows."""
        for k in sizes:
            image = self.image_of(self.functional_map(image, k))
        return image

    @cached_property
    def _target_distances(self) -> FloatArray:
        """Geodesic distances between the target's rows, in √area, (m_t, m_t)."""
        target, rows = self.target.shape, self.target.rows
        distances: FloatArray = np.maximum(target.distances.between(rows, rows), 0.0)
        distances /= np.sqrt(target.body.area)
        np.fill_diagonal(distances, 0.0)
        return distances

    def difference(self, a: IntArray, b: IntArray) -> float:
        """Mean geodesic distance between the images of two maps, in √area: how different they are.

        Distances in space would take the back of a thin body for its front.
        """
        return float(self._target_distances[a, b].mean())

    def differs(self, image: IntArray, others: list[IntArray], least: float) -> bool:
        """Tell whether a map differs from all the others by more than a mean distance."""
        return not others or bool(self._target_distances[np.array(others), image].mean(axis=1).min() > least)


def prepared_pair(
    source: Surface | PreparedShape, target: Surface | PreparedShape, config: Config | None, seed: int
) -> tuple[Pair, Config]:
    """Prepare what is not yet prepared, both at once; by default with the settings of what is.

    Returns
    -------
    Pair
        The two shapes.
    Config
        The settings of both.

    Raises
    ------
    MeshError
        If a surface cannot be used.
    SettingError
        If a shape was prepared with other settings.
    """
    sides = [("source", source), ("target", target)]
    ready = [shape.requested for _, shape in sides if isinstance(shape, PreparedShape)]
    settings = config or next(iter(ready), Config())
    return Pair.of(*parallel_map(lambda side: _prepared(*side, settings, seed), sides)), settings


def _prepared(side: str, shape: Surface | PreparedShape, config: Config, seed: int) -> PreparedShape:
    if isinstance(shape, PreparedShape):
        for name in PREPARATION:
            used, asked = getattr(shape.requested, name), getattr(config, name)
            if used != asked:
                raise SettingError(
                    f"{side} was prepared with {name} = {used!r}, the match asks for {asked!r}; prepare both shapes "
                    "with the settings of the match"
                )
        return shape
    try:
        return prepare(shape, config, seed)
    except MeshError as error:
        raise MeshError(f"{side}: {error}") from error
