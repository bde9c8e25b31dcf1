"""The door to the engines: choose one by name, or take what the user has."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import AnyArray, FloatArray
from isomatch.errors import SettingError
from isomatch.geodesics.dijkstra import Dijkstra
from isomatch.geodesics.exact import Exact
from isomatch.geodesics.fast_marching import FastMarching
from isomatch.geodesics.given import DistanceFunction, GivenFunction, GivenMatrix
from isomatch.geodesics.heat import Heat
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.surfaces import Graph, Mesh, PointCloud

EngineName = Literal["fast_marching", "exact", "heat", "dijkstra"]

MetricSpace: TypeAlias = Mesh | PointCloud | Graph | AnyArray | DistanceFunction | DistanceEngine
"""Whatever distances can be asked of: a shape, an n × n matrix, a function of sources, or an engine."""

# the engines of each kind of shape, its natural one first
ENGINES: dict[type, dict[str, Any]] = {
    Mesh: {"fast_marching": FastMarching, "exact": Exact, "heat": Heat, "dijkstra": Dijkstra},
    PointCloud: {"dijkstra": Dijkstra},
    Graph: {"dijkstra": Dijkstra},
}


def distance_engine(surface: MetricSpace, name: EngineName | None = None) -> DistanceEngine:
    """Set up an engine for distance columns.

    Parameters
    ----------
    surface : Mesh, PointCloud, Graph, (n, n) array, callable or DistanceEngine
        What distances are wanted of. An array holds all distances; a callable maps an (m,) array of sources to (m, n)
        distances and is asked for one column to learn n; an engine is returned as it is.
    name : {"fast_marching", "exact", "heat", "dijkstra"}, optional
        How distances are computed; by default ``"fast_marching"`` on a mesh and ``"dijkstra"`` on a point cloud or a
        graph, which know no other.

    Returns
    -------
    DistanceEngine
        ``.name`` says which it is: one of the above, ``"matrix"`` or ``"function"``.

    Raises
    ------
    SettingError
        If the surface has no engine of that name.
    MeshError
        If the surface, or the given distances, do not fit the engine.
    MissingDependencyError
        If the engine needs an extra that is not installed.

    Examples
    --------
    >>> line = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    >>> distance_engine(line).distances_from([1])
    array([[1., 0., 1., 2.]])
    """
    for kind, engines in ENGINES.items():
        if isinstance(surface, kind):
            chosen = next(iter(engines)) if name is None else name
            if chosen not in engines:
                raise SettingError(
                    f"a {kind.__name__} has no engine {chosen!r}; available: {', '.join(map(repr, engines))}"
                )
            engine: DistanceEngine = engines[chosen](surface)
            return engine
    given: DistanceEngine
    if isinstance(surface, DistanceEngine):
        given = surface
    elif isinstance(surface, np.ndarray):
        given = GivenMatrix(surface)
    elif callable(surface):
        given = GivenFunction(surface)
    else:
        raise SettingError(
            f"distances of a {type(surface).__name__} are not defined; give a Mesh, PointCloud, Graph, an n × n array, "
            "a function from sources to distance columns, or a DistanceEngine"
        )
    if name not in (None, given.name):
        raise SettingError(
            f"engine {name!r} cannot be chosen: the distances are given, by engine {given.name!r}"
        )
    return given


def geodesic_distances(
    surface: MetricSpace, sources: ArrayLike, engine: EngineName | None = None
) -> FloatArray:
    """Geodesic distances from some vertices to all others.

    Parameters
    ----------
    surface : Mesh, PointCloud, Graph, (n, n) array, callable or DistanceEngine
        The surface, n vertices; see `distance_engine`.
    sources : (m,) array_like of int
        Source vertices.
    engine : {"fast_marching", "exact", "heat", "dijkstra"}, optional
        How the distances are computed; by default ``"fast_marching"`` on a mesh, ``"dijkstra"`` on the others.

    Returns
    -------
    (m, n) array of float
        Distances in mesh units; ``inf`` where no path leads, so across components.

    Raises
    ------
    MeshError
        If a coordinate is not finite or an index, of a face or a source, is out of range.
    SettingError, MissingDependencyError
        If the surface has no such engine, or the engine's package is missing.
    MemoryBudgetError
        If the result would be larger than allowed.

    Notes
    -----
    O(m n log n) time for fast marching and Dijkstra, on all threads; 8 m n bytes for the result. For many sources set
    up the engine once, with `distance_engine`.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> geodesic_distances(square, [1]).round(4)
    array([[1.    , 0.    , 1.    , 1.4142]])
    >>> geodesic_distances(square, [1], engine="dijkstra")
    array([[1., 0., 1., 2.]])
    """
    return distance_engine(surface, engine).distances_from(np.atleast_1d(np.asarray(sources)))
