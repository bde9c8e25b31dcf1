"""Smooth maps of two shapes that stretch: first maps, the fit of maps both ways, and mirror images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

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
from isomatch.surfaces import Mesh, vertex_normals

RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class ElasticShape:
    """A prepared mesh in coordinates that other shapes can be mapped to smoothly."""

    prepared: PreparedShape  # its body is a mesh of n vertices
    settings: ElasticSettings
    # ``values`` at the mirror image of each vertex, smoothed, if there is one
    mirrored: Float[FloatArray, "n values"] | None = None

    @property
    def mesh(self) -> Mesh:
        """The body."""
        return self.prepared.mesh_body

    @cached_property
    def canonical(self) -> Float[FloatArray, "n d"]:
        """Canonical coordinates: classical scaling of the farthest points, extended to all vertices."""
        # De Silva & Tenenbaum, Sparse multidimensional scaling using landmark points, 2004. Of the squared distances D²
        # among p points let −½ J D² J = V Λ Vᵀ, J = 1 − 1/p. The points have coordinates V Λ^½, and a vertex of squared
        # distances δ to them, whose mean over the points is δ̄,
        #     −½ Λ^−½ Vᵀ (δ − δ̄),
        # which is the same at the points themselves. Only axes of the largest positive eigenvalues are kept.
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
        """What a map to this shape pulls back: canonical coordinates, and positions in space."""
        return np.hstack([self.canonical, self.mesh.vertices])

    @cached_property
    def mirror_distance(self) -> Float[FloatArray, "n"]:
        """Distance of each vertex from its mirror image, in canonical coordinates; 0 without mirror images."""
        if self.mirrored is None:
            return np.zeros(self.mesh.n_vertices)
        d = self.canonical.shape[1]
        return np.asarray(np.linalg.norm(self.canonical - self.mirrored[:, :d], axis=1))

    def sample(self, count: int, everywhere: bool) -> Samples:
        """Take ``count`` samples; their images are sought among samples, or everywhere."""
        vertices, mesh = BodyVertices(self.prepared.sample_vertices[:count]), self.mesh
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
    """Samples of a shape, and the vertices among which images are sought."""

    shape: ElasticShape
    everywhere: bool  # whether images are sought among all vertices, and not among the samples
    vertices: Int[BodyVertices, "m"]  # the samples
    row: Int[SoughtRows, "m"]  # their rows among the vertices sought
    sought: Int[
        IntArray, "c"
    ]  # rows of the vertices sought in the ring, the vertices of all faces around them
    faces: Int[IntArray, "f 3"]  # those faces, by rows of the ring
    mirror_row: Int[SampleRows, "m"] | None  # sample nearest to the mirror image of each sample
    targets: Int[BodyVertices, "c"]  # vertices sought
    functions: Float[FloatArray, "ring k"]  # Laplace–Beltrami functions on the ring
    functions_sought: Float[FloatArray, "c k"]  # the same on the vertices sought
    canonical: Float[FloatArray, "c d"]  # canonical coordinates of the vertices sought
    normals: Float[FloatArray, "c 3"]  # their normals


class Coefficients(NamedTuple):
    """Smooth maps both ways, by the first functions of either shape."""

    source: Float[FloatArray, "k_s values_t"]  # A
    target: Float[FloatArray, "k_t values_s"]  # B


class Step(NamedTuple):
    """A step of the fit: functions, smoothness, iterations, and whether maps are made to respect the symmetries."""

    n_functions: int
    smoothness: float  # μ below; its root is a length in √area
    iterations: int
    symmetric: bool


# of the coarse fit, after each of which only the best go on: its functions show limbs, but no details, and smoothness was
# chosen with them; decisions.md, elastic choice
COARSE_STEPS = Step(20, 0.01, 2, True), Step(20, 0.01, 2, True), Step(30, 0.007, 4, True)


class Images(NamedTuple):
    """Images of the samples both ways, as rows of the vertices sought."""

    forth: Int[SoughtRows, "samples_s"]
    back: Int[SoughtRows, "samples_t"]
    spectral_residual: float  # their mean distance
    # mean cosine between normals of either shape and of its copy on the other, of the wanted side
    orientation: float


class _Copy(NamedTuple):
    """A shape copied to the vertices sought of another by a smooth map."""

    canonical: Float[FloatArray, "c d"]
    normals: Float[FloatArray, "c 3"]


@dataclass(frozen=True, eq=False)
class ElasticFit:
    """Alternates images both ways and the smooth functions that fit them."""

    # After Ezuz, Solomon & Ben-Chen, Reversible harmonic maps between discrete surfaces, 2019. Let c be canonical
    # coordinates beside positions (`values`), Φ and Ψ the first Laplace–Beltrami functions of source and target. Smooth
    # maps X = Φ A into the values of the target, and Y = Ψ B into those of the source, and images T of the source's
    # samples and S of the target's, are sought with least
    #     μ (tr Aᵀ Λ_s A + tr Bᵀ Λ_t B)                                     Dirichlet energy of both
    #     + mean_x |X(x) − c(T x)|² + mean_y |Y(y) − c(S y)|²              each is what its images say,
    #     + mean_y |X(S y) − c(y)|² + mean_x |Y(T x) − c(x)|²              and they undo each other
    # ∫ |∇X|² = tr Aᵀ Λ A, as ∫ ∇φ_i · ∇φ_j = λ_i δ_ij, so that few functions need no matrix of the mesh. Given the
    # images, the best A and B are two linear fits (`_fit_smooth`). Given A and B, the image of x is the y of least
    #     |X(x) − c(y)|² + |c(x) − Y(y)|²,
    # its nearest point in the coordinates (X, c) of the source and (c, Y) of the target: both terms of x are in it, and
    # one search finds T, another S. So within a step both halves of an iteration decrease the sum. Normals, signatures
    # and landmarks are beside it, with weights of their own: they tell sheets apart that lie near each other. Positions
    # in space are fitted for the normals alone, and not searched.
    source: Samples
    target: Samples
    signatures: Embedding  # of all vertices of both
    landmarks: Int[BodyVertices, "l 2"]  # vertices of source and target that correspond
    side: float = 1.0  # 1 for maps that preserve the orientation of the faces, −1 for those that reverse it
    normal_weight: float = ELASTIC_SEARCH.normal_weight  # beside canonical coordinates

    def from_pairs(self, pairs: Int[BodyVertices, "q 2"], step: Step) -> Coefficients:
        """Fit smooth maps to pairs of vertices alone."""
        source, target, ones = self.source.shape, self.target.shape, np.ones(len(pairs))
        return Coefficients(
            _fit_smooth(source, pairs[:, 0], target.values[pairs[:, 1]], ones, step),
            _fit_smooth(target, pairs[:, 1], source.values[pairs[:, 0]], ones, step),
        )

    def run(
        self, start: Coefficients, steps: tuple[Step, ...], images: Images | None = None
    ) -> tuple[Coefficients, Images]:
        """Take some steps from a start, whose images may be known."""
        coefficients, images = start, images or self.images(start)
        for step in steps:
            for _ in range(step.iterations):
                coefficients = self._fit(images, step)
                images = self.images(coefficients)
        return coefficients, images

    def _fit(self, images: Images, step: Step) -> Coefficients:
        source, target = self.source, self.target
        symmetric = step.symmetric and source.mirror_row is not None and target.mirror_row is not None

        def one(
            onto: Samples, other: Samples, forth: SoughtRows, back: SoughtRows, held: IntArray
        ) -> FloatArray:
            # X at x should be c(T x); at S y, c(y); at landmarks, what is known
            here = [onto.vertices, onto.targets[back], held[:, 0]]
            there = [other.targets[forth], other.vertices, held[:, 1]]
            values = [other.shape.values[v] for v in there]
            if symmetric:
                # With σ the mirror images of either shape, a map that respects them has T = σ T σ: at x, X should also be
                # the value at the mirror image of where the mirror image of x goes.
                mirrored = other.shape.mirrored
                assert mirrored is not None
                here += [onto.vertices]
                values += [mirrored[other.targets[forth[onto.mirror_row]]]]
            weights = np.concatenate([np.ones(len(v)) for v in here])
            first = len(here[0]) + len(here[1])
            weights[first : first + len(held)] = ELASTIC_SEARCH.landmark_weight
            return _fit_smooth(onto.shape, np.concatenate(here), np.vstack(values), weights, step)

        return Coefficients(
            one(source, target, images.forth, images.back, self.landmarks),
            one(target, source, images.back, images.forth, self.landmarks[:, ::-1]),
        )

    def images(self, coefficients: Coefficients) -> Images:
        """Nearest images both ways, in the coordinates of `embedding`."""
        source, target, copies = self.source, self.target, self._copies(coefficients)
        nearest = self._nearest_anywhere if source.everywhere else self._nearest_samples
        forth, back, spectral_residual = nearest(copies)
        cosines = [
            np.einsum("ij,ij->i", copy.normals[onto.row], other.normals[image]).mean()
            for copy, onto, other, image in zip(copies, (source, target), (target, source), (forth, back))
        ]
        return Images(forth, back, spectral_residual, self.side * float(np.mean(cosines)))

    def embedding(self, coefficients: Coefficients) -> Embedding:
        """Coordinates of the vertices sought of both shapes, in which images are nearest."""
        return self._embedding(self._copies(coefficients))

    def _embedding(self, copies: tuple[_Copy, _Copy]) -> Embedding:
        both = zip(self._moving(copies), self.signatures, (self.source, self.target))
        return Embedding(
            *(np.hstack([x, ELASTIC_SEARCH.signature_weight * own[onto.targets]]) for x, own, onto in both)
        )

    def _copies(self, coefficients: Coefficients) -> tuple[_Copy, _Copy]:
        """Copy the target to the source, and the source to the target."""
        return _copy_shape(self.source, coefficients.source), _copy_shape(self.target, coefficients.target)

    def _moving(self, copies: tuple[_Copy, _Copy]) -> Embedding:
        """Leave the signatures out, which are the same under all maps."""
        source, target, (target_here, source_there) = self.source, self.target, copies
        side, weight = self.side * self.normal_weight, self.normal_weight
        canonical = [target_here.canonical, source.canonical], [target.canonical, source_there.canonical]
        here = side * target_here.normals, weight * source.normals
        there = weight * target.normals, side * source_there.normals
        return Embedding(np.hstack([*canonical[0], *here]), np.hstack([*canonical[1], *there]))

    @cached_property
    def _unlike(self) -> Float[Float32Array, "samples_s samples_t"]:
        """Squared distances of the weighted signatures of the samples of both."""
        both = zip(self.signatures, (self.source, self.target))
        a, b = (ELASTIC_SEARCH.signature_weight * values[samples.vertices] for values, samples in both)
        return single(np.stack([((row - b) ** 2).sum(axis=1) for row in a]))

    def _nearest_anywhere(self, copies: tuple[_Copy, _Copy]) -> tuple[SoughtRows, SoughtRows, float]:
        """Find the images of the samples both ways, and the sum of both mean distances."""
        source, target, (a, b) = self.source, self.target, self._embedding(copies)
        from_source, from_target = a[source.row], b[target.row]
        forth = SoughtRows(target.shape.prepared.index.vertices(b, from_source))
        back = SoughtRows(source.shape.prepared.index.vertices(a, from_target))
        spectral_residual = np.linalg.norm(from_source - b[forth], axis=1).mean()
        return forth, back, float(spectral_residual + np.linalg.norm(from_target - a[back], axis=1).mean())

    def _nearest_samples(self, copies: tuple[_Copy, _Copy]) -> tuple[SoughtRows, SoughtRows, float]:
        """Do the same among the samples, by one product for both ways."""
        # |a − b|² = |a|² − 2 a·b + |b|², and the part of the signatures, which is the same for all maps
        a, b = self._moving(copies)
        squared = single(a) @ single(-2 * b).T
        squared += self._unlike
        squared += single(np.einsum("ij,ij->i", b, b))
        squared += single(np.einsum("ij,ij->i", a, a))[:, None]
        forth, back = SoughtRows(squared.argmin(axis=1)), SoughtRows(squared.argmin(axis=0))
        nearest = squared[np.arange(len(a)), forth], squared[back, np.arange(len(b))]
        spectral_residual = sum(np.sqrt(np.maximum(each, 0.0)).mean(dtype=np.float64) for each in nearest)
        return forth, back, float(spectral_residual)

    def asymmetry(self, images: Images) -> float:
        """How far the maps are from exchanging mirror images: a mean distance; 0 unless both are nearly symmetric."""
        apart, ways = [], ((self.source, self.target, images.forth), (self.target, self.source, images.back))
        for onto, other, image in ways:
            if onto.mirror_row is None or other.shape.mirrored is None:
                return 0.0
            d = other.shape.canonical.shape[1]
            mirrored = other.shape.mirrored[other.targets[image], :d]
            there = other.shape.canonical[other.targets[image[onto.mirror_row]]]
            apart.append(np.linalg.norm(mirrored - there, axis=1).mean())
        return float(np.mean(apart))


def _copy_shape(onto: Samples, coefficients: FloatArray) -> _Copy:
    """Copy the other shape to the vertices sought: canonical coordinates, and the normals of the faces laid in space."""
    k = len(coefficients)
    canonical = onto.functions_sought[:, :k] @ coefficients[:, :-3]
    normals = vertex_normals(onto.functions[:, :k] @ coefficients[:, -3:], onto.faces)
    return _Copy(canonical, normals[onto.sought])


def _fit_smooth(
    shape: ElasticShape,
    vertices: Int[IntArray, "q"],
    values: Float[FloatArray, "q v"],
    weights: Float[FloatArray, "q"],
    step: Step,
) -> Float[FloatArray, "k v"]:
    """Coefficients that minimise the mean weighted squared error from values + μ × Dirichlet energy."""
    # ∇ of Σ_i w_i |Φ_i A − v_i|² / Σ w + μ tr Aᵀ Λ A is 0 where (Φᵀ W Φ + μ Λ) A = Φᵀ W V, W = diag(w / Σ w)
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
    # A distance d that should be u costs (`IntervalCost`, lower = upper = u, in units of the average distance)
    #     min(max(|d − u| − forgiven u, 0) + inside |d − u|, most) / (soft + u):
    # nothing much up to a factor, as limbs stretch, and never more than a bound, for a tail that is twice as long must
    # not outweigh everything else. What limbs of any length have in common is how remote they are, as a share of the
    # area, and, where both shapes are symmetric, how far aside: heads and tails lie in the plane of symmetry, legs do
    # not. Some starts do without, as mirror images may be wrong in places.
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
        aside = [
            np.minimum(
                shape.mirror_distance / shape.prepared.intrinsic_scale, ELASTIC_SEARCH.max_mirror_distance
            )
            for shape in shapes
        ]
        unlike = np.abs(aside[0][anchors, None] - aside[1][candidates])
        kinds = [
            (unary + ELASTIC_SEARCH.mirror_distance_weight * unlike, settings.n_starts),
            (unary, ELASTIC_SEARCH.n_plain_starts),
        ]

    among = target.distances_between(candidates) / target.intrinsic_scale
    sides = Intervals(between, between), Intervals(among, among)
    cost = IntervalCost(
        settings.forgiven, settings.inside, ELASTIC_SEARCH.max_distance_cost, ELASTIC_SEARCH.short_distance
    )
    starts: list[BodyVertices] = []
    for unary, count in kinds:
        pin_first(unary, np.searchsorted(candidates, landmarks[:, 1]))
        rows, _ = assign_points(
            *sides, unary, cost, ELASTIC_SEARCH.beam_width, ELASTIC_SEARCH.same_assignment_distance
        )
        starts += [BodyVertices(np.column_stack([anchors, candidates[row]])) for row in rows[:count]]
    return starts


def _anchors(
    shape: PreparedShape, first: Int[BodyVertices, "l"], count: int
) -> tuple[Int[BodyVertices, "m"], Float[FloatArray, "m m"]]:
    """Vertices far from each other, and their distances in units of the average."""
    wanted = np.concatenate([first, shape.extremities, shape.column_vertices])
    wanted = wanted[np.sort(np.unique(wanted, return_index=True)[1])]
    distances = shape.distances_between(wanted)
    n_first = min(len(np.union1d(first, shape.extremities)), max(count, len(first)))
    kept = farthest_rows(distances, count, range(n_first))
    return BodyVertices(wanted[kept]), distances[np.ix_(kept, kept)] / shape.intrinsic_scale


def _remoteness(shape: PreparedShape) -> Float[FloatArray, "n"]:
    """Share of the area that is less remote than each vertex: it does not depend on how long limbs are."""
    order = np.argsort(shape.average_distance, kind="stable")
    share = np.zeros(len(order))
    share[order] = np.cumsum(shape.body.vertex_areas[order]) / shape.body.area
    return share


def find_mirror_images(prepared: PreparedShape, config: Config) -> ElasticShape:
    """Find the map of a shape to itself that reverses its orientation and fits best, if any fits well."""
    # An elastic match of the shape to itself, of side −1, so that the identity does not take part.
    settings = config.elastic
    shape = ElasticShape(prepared, settings)
    samples = shape.sample(ELASTIC_SEARCH.n_coarse_samples, False)
    signatures = Embedding(prepared.signatures, prepared.signatures)
    fit = ElasticFit(samples, samples, signatures, NO_LANDMARKS, side=-1.0)

    def first(start: BodyVertices) -> tuple[Coefficients, Images] | None:
        coefficients = fit.from_pairs(start, COARSE_STEPS[0])
        images = fit.images(coefficients)
        return None if images.orientation < 0 else (coefficients, images)

    few = replace(
        config,
        elastic=replace(
            settings, forgiven=ELASTIC_SEARCH.forgiven_of_mirror, n_starts=ELASTIC_SEARCH.n_mirror_starts
        ),
    )
    rows = prepared.sample_vertices[: prepared.config.n_search]
    symmetries = [BodyVertices(np.column_stack([rows, rows[each.image_row]])) for each in prepared.symmetries]
    starts = [*anchor_starts(Problem(prepared, prepared, few), NO_LANDMARKS), *symmetries]
    maps = [each for each in parallel_map(first, starts) if each]
    for step, most in zip(COARSE_STEPS, ELASTIC_SEARCH.n_mirror_maps_kept):
        maps = parallel_map(lambda each: fit.run(each[0], (step,), each[1]), maps)  # noqa: B023
        maps = sorted(maps, key=lambda each: each[1].spectral_residual)[:most]
    clear = [each for each in maps if each[1].orientation >= ELASTIC_SEARCH.min_mirror_orientation]
    if not clear or clear[0][1].spectral_residual > ELASTIC_SEARCH.max_mirror_spectral_residual:
        return shape
    coefficients = clear[0][0].source
    return replace(shape, mirrored=prepared.laplace.vectors[:, : len(coefficients)] @ coefficients)
