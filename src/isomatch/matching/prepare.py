"""Everything that can be computed from one shape alone, once, for any number of matches."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import serial_blas
from isomatch.bases import DistanceBasis, LaplaceBasis, laplace_basis, nystrom_basis
from isomatch.correspondence import UNMATCHED, Correspondence
from isomatch.descriptors import (
    GeodesicDistanceDescriptor,
    geodesic_distance_descriptor,
    mean_curvature,
    standardised,
)
from isomatch.errors import SettingError
from isomatch.geodesics import distance_engine, farthest_point_sampling, peripheral_vertex
from isomatch.matching.body import body_of
from isomatch.matching.config import Config
from isomatch.matching.features import (
    extremal_points,
    point_signatures,
    spread_vertices,
    surface_cells,
)
from isomatch.matching.nearest import Cells
from isomatch.surfaces import Graph, Mesh, Surface

FEATURE_SPACING = 0.25  # in √area: keeps fingers from displacing hands
FEATURE_LIMIT = 8
LARGE_COMPONENT = 0.05  # share of the area at which a component left out is worth a warning


@dataclass(frozen=True, eq=False, repr=False)
class PreparedShape:
    """One shape, ready to be matched.

    Parameters
    ----------
    mesh : Mesh, PointCloud or Graph
        The user's shape, untouched.
    body : Mesh, PointCloud or Graph
        What is matched: the largest connected component, a mesh welded and wound outward, centred, of unit area.
        Lengths below are in its units.
    body_vertex : (n,) array of int
        Body vertex of each vertex of ``mesh``; −1 for those left out.
    mesh_vertex : (n_body,) array of int
        Vertex of ``mesh`` of each body vertex.
    scale : float
        √area of the body in mesh units: what a length of 1 in the body is worth.
    distances : DistanceBasis
        Geodesic distance basis of the body, rank k.
    laplace : LaplaceBasis
        Laplace–Beltrami basis of the body, K functions.
    samples : (p,) array of int
        Farthest point samples, vertices of the body.
    columns : (p, n_body) array of float32
        Geodesic distances from each sample.
    features : (q,) array of int
        Extremal points of the body.
    feature_columns : (q, n_body) array of float
        Geodesic distances from each of them.
    spread : (r,) array of int
        Body vertices evenly spread in space; every prefix is.
    config : Config
        The settings used; smaller than those asked for where a small mesh cannot provide them (``notes`` say so).
    requested : Config
        The settings asked for.
    seed : int
        The seed used.
    left_out : float
        Share of the area in components other than the body.
    notes : tuple of str
        What was left out or mended.
    seconds : float
        How long it took.
    """

    mesh: Surface
    body: Surface
    body_vertex: IntArray
    mesh_vertex: IntArray
    scale: float
    distances: DistanceBasis
    laplace: LaplaceBasis
    samples: IntArray
    columns: np.ndarray[tuple[int, int], np.dtype[np.float32]]
    features: IntArray
    feature_columns: FloatArray
    spread: IntArray
    config: Config
    requested: Config
    seed: int
    left_out: float
    notes: tuple[str, ...]
    seconds: float

    def __repr__(self) -> str:
        return f"PreparedShape({self.mesh!r}, {self.distances!r}, {self.laplace!r})"

    @property
    def triangles(self) -> Mesh | None:
        """The body, if it is made of triangles and so has an inside, normals and curvature."""
        return self.body if isinstance(self.body, Mesh) else None

    @property
    def faces(self) -> IntArray:
        """(m, 3) triangles of the body; none of points or a graph."""
        return self.body.faces if isinstance(self.body, Mesh) else np.zeros((0, 3), dtype=np.int64)

    @cached_property
    def average_distance(self) -> FloatArray:
        """(n_body,) average geodesic distance of each vertex to the surface."""
        return self.distances @ self.body.vertex_areas

    @cached_property
    def intrinsic_scale(self) -> float:
        """Average distance between two points: the unit in which distances of two shapes are compared."""
        return float(self.body.vertex_areas @ self.average_distance)

    def mean_distance(self, a: IntArray, b: IntArray) -> float:
        """Mean low-rank geodesic distance between body vertices of two lists, in √area; O(k) a pair."""
        apart = np.maximum(self.distances.distance(a, b), 0.0)
        return float(np.where(a == b, 0.0, apart).mean())

    @cached_property
    def cloud(self) -> GeodesicDistanceDescriptor:
        """Geodesic distance descriptors of the body, in units of the intrinsic scale."""
        descriptor = geodesic_distance_descriptor(self.distances)
        return GeodesicDistanceDescriptor(
            descriptor.coordinates / np.sqrt(self.intrinsic_scale), descriptor.signature
        )

    @cached_property
    def signatures(self) -> FloatArray:
        """(n_body, 23) wave kernel signatures, and curvatures of a mesh: points and graphs have (n_body, 20)."""
        return point_signatures(self.triangles, self.laplace)

    @cached_property
    def curvature(self) -> FloatArray:
        """(n_body,) signed mean curvature of the body low-passed to 100 functions, of mean 0 and variance 1 in the areas.

        0 where there are no triangles.
        """
        mesh = self.triangles
        if mesh is None:
            return np.zeros(self.body.n_vertices)
        return standardised(mean_curvature(mesh, self.laplace, 100)[:, None], mesh.vertex_areas)[:, 0]

    @cached_property
    def cells(self) -> Cells:
        """Partition of the body around spread vertices, for nearest neighbours.

        With c centres a query costs c distances by matrix product and those of about eight cells of n / c vertices,
        four times slower each: least for c = √(32 n).
        """
        return surface_cells(self.body, self.spread[: int(np.sqrt(32 * self.body.n_vertices))])

    def lifted(
        self,
        target: PreparedShape,
        image: IntArray,
        corners: IntArray | None = None,
        barycentric: FloatArray | None = None,
    ) -> Correspondence:
        """Express a map of bodies in the users' own indices.

        ``image`` (n_body,), ``corners`` (n_body, 3) and ``barycentric`` (n_body, 3) refer to body vertices of the target.
        """
        if corners is None or barycentric is None:
            corners, barycentric = (
                np.repeat(image[:, None], 3, axis=1),
                np.tile([1.0, 0.0, 0.0], (len(image), 1)),
            )
        vertices, faces = (
            np.concatenate([target.mesh_vertex[found], np.full((1, *found.shape[1:]), UNMATCHED)])
            for found in (image, corners)
        )
        rows = self.body_vertex  # −1, for vertices left out, picks the last row
        return Correspondence(
            vertices[rows],
            target.mesh.n_vertices,
            faces[rows],
            np.vstack([barycentric, [1.0, 0.0, 0.0]])[rows],
        )


def prepare(surface: Surface, config: Config | None = None, seed: int = 0) -> PreparedShape:
    """Compute everything about one shape that matching needs.

    Parameters
    ----------
    surface : Mesh, PointCloud or Graph
        Any shape with one main component. Points and graphs have neither an inside nor curvature: maps from or to them
        rest on distances and spectra alone, which do not tell a shape from its mirror image.
    config : Config, optional
        Settings.
    seed : int
        Draws where sampling starts, and seeds the eigensolver.

    Returns
    -------
    PreparedShape
        Its ``notes`` tell what was mended or left out.

    Raises
    ------
    MeshError
        If the mesh has no faces, coordinates that are not finite, faces that refer to missing vertices, or fewer
        than 50 usable vertices.

    Notes
    -----
    About 0.5 s for 5 000 vertices and 4 s for 28 000 on one thread; half of it is the Laplace–Beltrami basis. Two shapes
    are prepared at once by `match`. 8 n (K + k) + 4 n p bytes are kept.
    """
    started = time.perf_counter()
    config = config or Config()
    if seed < 0:
        raise SettingError(f"seed = {seed} is negative; give 0 or more")
    found = body_of(surface)
    body, notes = found.surface, found.notes
    requested, config = config, _fitting(config, body.n_vertices)
    if config != requested:
        notes += (
            f"small shape of {body.n_vertices} vertices: {config.n_columns} columns, rank {config.rank}, "
            f"{config.n_functions} functions",
        )
    with serial_blas():
        engine = distance_engine(body)
        sampling = farthest_point_sampling(engine, config.n_columns, peripheral_vertex(body, engine, seed))
        measure = body.vertex_areas if config.weights == "area" else np.ones(body.n_vertices)
        distances = nystrom_basis(sampling, np.maximum(measure, 1e-12), config.rank, engine.name)
        laplace = laplace_basis(body, config.n_functions, seed)
        features, feature_columns = extremal_points(
            body, engine, distances @ body.vertex_areas, FEATURE_SPACING, FEATURE_LIMIT
        )
        count = min(max(config.n_search, config.n_refine), body.n_vertices)
        spread = (
            spread_vertices(body.vertices, body.vertex_areas, count)
            if not isinstance(body, Graph)
            else farthest_point_sampling(engine, count, int(sampling.vertices[0])).vertices
        )
    return PreparedShape(
        mesh=surface,
        body=body,
        body_vertex=found.body_vertex,
        mesh_vertex=found.mesh_vertex,
        scale=found.scale,
        distances=distances,
        laplace=laplace,
        samples=sampling.vertices,
        columns=sampling.columns.astype(np.float32),
        features=features,
        feature_columns=feature_columns,
        spread=spread,
        config=config,
        requested=requested,
        seed=seed,
        left_out=found.left_out,
        notes=notes,
        seconds=time.perf_counter() - started,
    )


def _fitting(config: Config, n: int) -> Config:
    """Reduce what a small mesh cannot provide."""
    columns = min(config.n_columns, n // 2)
    return replace(
        config,
        n_columns=columns,
        rank=min(config.rank, columns // 2 if columns < config.n_columns else config.rank),
        n_functions=max(20, min(config.n_functions, n // 4)),
    )
