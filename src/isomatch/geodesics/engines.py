"""Choose a distance engine by name; the registry of all engines."""

from __future__ import annotations

from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray, FloatArray
from isomatch._core.errors import MeshError, SettingError
from isomatch.geodesics.component_engines import Exact, Heat
from isomatch.geodesics.dijkstra import Dijkstra
from isomatch.geodesics.fast_marching import FastMarching
from isomatch.geodesics.given import DistanceFunction, GivenFunction, GivenMatrix, WeldedEngine
from isomatch.geodesics.points import PointsInFaces, concatenate_points, insert_points, points_of, vertices_of
from isomatch.geodesics.protocol import DistanceEngine, pair_distances
from isomatch.io import SurfaceLike, surface_from
from isomatch.repair import without_seams
from isomatch.surfaces import Graph, Mesh, PointCloud, PrecisePoints

ENGINES: dict[type, tuple[type[Any], ...]] = {
    Mesh: (FastMarching, Exact, Heat, Dijkstra),
    PointCloud: (Dijkstra,),
    Graph: (Dijkstra,),
}
"""The registry: engine classes for each kind of surface, the default first."""

INSERTING = (Exact.name, Dijkstra.name)
"""Names of engines for which a point in a face becomes a vertex; thin triangles would mislead the other engines."""

MetricSpace: TypeAlias = Mesh | PointCloud | Graph | AnyArray | DistanceFunction | DistanceEngine
"""Everything that has distances: a surface, an n × n matrix, a function of sources, or an engine."""


def engine_names(kind: type | None = None) -> tuple[str, ...]:
    """Names that `distance_engine` accepts for a class of surfaces, by default all; the default comes first.

    Examples
    --------
    >>> engine_names(Mesh)[0], engine_names(Graph)[0]
    ('fast_marching', 'dijkstra')
    """
    groups = [engines for surface, engines in ENGINES.items() if kind is None or issubclass(kind, surface)]
    return tuple(dict.fromkeys(engine.name for engines in groups for engine in engines))


def metric_space(given: MetricSpace | SurfaceLike) -> MetricSpace:
    """Return a metric space as it is, and make a surface of anything else; see `surface_from`."""
    if isinstance(given, np.ndarray | DistanceEngine) or callable(given):
        return given
    return surface_from(given)


def distance_engine(
    surface: MetricSpace | SurfaceLike,
    name: str | None = None,
    *,
    weld: bool = True,
    points: PrecisePoints | None = None,
) -> DistanceEngine:
    """Set up the engine that computes the distances of a surface, or wrap distances that are given.

    Parameters
    ----------
    surface : Mesh, PointCloud, Graph, (n, n) array, callable, DistanceEngine, or what `surface_from` takes
        The metric space, n points. An array holds all distances; a callable maps an (m,) array of
        sources to (m, n) distances and is called with one source to learn n; an engine is returned
        as it is.
    name : str, optional
        One of ``engine_names(type(surface))``; by default the first of them.
    weld : bool
        Whether vertices of a mesh at exactly the same position are one point of the surface, as
        along the seams of a texture. Otherwise a seam is a cut.
    points : PrecisePoints, optional
        m further points of a mesh, in its faces or on its edges: points n … n + m − 1 of the
        engine.

    Returns
    -------
    DistanceEngine
        Its ``name`` is the name of the engine chosen, or ``"matrix"`` or ``"function"`` if
        distances are given. If vertices were welded, its points are still the vertices of the user,
        and its ``notes`` say how many were welded.

    Raises
    ------
    SettingError
        If the surface has no engine of that name.
    MeshError
        If the surface, or the given distances, do not fit the engine; or if further points are not
        of the surface.
    MissingDependencyError
        If the engine needs an extra that is not installed.

    Examples
    --------
    >>> line = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    >>> distance_engine(line).distances_from([1])
    array([[1., 0., 1., 2.]])
    """
    surface = metric_space(surface)
    if points is not None:
        return _with_points(surface, points, name, weld)
    surface, seams = without_seams(surface, weld)
    if seams:
        return WeldedEngine(distance_engine(surface, name, weld=False), seams.new_index, seams.changes)
    for kind, engines in ENGINES.items():
        if isinstance(surface, kind):
            for engine_class in engines:
                if name in (None, engine_class.name):
                    engine: DistanceEngine = engine_class(surface)
                    return engine
            raise SettingError(
                f"a {kind.__name__} has no engine {name!r}; available: {', '.join(map(repr, engine_names(kind)))}"
            )
    if isinstance(surface, DistanceEngine):
        engine = surface
    elif isinstance(surface, np.ndarray):
        engine = GivenMatrix(surface)
    else:
        engine = GivenFunction(cast(DistanceFunction, surface))
    if name not in (None, engine.name):
        raise SettingError(
            f"engine {name!r} cannot be chosen: the distances are given, by engine {engine.name!r}"
        )
    return engine


def _with_points(surface: MetricSpace, points: PrecisePoints, name: str | None, weld: bool) -> DistanceEngine:
    """Set up an engine of the vertices of a mesh, and then of points in its faces."""
    if not isinstance(surface, Mesh):
        raise MeshError(
            f"points in faces are points of a Mesh, not of a {type(surface).__name__}; give vertices"
        )
    points = points_of(points, surface.n_vertices)
    mesh, seams = without_seams(surface, weld)
    vertex = seams.new_index if seams else np.arange(surface.n_vertices)
    points = points._replace(corners=vertex[points.corners])
    engine: DistanceEngine
    if name in INSERTING:
        division = insert_points(mesh, points)
        engine, added = distance_engine(division.mesh, name, weld=False), division.vertex
    else:
        engine = PointsInFaces(distance_engine(mesh, name, weld=False), mesh, points)
        added = np.arange(mesh.n_vertices, engine.n_points)
    return WeldedEngine(engine, np.concatenate([vertex, added]), seams.changes if seams else ())


def geodesic_distances(
    surface: MetricSpace | SurfaceLike,
    sources: ArrayLike | PrecisePoints,
    engine: str | None = None,
    *,
    targets: ArrayLike | PrecisePoints | None = None,
    weld: bool = True,
) -> FloatArray:
    """Geodesic distances from some vertices, or points in faces, to all vertices or to some points.

    Parameters
    ----------
    surface : Mesh, PointCloud, Graph, (n, n) array, callable, DistanceEngine, or what `surface_from` takes
        The surface, n vertices; see `distance_engine`.
    sources : (m,) array_like of int, or PrecisePoints
        Vertices, or points in the faces of a mesh.
    engine : str, optional
        How the distances are computed, one of ``engine_names(type(surface))``; by default the first
        of them.
    targets : (t,) array_like of int, or PrecisePoints, optional
        Vertices or points, to which distances are wanted; by default all vertices.
    weld : bool
        Whether vertices of a mesh at exactly the same position are one point of the surface.

    Returns
    -------
    (m, n) or (m, t) array of float
        Distances in mesh units; ``inf`` where no path leads, as between components.

    Raises
    ------
    MeshError
        If a coordinate is not finite or an index, of a face or a source, is out of range.
    SettingError, MissingDependencyError
        If the surface has no such engine, or the engine's package is not installed.
    MemoryBudgetError
        If the result would be larger than allowed.

    Notes
    -----
    O(m n log n) time for fast marching and Dijkstra, on all threads; 8 m n bytes for the result. To
    ask more than once, set up the engine once, with `distance_engine`.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> geodesic_distances(square, [1]).round(4)
    array([[1.    , 0.    , 1.    , 1.4142]])
    >>> geodesic_distances(square, [1], engine="dijkstra")
    array([[1., 0., 1., 2.]])

    From the middle of a side, and to it:

    >>> middle = PrecisePoints(np.array([[2, 3, 3]]), np.array([[0.5, 0.5, 0.0]]))
    >>> geodesic_distances(square, middle).round(4), geodesic_distances(square, [2, 3], targets=middle).round(4)
    (array([[1.118, 1.118, 0.5  , 0.5  ]]), array([[0.5],
           [0.5]]))
    """
    surface = metric_space(surface)
    precise = [points for points in (sources, targets) if isinstance(points, PrecisePoints)]
    added = concatenate_points(*precise) if precise else None
    chosen = distance_engine(surface, engine, weld=weld, points=added)
    n = chosen.n_points - (len(added.corners) if added else 0)
    numbers_added = iter(range(n, chosen.n_points))

    def numbers_of(points: ArrayLike | PrecisePoints) -> AnyArray:
        if isinstance(points, PrecisePoints):
            return np.array([next(numbers_added) for _ in points.corners], dtype=np.int64)
        return vertices_of(points, n)

    rows = numbers_of(sources)
    if targets is None:
        return chosen.distances_from(rows)[:, :n]
    pairs = np.stack(np.meshgrid(rows, numbers_of(targets), indexing="ij"), axis=-1)
    return pair_distances(chosen, pairs.reshape(-1, 2)).reshape(pairs.shape[:2])
