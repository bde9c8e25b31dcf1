"""`prepare`: from a surface and settings to a prepared shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch._core.settings import generator
from isomatch._core.stage_timer import PREPARATION_SHARES, Progress, StageTimer
from isomatch._core.threads import in_background, serial_blas
from isomatch._core.ties import TIE_RATIO, first_largest
from isomatch.geodesics import (
    DistanceEngine,
    MetricSpace,
    RestrictedEngine,
    distance_engine,
    euclidean_farthest_points,
    farthest_point_sampling,
    peripheral_vertex,
)
from isomatch.io import SurfaceLike, surface_from
from isomatch.settings import Config
from isomatch.shapes.body import Body, body_of, full_level, levels_of
from isomatch.shapes.prepared_shape import PreparedShape
from isomatch.spectral import laplace_basis, nystrom_basis
from isomatch.surfaces import Graph, Surface


def prepare(
    surface: SurfaceLike,
    config: Config | None = None,
    seed: int = 0,
    distances: MetricSpace | None = None,
    progress: Progress | None = None,
) -> PreparedShape:
    """Compute everything about one shape that matching needs.

    Parameters
    ----------
    surface : Mesh, PointCloud, Graph, path_like, tuple or object
        Anything that `surface_from` takes, with one main component; further components of a mesh
        are prepared when they are needed. Points and graphs have neither an inside nor curvature:
        maps from or to them depend on distances and spectra alone, which do not distinguish a shape
        from its mirror image.
    config : Config, optional
        Settings.
    seed : int
        Draws where sampling starts, and seeds the eigensolver.
    distances : (n, n) array, callable or DistanceEngine, optional
        Distances between the vertices of ``surface``, in its units, instead of ``config.engine``;
        see `distance_engine`. They must be finite within the main component. A callable is called
        on other threads than the caller's.
    progress : callable, optional
        It is called with the name of each stage and the share that is done; see `match`.

    Returns
    -------
    PreparedShape
        Its ``notes`` report repairs and parts left out.

    Raises
    ------
    MeshError
        If the mesh has no faces, coordinates that are not finite, faces that refer to missing
        vertices, or fewer than 50 usable vertices; or if the given distances do not fit it.
    SettingError
        If the seed is not an integer of at least 0, or the shape has no engine of that name.

    Notes
    -----
    About 0.5 s for 5 000 vertices on one thread, most of it for distances and the Laplace–Beltrami
    basis, and 1.5 s for 50 000, which are matched on 5 000 of them (``config.resolution``). `match`
    prepares two shapes at once.
    """
    config = config or Config()

    def run() -> PreparedShape:
        timer = StageTimer(progress, PREPARATION_SHARES)
        timer.start("body")
        shape = surface_from(surface)
        generator(seed)  # raises the error about a wrong seed before work begins
        settings = config.preparation
        if distances is not None:  # given distances are only right on the whole, unchanged surface
            settings = replace(settings, sheet_distance=np.inf, most_components=0)
        prepared = prepare_body(shape, body_of(shape, settings), config, seed, timer, distances)
        timer.reach("done", 1.0)
        return prepared

    return in_background(run)


def prepare_body(
    surface: Surface,
    component: Body,
    config: Config,
    seed: int,
    timer: StageTimer,
    distances: MetricSpace | None = None,
) -> PreparedShape:
    """Prepare one component of a shape at the resolution of the settings."""
    timer.start("levels")
    levels = [full_level(component)] if distances is not None else levels_of(component, config)
    level, finer = levels[-1], levels[-2] if len(levels) > 1 else None
    body, notes = level.surface, component.notes
    requested, config = config, config.for_size(body.n_vertices)
    if config != requested:
        notes += (
            f"small shape of {body.n_vertices} vertices: {config.n_columns} columns, rank {config.rank}, "
            f"{config.n_functions} functions",
        )
    if level.detail:
        notes += (
            f"matched on {body.n_vertices} of {component.surface.n_vertices} vertices, then extended to the rest; "
            "resolution = 'full' matches on all of them",
        )
    fine = config.preparation
    timer.start("distances")
    with serial_blas():
        if distances is None:
            engine = distance_engine(body, config.engine, weld=False)
        else:
            engine = _restricted_engine(distances, surface, component)
        sampling = farthest_point_sampling(engine, config.n_columns, peripheral_vertex(body, engine, seed))
        measure = body.vertex_areas if config.weights == "area" else np.ones(body.n_vertices)
        basis = nystrom_basis(sampling, np.maximum(measure, 1e-12), config.rank, engine.name)
        timer.start("functions")
        laplace = laplace_basis(body, config.n_functions, seed, "single", weld=False)
        timer.start("samples")
        remoteness, spacing = basis @ body.vertex_areas, fine.extremity_spacing
        extremities, columns = extremal_points(body, engine, remoteness, spacing, fine.n_extremities)
        count = min(max(config.n_search, config.n_refine), body.n_vertices)
        samples = _spread_samples(body, engine, count, int(sampling.vertices[0]))
    return PreparedShape(
        surface=surface,
        body=body,
        body_vertex=level.body_vertex,
        user_vertex=level.user_vertex,
        detail=level.detail,
        scale=level.scale,
        distances=basis,
        laplace=laplace,
        column_vertices=sampling.vertices,
        columns=sampling.columns.astype(np.float32),
        extremities=extremities,
        extremity_columns=columns,
        sample_vertices=samples,
        config=config,
        requested=requested,
        seed=seed,
        left_out=component.left_out,
        notes=notes,
        timings=timer.stop(),
        share=component.share,
        others=component.others,
        finer=finer,
        refining=level.refining if finer else None,
    )


def _restricted_engine(distances: MetricSpace, surface: Surface, component: Body) -> DistanceEngine:
    """Restrict distances between all vertices of the user to the body."""
    engine = distance_engine(distances)
    if engine.n_points != surface.n_vertices:
        raise MeshError(
            f"the given distances are between {engine.n_points} points, the shape has {surface.n_vertices} vertices; "
            "give one row for each vertex of the shape"
        )
    return RestrictedEngine(engine, component.user_vertex, component.scale)


def _spread_samples(body: Surface, engine: DistanceEngine, count: int, start: int) -> IntArray:
    """Choose farthest points in space, beginning far from the centroid; on a graph, along its edges."""
    if isinstance(body, Graph):
        return farthest_point_sampling(engine, count, start).vertices
    centred = body.vertices - np.average(body.vertices, axis=0, weights=body.vertex_areas)
    return euclidean_farthest_points(centred, count, first_largest((centred**2).sum(axis=1)))


def extremal_points(
    surface: Surface, engine: DistanceEngine, average_distance: FloatArray, spacing: float, limit: int
) -> tuple[IntArray, FloatArray]:
    """Find the local maxima of the average geodesic distance, the most remote first."""
    # In any pose, the average distance from a vertex to all others is large at the tips of limbs and least in
    # the middle of the shape. So its local maxima, where no neighbour has more, are the extremities. The
    # largest maximum comes first; a maximum nearer than ``spacing`` to an extremity is passed over.
    i, j = surface.edges.T
    highest = np.full(surface.n_vertices, -np.inf)
    np.maximum.at(highest, i, average_distance[j])
    np.maximum.at(highest, j, average_distance[i])
    peaks = np.flatnonzero(average_distance >= highest - TIE_RATIO * average_distance.max())
    nearest = np.full(surface.n_vertices, np.inf)  # distance to the nearest extremity
    extremities: list[int] = []
    columns = np.zeros((0, surface.n_vertices))
    while len(extremities) < limit and len(peaks := peaks[nearest[peaks] >= spacing]):
        extremities.append(int(peaks[first_largest(average_distance[peaks])]))
        columns = np.concatenate([columns, engine.distances_from(np.array(extremities[-1:]))])
        np.minimum(nearest, columns[-1], out=nearest)
    return np.array(extremities, dtype=np.int64), columns
