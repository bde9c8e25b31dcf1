"""Geodesic engines: whatever answers "how far is every vertex from these?"."""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import FloatArray, IntArray
from isomatch._memory import require_memory
from isomatch.errors import MeshError, SettingError, some
from isomatch.geodesics.front import march, march_bounded
from isomatch.geodesics.stencil import stencil_of
from isomatch.surfaces import Mesh

EngineName = Literal["fast_marching"]


class DistanceEngine(Protocol):
    """Distance columns of a metric space of n points: all that bases and matching need to know of it."""

    name: str
    n_points: int

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances from each of m sources; ``inf`` where unreachable."""
        ...

    def lower(self, nearest: FloatArray, source: int) -> None:
        """Lower ``nearest`` (n,) in place to the distance from one more source."""
        ...


class FastMarching:
    """First-order fast marching with planar unfolding; see `isomatch.geodesics.fast_marching`."""

    name = "fast_marching"

    def __init__(self, mesh: Mesh) -> None:
        extent = float(np.abs(mesh.vertices).max(initial=0.0))
        # stencils hold lengths in single precision; a mesh of ordinary size is taken as it is
        self._unit = 1.0 if extent == 0.0 or 1e-20 < extent < 1e20 else extent
        self._stencil = stencil_of(Mesh(mesh.vertices / self._unit, mesh.faces))
        self.n_points = mesh.n_vertices

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances from each of m sources; ``inf`` where unreachable."""
        self._require(sources)
        require_memory(
            8.0 * len(sources) * self.n_points, f"{len(sources)} distance columns", "ask for fewer at once"
        )
        distances = march(self._stencil, sources)
        return distances if self._unit == 1.0 else distances * self._unit

    def lower(self, nearest: FloatArray, source: int) -> None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        self._require(np.array([source]))
        if self._unit == 1.0:
            march_bounded(self._stencil, source, nearest)
            return
        scaled = nearest / self._unit
        march_bounded(self._stencil, source, scaled)
        nearest[:] = scaled * self._unit

    def _require(self, sources: IntArray) -> None:
        bad = sources[(sources < 0) | (sources >= self.n_points)]
        if len(bad):
            raise MeshError(
                f"sources {some(bad)} are outside 0…{self.n_points - 1}, the vertices of the surface"
            )


def distance_engine(surface: Mesh, name: EngineName = "fast_marching") -> DistanceEngine:
    """Build the named engine for a surface."""
    if name != "fast_marching":
        raise SettingError(f"unknown geodesic engine {name!r}; available: 'fast_marching'")
    if not np.isfinite(surface.vertices).all():
        bad = np.flatnonzero(~np.isfinite(surface.vertices).all(axis=1))
        raise MeshError(
            f"vertices {some(bad)} have coordinates that are not finite, so no distance is defined; "
            "mend the file or call repair(mesh)"
        )
    return FastMarching(surface)


def geodesic_distances(surface: Mesh, sources: ArrayLike, engine: EngineName = "fast_marching") -> FloatArray:
    """Geodesic distances from some vertices to all others.

    Parameters
    ----------
    surface : Mesh
        The surface, n vertices.
    sources : (m,) array_like of int
        Source vertices.
    engine : {"fast_marching"}
        How the distances are computed.

    Returns
    -------
    (m, n) array of float
        Distances in mesh units; ``inf`` where no path leads, so across components.

    Raises
    ------
    MeshError
        If a coordinate is not finite or an index, of a face or a source, is out of range.

    Notes
    -----
    O(m n log n) time on all threads, 8 m n bytes for the result.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> geodesic_distances(square, [1]).round(4)
    array([[1.    , 0.    , 1.    , 1.4142]])
    """
    wanted = np.atleast_1d(np.asarray(sources))
    if wanted.ndim != 1 or (wanted.size and wanted.dtype.kind not in "iu"):
        raise MeshError("sources must be a one-dimensional array of vertex indices")
    return distance_engine(surface, engine).distances_from(wanted.astype(np.int64))
