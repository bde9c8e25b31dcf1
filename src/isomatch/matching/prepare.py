"""Everything that can be computed from one shape alone, once, for any number of matches."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isomatch._arrays import Float32Array, FloatArray, IntArray
from isomatch._cached import cached_property
from isomatch._interruption import in_background
from isomatch._renamed import old_attributes
from isomatch._settings import generator
from isomatch._threads import serial_blas
from isomatch.assets import SurfaceLike, surface_from
from isomatch.bases import DistanceBasis, laplace_basis, nystrom_basis, refined_laplace_basis
from isomatch.correspondence import (
    SampledBasis,
    SignedPoints,
)
from isomatch.descriptors import geodesic_distance_descriptor, mean_curvature, standardised
from isomatch.errors import MeshError, NotConvergedError, SettingError
from isomatch.geodesics import (
    DistanceEngine,
    MetricSpace,
    RestrictedEngine,
    distance_engine,
    euclidean_farthest_points,
    farthest_point_sampling,
    peripheral_vertex,
)
from isomatch.matching.body import LEFT_UNMATCHED, Body, body_of, sound_body
from isomatch.matching.config import Config
from isomatch.matching.extremities import extremal_points
from isomatch.matching.levels import Level, full_level, levels_of
from isomatch.matching.orientation import orientation_of
from isomatch.matching.prepared_file import read_prepared, write_prepared
from isomatch.matching.smooth_shape import SmoothShape
from isomatch.matching.stage_timer import PREPARATION, Progress, StageTimer
from isomatch.matching.symmetries import Symmetry, find_symmetries
from isomatch.mending import capped, check
from isomatch.resolution import Prolongation
from isomatch.surfaces import Graph, Surface


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PreparedShape(SmoothShape):
    """One shape, ready to be matched.

    All vertices below are vertices of the *body*, except in ``body_vertex`` and ``user_vertex``.

    Parameters
    ----------
    surface, body, body_vertex, user_vertex, laplace, sample_vertices, config, detail
        As for ``SmoothShape``.
    scale : float
        What a length of 1 in the body is worth in the user's units: √area of the body, or of a graph the average distance
        over ``graph_average_distance``.
    distances : DistanceBasis
        Geodesic distance basis of the body, rank k.
    column_vertices : (p,) array of int
        Farthest point samples from which distances were computed.
    columns : (p, n_body) array of float32
        Geodesic distances from each of them.
    extremities : (q,) array of int
        Extremal points of the body.
    extremity_columns : (q, n_body) array of float
        Geodesic distances from each of them.
    requested : Config
        The settings asked for.
    seed : int
        The seed used.
    left_out : float
        Share of the area in components other than the body, or of the vertices in those of at least 50 vertices, if that
        is larger.
    notes : tuple of str
        What was repaired or left out.
    timings : dict of str to float
        Seconds of each stage of the preparation.
    share : float
        Share of the area of the shape that the body has.
    others : tuple of Body
        Further components of a mesh that can be matched by themselves, largest first; not prepared.
    finer : Level, optional
        A finer level, on which maps of complete shapes are polished.
    refining : Prolongation, optional
        Between the finer level and the body.
    """

    scale: float
    distances: DistanceBasis
    column_vertices: IntArray
    columns: Float32Array
    extremities: IntArray
    extremity_columns: FloatArray
    requested: Config
    seed: int
    left_out: float
    notes: tuple[str, ...]
    timings: dict[str, float]
    share: float = 1.0
    others: tuple[Body, ...] = ()
    finer: Level | None = None
    refining: Prolongation | None = None

    if not TYPE_CHECKING:  # otherwise a misspelt attribute would pass as one that was renamed
        __getattr__ = old_attributes(
            mesh="surface",
            mesh_vertex="user_vertex",
            samples="column_vertices",
            features="extremities",
            feature_columns="extremity_columns",
            spread="sample_vertices",
            cloud="points",
        )

    def save(self, path: str | Path) -> None:
        """Write everything to an ``.npz`` file, so that the shape need not be prepared again.

        Raises
        ------
        UnwritableFileError
            If the file cannot be written.
        """
        write_prepared(Path(path), self)

    @classmethod
    def load(cls, path: str | Path, config: Config | None = None) -> PreparedShape:
        """Read what `save` wrote; matches are the same to the last bit.

        Parameters
        ----------
        path : path_like
            The file.
        config : Config, optional
            Settings of the matches to come: a shape prepared otherwise is refused here.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), damaged, holds something else, or was written by an isomatch that
            prepared shapes in another way.
        SettingError
            If the shape was prepared with other settings than ``config``.
        """
        found: PreparedShape = read_prepared(Path(path), cls)
        if config:
            found.require_prepared_for(config, str(path))
        return found

    def require_prepared_for(self, config: Config, what: str) -> None:
        """Raise `SettingError`, about ``what``, if the shape was prepared with other settings than a match asks for."""
        in_full = config.resolution == "full" and self.detail is None and not self.others
        used_config = replace(self.requested, resolution="full") if in_full else self.requested
        if name := used_config.differs_in_preparation(config):
            used, asked = getattr(self.requested, name), getattr(config, name)
            raise SettingError(
                f"{what} was prepared with {name} = {used!r}, the match asks for {asked!r}; prepare both shapes "
                "with the settings of the match"
            )

    @property
    def seconds(self) -> float:
        """Time the preparation took."""
        return self.timings["total"]

    def __repr__(self) -> str:
        return f"PreparedShape({self.surface!r}, {self.distances!r}, {self.laplace!r})"

    @cached_property
    def average_distance(self) -> FloatArray:
        """(n_body,) average geodesic distance of each vertex to the surface."""
        return self.distances @ self.body.vertex_areas

    @cached_property
    def intrinsic_scale(self) -> float:
        """The unit in which distances of two shapes are compared: by default the average between two points."""
        if self.config.preparation.distance_unit == "user":
            return 1.0 / self.scale
        return float(self.body.vertex_areas @ self.average_distance)

    def distance(self, a: IntArray, b: IntArray) -> FloatArray:
        """Low-rank geodesic distances between vertices of two lists (q,), in √area; O(k) a pair."""
        return np.where(a == b, 0.0, np.maximum(self.distances.distance(a, b), 0.0))

    def mean_distance(self, a: IntArray, b: IntArray) -> float:
        """Mean of these distances."""
        return float(self.distance(a, b).mean())

    def distances_between(self, vertices: IntArray) -> FloatArray:
        """Low-rank geodesic distances between m vertices, (m, m), in √area."""
        distances: FloatArray = np.maximum(self.distances.between(vertices, vertices), 0.0)
        distances /= np.sqrt(self.body.area)
        np.fill_diagonal(distances, 0.0)
        return distances

    @cached_property
    def boundary_length(self) -> float:
        """Length of the boundary of the body, in √area; 0 of points and graphs."""
        if self.triangles is None:
            return 0.0
        i, j = self.triangles.boundary_edges.T
        return float(np.linalg.norm(self.triangles.vertices[i] - self.triangles.vertices[j], axis=1).sum())

    @cached_property
    def one_sided(self) -> bool:
        """Whether the body has no inside, like a Möbius strip: some edge of two faces has them wound alike."""
        return self.triangles is not None and len(check(self.triangles).inconsistent_edges) > 0

    @cached_property
    def capped(self) -> PreparedShape:
        """The body as a shape of its own, with its holes closed: its first vertices are those of the body."""
        if self.triangles is None or not self.boundary_length:
            same = np.arange(self.body.n_vertices)
            alone = replace(self, surface=self.body, body_vertex=same, user_vertex=same, scale=1.0, notes=())
            return replace(alone, others=(), detail=None, finer=None, refining=None)
        closed, config = capped(self.triangles), replace(self.requested, resolution="full")
        return _prepared(closed, sound_body(closed), config, self.seed, StageTimer())

    @cached_property
    def components(self) -> tuple[PreparedShape, ...]:
        """The body and the further components, each as a prepared shape of the same surface that leaves nothing out.

        Those that cannot be prepared are missing.
        """
        notes = tuple(note for note in self.notes if LEFT_UNMATCHED not in note)
        found = [replace(self, left_out=0.0, notes=notes, others=())]
        for body in self.others:
            with suppress(MeshError, NotConvergedError):
                found.append(_prepared(self.surface, body, self.requested, self.seed, StageTimer()))
        return tuple(found)

    @cached_property
    def polishable(self) -> SmoothShape:
        """The shape on which maps are polished: itself, if it has no finer level."""
        if self.finer is None or self.refining is None:
            return self
        body = self.finer.surface
        between = self.refining.on_coarse.interpolation(self.body.n_vertices)
        laplace = refined_laplace_basis(body, self.laplace, between)
        return SmoothShape(
            surface=self.surface,
            body=body,
            body_vertex=self.finer.body_vertex,
            user_vertex=self.finer.user_vertex,
            laplace=laplace,
            sample_vertices=self.refining.nearest_members[self.sample_vertices],
            config=self.config,
            detail=self.finer.detail,
        )

    @cached_property
    def points(self) -> SignedPoints:
        """Geodesic distance descriptors of the body, in units of the intrinsic scale, as a signed point cloud."""
        descriptor = geodesic_distance_descriptor(self.distances)
        signs = descriptor.signature
        if not self.config.preparation.block_diagonal:
            signs = np.ones_like(signs)
        return SignedPoints(descriptor.coordinates / np.sqrt(self.intrinsic_scale), signs)

    @cached_property
    def curvature(self) -> FloatArray:
        """(n_body,) signed mean curvature of the smoothed body, of mean 0 and variance 1 in the areas.

        0 where there are no triangles.
        """
        if self.triangles is None:
            return np.zeros(self.body.n_vertices)
        curvature = mean_curvature(
            self.triangles, self.laplace, self.config.preparation.energy_curvature_functions
        )
        return standardised(curvature[:, None], self.triangles.vertex_areas)[:, 0]

    @cached_property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Maps of the shape onto itself, by rows of its search vertices."""
        settings = self.config.symmetry
        vertices = self.sample_vertices[: self.config.n_search]
        basis = SampledBasis(self.laplace.vectors, vertices)
        k = min(self.config.selection.normal_functions, len(self.laplace.values))
        return find_symmetries(
            self.points.at(vertices, self.config.search.start_columns),
            self.distances_between(vertices),
            lambda image_row: orientation_of(self, basis, self, vertices[image_row], k),
            settings,
        )


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
        Anything that `surface_from` takes, with one main component; further ones of a mesh are prepared when they are
        needed. Points and graphs have neither an inside nor curvature: maps from or to them rest on distances and
        spectra alone, which do not tell a shape from its mirror image.
    config : Config, optional
        Settings.
    seed : int
        Draws where sampling starts, and seeds the eigensolver.
    distances : (n, n) array, callable or DistanceEngine, optional
        Your own distances between the vertices of ``surface``, in its units, in place of ``config.engine``; see
        `distance_engine`. Finite within the main component. A callable is called on other threads than the caller's.
    progress : callable, optional
        Called with the name of each stage and the share that is done; see `match`.

    Returns
    -------
    PreparedShape
        Its ``notes`` report what was repaired or left out.

    Raises
    ------
    MeshError
        If the mesh has no faces, coordinates that are not finite, faces that refer to missing vertices, or fewer
        than 50 usable vertices; or if the given distances do not fit it.
    SettingError
        If the seed is not an integer of at least 0, or the shape has no engine of that name.

    Notes
    -----
    About 0.35 s for 5 000 vertices on one thread, half of it for the Laplace–Beltrami basis, and 0.5 s for 28 000, which
    are matched on 5 000 of them (``config.resolution``). `match` prepares two shapes at once.
    """
    return in_background(lambda: _prepare(surface, config or Config(), seed, distances, progress))


def _prepare(
    given: SurfaceLike,
    config: Config,
    seed: int,
    distances: MetricSpace | None,
    progress: Progress | None,
) -> PreparedShape:
    timer = StageTimer(progress, PREPARATION)
    timer.start("body")
    surface = surface_from(given)
    generator(seed)  # refuses what is no seed
    if distances is None:
        prepared = _prepared(surface, body_of(surface, config.preparation), config, seed, timer)
    else:
        found = body_of(surface, replace(config.preparation, sheet_distance=np.inf, most_components=0))
        prepared = _prepared(surface, found, config, seed, timer, distances)
    timer.reach("done", 1.0)
    return prepared


def _prepared(
    surface: Surface,
    found: Body,
    config: Config,
    seed: int,
    timer: StageTimer,
    distances: MetricSpace | None = None,
) -> PreparedShape:
    """Prepare one component of a shape, at the resolution that is asked for."""
    timer.start("levels")
    levels = [full_level(found)] if distances is not None else levels_of(found, config)
    level, finer = levels[-1], levels[-2] if len(levels) > 1 else None
    body, notes = level.surface, found.notes
    requested, config = config, config.for_size(body.n_vertices)
    if config != requested:
        notes += (
            f"small shape of {body.n_vertices} vertices: {config.n_columns} columns, rank {config.rank}, "
            f"{config.n_functions} functions",
        )
    if level.detail:
        notes += (
            f"matched on {body.n_vertices} of {found.surface.n_vertices} vertices, and carried to all; "
            "resolution = 'full' matches all",
        )
    fine = config.preparation
    timer.start("distances")
    with serial_blas():
        engine = (
            distance_engine(body, config.engine) if distances is None else _given(distances, surface, found)
        )
        sampling = farthest_point_sampling(engine, config.n_columns, peripheral_vertex(body, engine, seed))
        measure = body.vertex_areas if config.weights == "area" else np.ones(body.n_vertices)
        basis = nystrom_basis(sampling, np.maximum(measure, 1e-12), config.rank, engine.name)
        timer.start("functions")
        laplace = laplace_basis(body, config.n_functions, seed, "single")
        timer.start("samples")
        extremities, extremity_columns = extremal_points(
            body, engine, basis @ body.vertex_areas, fine.extremity_spacing, fine.n_extremities
        )
        count = min(max(config.n_search, config.n_refine), body.n_vertices)
        samples = _evenly_spread(body, engine, count, int(sampling.vertices[0]))
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
        extremity_columns=extremity_columns,
        sample_vertices=samples,
        config=config,
        requested=requested,
        seed=seed,
        left_out=found.left_out,
        notes=notes,
        timings=timer.stop(),
        share=found.share,
        others=found.others,
        finer=finer,
        refining=level.refining if finer else None,
    )


def _given(distances: MetricSpace, surface: Surface, found: Body) -> DistanceEngine:
    """Restrict distances given for all of the user's vertices to the body."""
    engine = distance_engine(distances)
    if engine.n_points != surface.n_vertices:
        raise MeshError(
            f"the given distances are between {engine.n_points} points, the shape has {surface.n_vertices} vertices; "
            "give one row for each vertex of the shape"
        )
    return RestrictedEngine(engine, found.user_vertex, found.scale)


def _evenly_spread(body: Surface, engine: DistanceEngine, count: int, start: int) -> IntArray:
    """Farthest points in space, from the one farthest from the centroid; along the edges of a graph, without space."""
    if isinstance(body, Graph):
        return farthest_point_sampling(engine, count, start).vertices
    centred = body.vertices - np.average(body.vertices, axis=0, weights=body.vertex_areas)
    return euclidean_farthest_points(centred, count, int((centred**2).sum(axis=1).argmax()))
