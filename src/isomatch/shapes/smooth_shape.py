"""A body at one resolution with its smooth functions, as the joint refinement needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray, single
from isomatch._core.cached import cached_method, cached_property
from isomatch._core.compiled import compiled
from isomatch._core.errors import DescriptorError, MeshError
from isomatch._core.threads import parallel_map, row_product
from isomatch.correspondence import (
    UNMATCHED,
    Correspondence,
    PrecisePoints,
    SampledBasis,
    SurfaceIndex,
    VertexCells,
)
from isomatch.decimation import Decimated, Prolongation
from isomatch.descriptors import mean_curvature, standardised, wave_kernel_signature
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.settings import Config
from isomatch.shapes.body import Detail
from isomatch.spectral import LaplaceBasis
from isomatch.surfaces import Mesh, Surface, vertex_normals

SIGNATURE_FUNCTIONS = 100  # functions of the wave kernel signature; chosen: Aubry et al. 2011 take 100 to 300
# Root mean squares to which the wave kernel signature, and the curvatures, are scaled in point signatures.
# The mean error on 9 pairs is 2.43 % of √area; with WAVE_WEIGHT 0.8 2.41, with CURVATURE_WEIGHT 0.6 2.70.
WAVE_WEIGHT, CURVATURE_WEIGHT = 0.6, 0.4
# values in logarithms and denominators are raised to this, the least normal positive float, so that none is 0
MIN_POSITIVE = np.finfo(float).tiny


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SmoothShape:
    """A body at one resolution, its Laplace–Beltrami functions, and the way back to the user's vertices.

    Parameters
    ----------
    surface : Mesh, PointCloud or Graph
        The user's shape, untouched.
    body : Mesh, PointCloud or Graph
        The matched part: the largest connected component, n_body vertices, centred and of unit
        area; a mesh is welded and wound outward. Lengths below are in units of the body.
    body_vertex : (n,) array of int
        Body vertex of each vertex of ``surface``, the nearest one if the body is coarser; −1 off
        the body.
    user_vertex : (n_body,) array of int
        Vertex of ``surface`` of each body vertex, or the nearest one; where glued sheets were
        separated, several body vertices have the same.
    laplace : LaplaceBasis
        Laplace–Beltrami basis of the body, K functions.
    sample_vertices : (r,) array of int
        Vertices evenly spread over the body, as are the first of them, however many.
    config : Config
        The settings used; numbers are lower than requested where a small shape cannot provide them.
    detail : Detail, optional
        The body at the user's resolution, if ``body`` is coarser.
    """

    surface: Surface
    body: Surface
    body_vertex: IntArray
    user_vertex: IntArray
    laplace: LaplaceBasis
    sample_vertices: IntArray
    config: Config
    detail: Detail | None = None

    @property
    def triangles(self) -> Mesh | None:
        """The body, if it is a mesh, with an inside, normals and curvature; otherwise None."""
        return self.body if isinstance(self.body, Mesh) else None

    @property
    def mesh_body(self) -> Mesh:
        """The body, which must be a mesh.

        Raises
        ------
        MeshError
            If it is a point cloud or a graph.
        """
        if not isinstance(self.body, Mesh):
            raise MeshError(f"{self.surface!r} has no triangles; give a Mesh")
        return self.body

    @property
    def faces(self) -> IntArray:
        """(m, 3) triangles of the body; (0, 3) for points or a graph."""
        return self.body.faces if isinstance(self.body, Mesh) else np.zeros((0, 3), dtype=np.int64)

    @cached_property
    def signatures(self) -> FloatArray:
        """(n_body, 23) point signatures; (n_body, 20) for points and graphs, which have no curvature."""
        # The 20 columns of the wave kernel signature (Aubry et al. 2011) differ by orders of magnitude, so
        # their logarithms are taken. The body is smoothed to three numbers of functions; the 3 mean
        # curvatures then tell bumps from dents, a chest from a back, as no intrinsic measure does. Each
        # column is standardised by area. Together, the columns of each kind are scaled to the root mean
        # square WAVE_WEIGHT or CURVATURE_WEIGHT.
        settings, laplace = self.config.preparation, self.laplace
        kernel = wave_kernel_signature(laplace, k=SIGNATURE_FUNCTIONS)[:, :: settings.signature_step]
        parts = [(np.log(np.maximum(kernel, MIN_POSITIVE)), WAVE_WEIGHT)]
        if self.triangles is not None:
            sizes = (min(k, len(laplace.values)) for k in settings.curvature_functions)
            curvatures = [mean_curvature(self.triangles, laplace, k, weld=False) for k in sizes]
            parts.append((np.column_stack(curvatures), CURVATURE_WEIGHT))
        scaled = (standardised(part, laplace.weights) * (w / np.sqrt(part.shape[1])) for part, w in parts)
        return np.hstack([*scaled])

    @cached_property
    def functions(self) -> Float32Array:
        """(n_body, K) Laplace–Beltrami functions in single precision."""
        return single(self.laplace.vectors)

    @cached_method
    def sampled_basis(self, count: int) -> SampledBasis:
        """Return the functions, to be fitted to values at the first ``count`` sample vertices."""
        return SampledBasis(self.laplace.vectors, self.sample_vertices[:count])

    @cached_property
    def position_coefficients(self) -> FloatArray:
        """(K, 3) coefficients of the positions of the body in the Laplace–Beltrami functions."""
        return self.laplace.coefficients(self.mesh_body.vertices)

    @cached_method
    def smoothed(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Positions of the body in its first k functions, and the normals there: (n_body, 3) each."""
        # The projection Φ_k Φ_kᵀ M x of the positions x (Vallet & Lévy, Spectral geometry processing, 2008).
        # For small k the body has no details, and normals under two maps can be compared.
        vertices = row_product(self.functions[:, :k], self.position_coefficients[:k])
        return vertices, vertex_normals(vertices, self.faces)

    @cached_property
    def index(self) -> SurfaceIndex:
        """Triangles and cells of the body, for nearest vertices and points."""
        # With c cells of n vertices, a query computes c distances by a matrix product, and n / c distances in
        # each of about eight cells; one of the latter takes four times as long. The sum c + 4 · 8 n / c is
        # least at c = √(32 n).
        centres = self.sample_vertices[: int(np.sqrt(32 * self.body.n_vertices))]
        number = np.zeros(self.body.n_vertices, dtype=np.int64)
        number[centres] = np.arange(len(centres))
        owner = number[distance_along_edges_to_nearest(self.body, centres)[1]]
        return SurfaceIndex(self.faces, VertexCells.of(centres, owner))

    @cached_property
    def transfer(self) -> Prolongation:
        """Prolongation between the body in full and this one, both meshes."""
        if self.detail:
            return self.detail.transfer
        all_vertices = np.arange(self.body.n_vertices)
        return Prolongation(self.mesh_body, Decimated(self.mesh_body, all_vertices, len(all_vertices)))

    def lift(self, values: AnyArray, missing: float = np.nan) -> AnyArray:
        """Carry values (n_body, ...) on the body to the user's vertices (n, ...), by nearest vertices.

        Vertices off the body get ``missing``: nan, which turns integers into floats, or a number
        such as −1 for labels.
        """
        values = _require_rows(values, self.body.n_vertices, "body vertices")
        return _at_vertices(values, self.body_vertex, missing)

    def lift_smooth(self, values: FloatArray) -> FloatArray:
        """Carry a smooth function (n_body,) to the user's vertices (n,); nan off the body."""
        if self.detail:
            values = self.detail.transfer.on_coarse.interpolated(values[:, None])[:, 0]
        return _at_vertices(values, (self.detail or self).body_vertex)

    def restrict(self, values: AnyArray) -> AnyArray:
        """Carry values (n, ...) on the user's vertices to the body (n_body, ...)."""
        rows = _require_rows(values, self.surface.n_vertices, "vertices of the shape")
        return np.asarray(rows[self.user_vertex])

    def correspondence(
        self, target: SmoothShape, image: IntArray | PrecisePoints, matched: BoolArray | None = None
    ) -> Correspondence:
        """Express a map of bodies, (n_body,) target vertices or points, in the users' own vertices.

        Vertices where ``matched`` (n_body,) is false have no image. Maps between coarse bodies are
        interpolated.
        """
        points = image if isinstance(image, PrecisePoints) else PrecisePoints.at_vertices(image)
        if matched is None:
            matched = np.ones(len(points.corners), dtype=bool)
        points, matched = self._to_full(target, points, matched)
        source_body, target_body = self.detail or self, target.detail or target
        user_corners = target_body.user_vertex[points.corners]
        user_corners[~matched] = UNMATCHED
        corners = _at_vertices(user_corners, source_body.body_vertex, UNMATCHED)
        weights = _at_vertices(points.barycentric, source_body.body_vertex)
        weights[corners[:, 0] == UNMATCHED] = [1.0, 0.0, 0.0]
        hashes = parallel_map(lambda shape: shape.surface.content_hash, (self, target))
        return Correspondence(corners[:, 0], target.surface.n_vertices, corners, weights, *hashes)

    def _to_full(
        self, target: SmoothShape, points: PrecisePoints, matched: BoolArray
    ) -> tuple[PrecisePoints, BoolArray]:
        """Carry a map of coarse bodies to the bodies in full."""
        # A vertex of the source in full lies in a coarse triangle with corners x_k, at x = Σ_k w_k x_k. Its
        # image is the point of the target in full nearest to Σ_k w_k T(x_k), where T is the coarse map. Where
        # T tears the triangle, this sum could be in the void between two limbs. Corners that are torn from
        # the first one, or have no image, get w_k = 0, and the other weights grow in proportion
        # (`_leave_out`). The first corner has the largest weight, and always stays.
        if self.detail is None and target.detail is None:
            return points, matched
        all_vertices = np.arange(self.body.n_vertices)
        places = self.detail.transfer.on_coarse if self.detail else PrecisePoints.at_vertices(all_vertices)
        owner = places.corners[:, 0]
        if target.detail is None and target.triangles is None:
            return PrecisePoints(points.corners[owner], points.barycentric[owner]), matched[owner]
        positions = points.interpolated(target.transfer.coarse.mesh.vertices)
        if self.detail:
            stretches, weights = np.empty((len(owner), 2)), places.barycentric.copy()
            _fill_stretches(self.detail.transfer.coarse.mesh.vertices, positions, places.corners, stretches)
            limit = np.sqrt(self.config.outcome.max_counted_growth) * np.median(stretches)
            _leave_out(stretches, limit, matched, places.corners, weights)
            places = PrecisePoints(places.corners, weights)
        images = target.transfer.near_fine(places.interpolated(positions), points.corners[owner])
        return images, matched[owner]


@compiled(error_model="numpy")
def _fill_stretches(before: FloatArray, after: FloatArray, corners: IntArray, stretches: FloatArray) -> None:
    """Fill (m, 2) factors by which the distances of the other two corners (m, 3) from the first grow."""
    for i in range(len(corners)):
        a = corners[i, 0]
        for k in range(2):
            b = corners[i, k + 1]
            square_before = (before[b, 0] - before[a, 0]) ** 2
            square_before += (before[b, 1] - before[a, 1]) ** 2 + (before[b, 2] - before[a, 2]) ** 2
            square_after = (after[b, 0] - after[a, 0]) ** 2
            square_after += (after[b, 1] - after[a, 1]) ** 2 + (after[b, 2] - after[a, 2]) ** 2
            stretches[i, k] = np.sqrt(square_after) / max(np.sqrt(square_before), MIN_POSITIVE)


@compiled(error_model="numpy")
def _leave_out(
    stretches: FloatArray, limit: float, matched: BoolArray, corners: IntArray, weights: FloatArray
) -> None:
    """Set the weights of corners torn from the first one, or unmatched, to 0; the sum of weights stays 1."""
    for i in range(len(corners)):
        total = weights[i, 0]
        for k in range(1, 3):
            if stretches[i, k - 1] > limit or not matched[corners[i, k]]:
                weights[i, k] = 0.0
            total += weights[i, k]
        for k in range(3):
            weights[i, k] /= total


def _at_vertices(values: AnyArray, body_vertex: IntArray, missing: float = np.nan) -> AnyArray:
    kind = np.result_type(values, np.float64) if np.isnan(missing) else values.dtype
    lifted: AnyArray = values[body_vertex].astype(kind, copy=False)
    lifted[body_vertex < 0] = missing
    return lifted


def _require_rows(values: AnyArray, n: int, what: str) -> AnyArray:
    rows = np.asarray(values)
    if rows.shape[:1] != (n,):
        raise DescriptorError(f"values of shape {rows.shape} do not have one row for each of {n} {what}")
    return rows


def orientation_of(
    source: SmoothShape, basis: SampledBasis, target: SmoothShape, target_vertex: IntArray, k: int
) -> float:
    """Mean cosine between the normals of the smoothed target and the normals of its copy on the source.

    Parameters
    ----------
    source, target : SmoothShape
    basis : SampledBasis
        The source's Laplace–Beltrami functions and the m vertices that are mapped.
    target_vertex : (m,) array of int
        Images of the m vertices.
    k : int
        Number of functions of the smoothed target.

    Returns
    -------
    float
        Near 1 if the map preserves the orientation of the faces, near −1 if it reverses it, and 0
        where a shape has no triangles.
    """
    # The positions of the images, fitted by k functions of the source, lay the source's faces on the target.
    # Where the map preserves the orientation, the normals of these faces agree with the target's normals at
    # the images; where it reverses the orientation, they are opposite.
    source_mesh, target_mesh = source.triangles, target.triangles
    if source_mesh is None or target_mesh is None:
        return 0.0
    k = min(k, basis.functions.shape[1], len(target.laplace.values))
    copy = basis.functions[:, :k] @ basis.fit(target_mesh.vertices[target_vertex], k)
    copy_normals = vertex_normals(copy, source_mesh.faces)[basis.vertices]
    target_normals = target.smoothed(k)[1][target_vertex]
    return float(np.einsum("ij,ij->i", copy_normals, target_normals).mean())
