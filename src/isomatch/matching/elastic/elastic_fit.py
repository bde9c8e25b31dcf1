"""Smooth maps between shapes that stretch: first maps, fits both ways, mirror images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dposv

from isomatch._core.arrays import (
    BodyVertices,
    Float,
    Float32Array,
    FloatArray,
    Int,
    IntArray,
    SampleRows,
    SoughtRows,
    single,
)
from isomatch._core.cached import cached_property
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding, IntervalCost, Intervals, assign_points, nearest_rows, pin_first
from isomatch.matching.parameters import ELASTIC_SEARCH
from isomatch.matching.priors import NO_LANDMARKS
from isomatch.matching.problem import Problem
from isomatch.settings import Config, ElasticSettings
from isomatch.shapes import PreparedShape, farthest_rows
from isomatch.surfaces import vertex_normals

RIDGE = 1e-9  # added to the diagonal of the normal equations, so that their solution is unique; chosen


@dataclass(frozen=True, eq=False)
class ElasticShape:
    """A prepared mesh with coordinates to which other shapes can be mapped smoothly."""

    prepared: PreparedShape  # its body is a mesh of n vertices
    settings: ElasticSettings
    # ``values`` at the mirror image of each vertex, smoothed; None if no mirror images were found
    mirrored: Float[FloatArray, "n values"] | None = None

    @cached_property
    def canonical(self) -> Float[FloatArray, "n d"]:
        """Canonical coordinates: classical scaling of farthest points, extended to all vertices."""
        # De Silva & Tenenbaum, Sparse multidimensional scaling using landmark points, 2004. Let D² be the
        # squared distances between p points, and −½ J D² J = V Λ Vᵀ, where J subtracts the mean over the
        # points. The points have the coordinates V Λ^½. A vertex with squared distances δ from the points has
        # the coordinates
        #     −½ Λ^−½ Vᵀ (δ − δ̄),   δ̄ the mean of D² over the points,
        # which at the points agree with V Λ^½. Only axes of the largest positive eigenvalues are kept.
        squares = self.prepared.columns.astype(np.float64) ** 2
        among = squares[:, self.prepared.column_vertices]
        among = (among + among.T) / 2
        mean = among.mean(axis=0)
        values, vectors = np.linalg.eigh(-0.5 * (among - mean - mean[:, None] + mean.mean()))
        first = np.argsort(-values, kind="stable")[: self.settings.n_coordinates]
        values, vectors = values[first], vectors[:, first]
        axes = vectors[:, values > 0] / np.sqrt(values[values > 0])
        return np.asarray(-0.5 * (squares - mean[:, None]).T @ axes)

    @cached_property
    def values(self) -> Float[FloatArray, "n values"]:
        """Canonical coordinates and positions in space, which a map to this shape pulls back."""
        return np.hstack([self.canonical, self.prepared.mesh_body.vertices])

    @cached_property
    def mirror_distance(self) -> Float[FloatArray, "n"]:
        """Distance of each vertex from its mirror image in canonical coordinates, or 0."""
        if self.mirrored is None:
            return np.zeros(len(self.canonical))
        d = self.canonical.shape[1]
        return np.asarray(np.linalg.norm(self.canonical - self.mirrored[:, :d], axis=1))

    def sample(self, count: int, everywhere: bool) -> Samples:
        """Take ``count`` samples; the candidates are these, or all vertices."""
        vertices, mesh = BodyVertices(self.prepared.sample_vertices[:count]), self.prepared.mesh_body
        if everywhere:
            ring, sought, faces = np.arange(mesh.n_vertices), np.arange(mesh.n_vertices), mesh.faces
        else:
            chosen = np.zeros(mesh.n_vertices, dtype=bool)
            chosen[vertices] = True
            faces = mesh.faces[chosen[mesh.faces].any(axis=1)]
            ring, faces = np.unique(faces, return_inverse=True)
            faces, sought = faces.reshape(-1, 3), np.searchsorted(ring, vertices)
        mirror_row = None
        if self.mirrored is not None:
            d = self.canonical.shape[1]
            mirror_row = SampleRows(nearest_rows(self.canonical[vertices], self.mirrored[vertices, :d]))
        targets, functions = BodyVertices(ring[sought]), self.prepared.laplace.vectors[ring]
        return Samples(
            self,
            everywhere,
            vertices,
            row=SoughtRows(vertices if everywhere else np.arange(len(vertices))),
            sought=sought,
            faces=faces,
            mirror_row=mirror_row,
            targets=targets,
            functions=functions,
            functions_sought=functions if everywhere else functions[sought],
            canonical=self.canonical[targets],
            normals=mesh.vertex_normals[targets],
        )


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a shape, and the c candidates among which images are searched."""

    shape: ElasticShape
    everywhere: bool  # whether the candidates are all vertices, and not the samples
    vertices: Int[BodyVertices, "m"]  # the samples, as vertices
    row: Int[SoughtRows, "m"]  # rows of the samples among the candidates
    # rows of the candidates in the ring, which consists of the vertices of all faces around them
    sought: Int[IntArray, "c"]
    faces: Int[IntArray, "f 3"]  # faces of the ring, by its rows
    mirror_row: Int[SampleRows, "m"] | None  # sample nearest to the mirror image of each sample
    targets: Int[BodyVertices, "c"]  # the candidates, as vertices
    functions: Float[FloatArray, "ring k"]  # Laplace–Beltrami functions on the ring
    functions_sought: Float[FloatArray, "c k"]  # Laplace–Beltrami functions on the candidates
    canonical: Float[FloatArray, "c d"]  # canonical coordinates of the candidates
    normals: Float[FloatArray, "c 3"]  # normals of the candidates


class Coefficients(NamedTuple):
    """Smooth maps in both directions, as coefficients of the first functions of each shape."""

    source: Float[
        FloatArray, "k_s values_t"
    ]  # A: columns expand the target's values in the source's functions
    target: Float[
        FloatArray, "k_t values_s"
    ]  # B: columns expand the source's values in the target's functions


class Step(NamedTuple):
    """A step of the fit: functions, smoothness, iterations, and respect of mirror images."""

    n_functions: int
    smoothness: float  # μ in `ElasticFit`; its square root is a length in √area
    iterations: int
    symmetric: bool


# Steps of the coarse fit: number of functions, squared length of smoothing in areas of the shape, iterations,
# whether mirror images are respected. After each step, only the best maps are kept. So few functions
# represent limbs but no details; the smoothing was chosen together with them: decisions.md, elastic choice
COARSE_STEPS = Step(20, 0.01, 2, True), Step(20, 0.01, 2, True), Step(30, 0.007, 4, True)


class Images(NamedTuple):
    """Images of the samples in both directions, as rows of the candidates."""

    forth: Int[SoughtRows, "samples_s"]
    back: Int[SoughtRows, "samples_t"]
    spectral_residual: float  # mean distance to the images, summed over both directions
    # mean cosine between normals of each shape and of its copy on the other shape, times the side of the fit:
    # 1 if the maps have the orientation that they should have
    orientation: float


# canonical coordinates and normals of a shape, copied by a smooth map to the candidates of the other shape
_Copy: TypeAlias = tuple[Float[FloatArray, "_ d"], Float[FloatArray, "_ 3"]]


@dataclass(frozen=True, eq=False)
class ElasticFit:
    """Fits smooth maps in both directions, by alternating between images and functions."""

    # After Ezuz, Solomon & Ben-Chen, Reversible harmonic maps between discrete surfaces, 2019. Let
    # c be canonical coordinates and positions (`values`), Φ and Ψ the first Laplace–Beltrami
    # functions of source and target. Let X = Φ A be a smooth map into the values of the target, and
    # Y = Ψ B one into the values of the source. Together with images T of the source's samples and
    # S of the target's samples, they minimise
    #     μ (tr Aᵀ Λ_s A + tr Bᵀ Λ_t B)                                     Dirichlet energies
    #     + mean_x |X(x) − c(T x)|² + mean_y |Y(y) − c(S y)|²              maps agree with images
    #     + mean_y |X(S y) − c(y)|² + mean_x |Y(T x) − c(x)|²              maps are inverse
    # Here ∫ |∇X|² = tr Aᵀ Λ A, because ∫ ∇φ_i · ∇φ_j = λ_i δ_ij. Given the images, A and B are two
    # linear fits (`_fit_smooth`). Given A and B, the image of x is the y with the least
    #     |X(x) − c(y)|² + |c(x) − Y(y)|²,
    # which is the nearest point in the coordinates (X, c) of the source and (c, Y) of the target. These are
    # the two terms of x in the sum, so each half of an iteration decreases the sum. Normals, signatures and
    # landmarks are added with their own weights; normals separate sheets that are close. Positions are fitted
    # only to compute normals.
    source: Samples
    target: Samples
    signatures: Embedding  # signatures of all vertices of both shapes
    landmarks: Int[BodyVertices, "l 2"]  # vertices of source and target that correspond
    side: float = 1.0  # 1 for maps that preserve the orientation of the faces, −1 for those that reverse it
    normal_weight: float = ELASTIC_SEARCH.normal_weight  # weight of normals besides canonical coordinates

    def from_pairs(self, pairs: Int[BodyVertices, "q 2"], step: Step) -> Coefficients:
        """Fit smooth maps to pairs of vertices."""
        source, target, ones = self.source.shape, self.target.shape, np.ones(len(pairs))
        return Coefficients(
            _fit_smooth(source, pairs[:, 0], target.values[pairs[:, 1]], ones, step),
            _fit_smooth(target, pairs[:, 1], source.values[pairs[:, 0]], ones, step),
        )

    def run(
        self, start: Coefficients, steps: tuple[Step, ...], images: Images | None = None
    ) -> tuple[Coefficients, Images]:
        """Take steps from a start; its images are computed unless they are given."""
        coefficients, images = start, images or self.images(start)
        for step in steps:
            for _ in range(step.iterations):
                coefficients = self._fit(images, step)
                images = self.images(coefficients)
        return coefficients, images

    def _fit(self, images: Images, step: Step) -> Coefficients:
        source, target = self.source, self.target
        symmetric = step.symmetric and source.mirror_row is not None and target.mirror_row is not None

        def fit_one(
            onto: Samples, other: Samples, forth: SoughtRows, back: SoughtRows, held: IntArray
        ) -> FloatArray:
            # The map of ``onto`` should have, at each sample of ``onto``, the values of its image (``forth``);
            # at the image (``back``) of each sample of ``other``, the values of that sample; and at each
            # landmark, the values of the corresponding landmark of ``other``.
            vertices = [onto.vertices, onto.targets[back], held[:, 0]]
            images = [other.targets[forth], other.vertices, held[:, 1]]
            values = [other.shape.values[image] for image in images]
            if symmetric:
                # A map that respects mirror images sends the mirror image of a sample to the mirror image of
                # the sample's image. So at each sample, the map should also have the values of the mirror
                # image of the image of the sample's mirror image.
                mirrored = other.shape.mirrored
                assert mirrored is not None
                vertices += [onto.vertices]
                values += [mirrored[other.targets[forth[onto.mirror_row]]]]
            weights = np.concatenate([np.ones(len(v)) for v in vertices])
            first = len(vertices[0]) + len(vertices[1])
            weights[first : first + len(held)] = ELASTIC_SEARCH.landmark_weight
            return _fit_smooth(onto.shape, np.concatenate(vertices), np.vstack(values), weights, step)

        return Coefficients(
            fit_one(source, target, images.forth, images.back, self.landmarks),
            fit_one(target, source, images.back, images.forth, self.landmarks[:, ::-1]),
        )

    def images(self, coefficients: Coefficients) -> Images:
        """Images in both directions: nearest points in the coordinates of `embedding`."""
        source, target, copies = self.source, self.target, self._copies(coefficients)
        nearest = self._nearest_anywhere if source.everywhere else self._nearest_samples
        forth, back, spectral_residual = nearest(copies)
        cosines = [
            np.einsum("ij,ij->i", normals[onto.row], other.normals[image]).mean()
            for (_, normals), onto, other, image in zip(
                copies, (source, target), (target, source), (forth, back)
            )
        ]
        return Images(forth, back, spectral_residual, self.side * float(np.mean(cosines)))

    def embedding(self, coefficients: Coefficients) -> Embedding:
        """Coordinates of the candidates of both shapes, in which images are nearest points."""
        return self._embedding(self._copies(coefficients))

    def _embedding(self, copies: tuple[_Copy, _Copy]) -> Embedding:
        both = zip(self._embedding_by_maps(copies), self.signatures, (self.source, self.target))
        weight = ELASTIC_SEARCH.signature_weight
        return Embedding(*(np.hstack([x, weight * values[onto.targets]]) for x, values, onto in both))

    def _copies(self, coefficients: Coefficients) -> tuple[_Copy, _Copy]:
        """Copy the target to the source, and the source to the target."""
        return _copy_shape(self.source, coefficients.source), _copy_shape(self.target, coefficients.target)

    def _embedding_by_maps(self, copies: tuple[_Copy, _Copy]) -> Embedding:
        """Coordinates that depend on the maps, without signatures."""
        source, target, weight = self.source, self.target, self.normal_weight
        (x_target, n_target), (x_source, n_source) = copies  # canonical coordinates, and normals
        side = self.side * weight
        of_source = x_target, source.canonical, side * n_target, weight * source.normals
        of_target = target.canonical, x_source, weight * target.normals, side * n_source
        return Embedding(np.hstack(of_source), np.hstack(of_target))

    @cached_property
    def _squared_signature_distances(self) -> Float[Float32Array, "samples_s samples_t"]:
        """Squared distances between the weighted signatures of the samples of both shapes."""
        both = zip(self.signatures, (self.source, self.target))
        a, b = (ELASTIC_SEARCH.signature_weight * values[samples.vertices] for values, samples in both)
        return single(np.stack([((row - b) ** 2).sum(axis=1) for row in a]))

    def _nearest_anywhere(self, copies: tuple[_Copy, _Copy]) -> tuple[SoughtRows, SoughtRows, float]:
        """Find images both ways among all vertices, and the sum of their mean distances."""
        source, target, (a, b) = self.source, self.target, self._embedding(copies)
        from_source, from_target = a[source.row], b[target.row]
        forth = SoughtRows(target.shape.prepared.index.vertices(b, from_source))
        back = SoughtRows(source.shape.prepared.index.vertices(a, from_target))
        spectral_residual = np.linalg.norm(from_source - b[forth], axis=1).mean()
        return forth, back, float(spectral_residual + np.linalg.norm(from_target - a[back], axis=1).mean())

    def _nearest_samples(self, copies: tuple[_Copy, _Copy]) -> tuple[SoughtRows, SoughtRows, float]:
        """Find images in both directions among the samples, by one matrix product."""
        # |a − b|² = |a|² − 2 a·b + |b|², plus squared distances of signatures, which do not depend on the map
        a, b = self._embedding_by_maps(copies)
        squared = single(a) @ single(-2 * b).T
        squared += self._squared_signature_distances
        squared += single(np.einsum("ij,ij->i", b, b))
        squared += single(np.einsum("ij,ij->i", a, a))[:, None]
        forth, back = SoughtRows(squared.argmin(axis=1)), SoughtRows(squared.argmin(axis=0))
        nearest = squared[np.arange(len(a)), forth], squared[back, np.arange(len(b))]
        spectral_residual = sum(np.sqrt(np.maximum(x, 0.0)).mean(dtype=np.float64) for x in nearest)
        return forth, back, float(spectral_residual)

    def asymmetry(self, images: Images) -> float:
        """Mean distance between the image of a mirror image and the mirror image of the image; 0 without these."""
        distances = []
        both = (self.source, self.target, images.forth), (self.target, self.source, images.back)
        for onto, other, image in both:
            if onto.mirror_row is None or other.shape.mirrored is None:
                return 0.0
            d = other.shape.canonical.shape[1]
            mirror_of_image = other.shape.mirrored[other.targets[image], :d]
            image_of_mirror = other.shape.canonical[other.targets[image[onto.mirror_row]]]
            distances.append(np.linalg.norm(mirror_of_image - image_of_mirror, axis=1).mean())
        return float(np.mean(distances))


def _copy_shape(onto: Samples, coefficients: FloatArray) -> _Copy:
    """Copy the other shape to the candidates: canonical coordinates and normals."""
    k = len(coefficients)
    canonical = onto.functions_sought[:, :k] @ coefficients[:, :-3]
    normals = vertex_normals(onto.functions[:, :k] @ coefficients[:, -3:], onto.faces)
    return canonical, normals[onto.sought]


def _fit_smooth(
    shape: ElasticShape,
    vertices: Int[IntArray, "q"],
    values: Float[FloatArray, "q v"],
    weights: Float[FloatArray, "q"],
    step: Step,
) -> Float[FloatArray, "k v"]:
    """Minimise mean weighted squared error from values + μ × Dirichlet energy."""
    # The gradient of Σ_i w_i |Φ_i A − v_i|² / Σ_i w_i + μ tr Aᵀ Λ A, where V has the rows v_i, vanishes where
    #     (Φᵀ W Φ + μ Λ) A = Φᵀ W V,   W = diag(w / Σ_i w_i).
    laplace, k = shape.prepared.laplace, step.n_functions
    functions = laplace.vectors[vertices, :k]
    weighted = functions * (weights / weights.sum())[:, None]
    gram = weighted.T @ functions
    gram[np.diag_indices_from(gram)] += step.smoothness * laplace.values[:k] + RIDGE
    _, coefficients, failed = dposv(gram, weighted.T @ values)
    if failed or not np.isfinite(coefficients).all():
        raise LinAlgError(f"{k} functions of a shape cannot be fitted to {len(vertices)} vertices")
    return np.asarray(coefficients)


def anchor_starts(
    pair: Problem,
    landmarks: Int[BodyVertices, "l 2"],
    shapes: tuple[ElasticShape, ElasticShape] | None = None,
) -> list[Int[BodyVertices, "_ 2"]]:
    """Assign anchors of the source to points of the target."""
    # A distance d that should be u costs (`IntervalCost` with lower = upper = u, in average distances)
    #     min(max(|d − u| − tolerance u, 0) + weight |d − u|, most) / (soft + u).
    # The cost is small while d agrees with u up to a factor, because limbs stretch. It is bounded, so that a
    # tail of twice the length does not outweigh everything else. The tips of limbs of any length agree in
    # their remoteness, a share of the area. If both shapes are symmetric, an anchor and its image also agree
    # in the distance from their mirror images: heads and tails lie in the plane of symmetry, legs do not.
    # Some first maps are assigned without this distance, because mirror images might be wrong in places.
    source, target, settings = pair.source, pair.target, pair.config.elastic
    anchors, between = _anchors(source, BodyVertices(landmarks[:, 0]), ELASTIC_SEARCH.n_anchors)
    samples = target.sample_vertices[: ELASTIC_SEARCH.n_candidates]
    candidates = np.unique(np.concatenate([landmarks[:, 1], target.extremities, samples]))
    of_source, of_target = pair.signatures
    unlike = np.abs(of_source[anchors, None] - of_target[candidates]).mean(axis=2)
    unary = ELASTIC_SEARCH.anchor_signature_weight * np.minimum(unlike / max(unlike.mean(), 1e-12), 2.0)
    remote = _remoteness(source)[anchors, None], _remoteness(target)[candidates]
    unary += ELASTIC_SEARCH.remoteness_weight * np.abs(remote[0] - remote[1])
    kinds = [(unary, settings.n_starts)]
    if shapes and all(shape.mirrored is not None for shape in shapes):
        most = ELASTIC_SEARCH.max_mirror_distance
        of_source, of_target = (
            np.minimum(shape.mirror_distance / shape.prepared.intrinsic_scale, most) for shape in shapes
        )
        unlike = np.abs(of_source[anchors, None] - of_target[candidates])
        with_distance = unary + ELASTIC_SEARCH.mirror_distance_weight * unlike
        kinds = [(with_distance, settings.n_starts), (unary, ELASTIC_SEARCH.n_plain_starts)]

    of_candidates = target.distances_between(candidates) / target.intrinsic_scale
    sides = Intervals(between, between), Intervals(of_candidates, of_candidates)
    bounds = ELASTIC_SEARCH.max_distance_cost, ELASTIC_SEARCH.short_distance
    cost = IntervalCost(settings.distance_tolerance, settings.deviation_weight, *bounds)
    beam = ELASTIC_SEARCH.beam_width, ELASTIC_SEARCH.same_assignment_distance
    starts: list[BodyVertices] = []
    for unary, count in kinds:
        pin_first(unary, np.searchsorted(candidates, landmarks[:, 1]))
        rows, _ = assign_points(*sides, unary, cost, *beam)
        starts += [BodyVertices(np.column_stack([anchors, candidates[row]])) for row in rows[:count]]
    return starts


def _anchors(
    shape: PreparedShape, first: Int[BodyVertices, "l"], count: int
) -> tuple[Int[BodyVertices, "m"], Float[FloatArray, "m m"]]:
    """Select vertices far from each other; also the distances between them, over the average one."""
    vertices = np.concatenate([first, shape.extremities, shape.column_vertices])
    vertices = vertices[np.sort(np.unique(vertices, return_index=True)[1])]
    distances = shape.distances_between(vertices)
    n_first = min(len(np.union1d(first, shape.extremities)), max(count, len(first)))
    kept = farthest_rows(distances, count, range(n_first))
    return BodyVertices(vertices[kept]), distances[np.ix_(kept, kept)] / shape.intrinsic_scale


def _remoteness(shape: PreparedShape) -> Float[FloatArray, "n"]:
    """Share of the area that is less remote than each vertex; it does not depend on the length of limbs."""
    order = np.argsort(shape.average_distance, kind="stable")
    share = np.zeros(len(order))
    share[order] = np.cumsum(shape.body.vertex_areas[order]) / shape.body.area
    return share


def find_mirror_images(prepared: PreparedShape, config: Config) -> ElasticShape:
    """Find the mirror images of a shape by its best orientation-reversing self-map."""
    # The identity preserves the orientation, so side = −1 excludes it.
    settings = config.elastic
    shape = ElasticShape(prepared, settings)
    samples = shape.sample(ELASTIC_SEARCH.n_coarse_samples, False)
    signatures = Embedding(prepared.signatures, prepared.signatures)
    fit = ElasticFit(samples, samples, signatures, NO_LANDMARKS, side=-1.0)

    def first(start: BodyVertices) -> tuple[Coefficients, Images] | None:
        coefficients = fit.from_pairs(start, COARSE_STEPS[0])
        images = fit.images(coefficients)
        return None if images.orientation < 0 else (coefficients, images)

    forgiven, n_starts = ELASTIC_SEARCH.forgiven_of_mirror, ELASTIC_SEARCH.n_mirror_starts
    few_starts = replace(config, elastic=replace(settings, distance_tolerance=forgiven, n_starts=n_starts))
    vertices = prepared.sample_vertices[: prepared.config.n_search]
    rows = [symmetry.image_row for symmetry in prepared.symmetries]
    symmetries = [BodyVertices(np.column_stack([vertices, vertices[row]])) for row in rows]
    starts = [*anchor_starts(Problem(prepared, prepared, few_starts), NO_LANDMARKS), *symmetries]
    maps = [map_ for map_ in parallel_map(first, starts) if map_]
    for step, most in zip(COARSE_STEPS, ELASTIC_SEARCH.n_mirror_maps_kept):
        maps = parallel_map(lambda map_: fit.run(map_[0], (step,), map_[1]), maps)  # noqa: B023
        maps = sorted(maps, key=lambda map_: map_[1].spectral_residual)[:most]
    clear = [map_ for map_ in maps if map_[1].orientation >= ELASTIC_SEARCH.min_mirror_orientation]
    if not clear or clear[0][1].spectral_residual > ELASTIC_SEARCH.max_mirror_spectral_residual:
        return shape
    coefficients = clear[0][0].source
    return replace(shape, mirrored=prepared.laplace.vectors[:, : len(coefficients)] @ coefficients)
