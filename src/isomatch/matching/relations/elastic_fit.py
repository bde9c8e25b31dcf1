"""Smooth maps of two shapes that stretch: first maps, the fit of maps both ways, and mirror images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dposv

from isomatch.correspondence import Embedding, IntervalCost, assign_points, nearest_rows, pin_first
from isomatch.matching.pair import ShapePair
from isomatch.runtime.threads import parallel_map
from isomatch.settings import Config, ElasticSettings
from isomatch.shapes import PreparedShape, farthest_rows
from isomatch.surfaces import Mesh, vertex_normals
from isomatch.values.arrays import Float32Array, FloatArray, IntArray, single
from isomatch.values.cached import cached_property

N_COARSE = 300  # samples of each shape in the coarse fit; chosen: enough for 30 functions


@dataclass(frozen=True, eq=False)
class ElasticShape:
    """A prepared mesh in coordinates that other shapes can be mapped to smoothly."""

    prepared: PreparedShape  # the shape; its body is a mesh of n vertices
    settings: ElasticSettings
    # (n, d + 3): ``drawn`` of the mirror image of each vertex, smoothed; none if the shape is not nearly symmetric
    mirrored: FloatArray | None = None

    @property
    def mesh(self) -> Mesh:
        """The body."""
        return self.prepared.mesh_body

    @cached_property
    def canonical(self) -> FloatArray:
        """(n, d) canonical coordinates: classical scaling of the farthest points, extended to all vertices."""
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
    def drawn(self) -> FloatArray:
        """(n, d + 3) what a map to this shape pulls back: canonical coordinates, and positions in space."""
        return np.hstack([self.canonical, self.mesh.vertices])

    @cached_property
    def aside(self) -> FloatArray:
        """(n,) distance of each vertex from its mirror image, in canonical coordinates; 0 without mirror images."""
        if self.mirrored is None:
            return np.zeros(self.mesh.n_vertices)
        d = self.canonical.shape[1]
        return np.asarray(np.linalg.norm(self.canonical - self.mirrored[:, :d], axis=1))

    def sampled(self, count: int, everywhere: bool) -> Samples:
        """Take ``count`` samples; their images are sought among samples, or everywhere."""
        vertices = self.prepared.sample_vertices[:count]
        mesh = self.mesh
        if everywhere:
            ring, sought, faces = np.arange(mesh.n_vertices), np.arange(mesh.n_vertices), mesh.faces
        else:
            chosen = np.zeros(mesh.n_vertices, dtype=bool)
            chosen[vertices] = True
            faces = mesh.faces[chosen[mesh.faces].any(axis=1)]
            ring, faces = np.unique(faces, return_inverse=True)
            faces, sought = faces.reshape(-1, 3), np.searchsorted(ring, vertices)
        row = vertices if everywhere else np.arange(len(vertices))
        mirror_row = None
        if self.mirrored is not None:
            d = self.canonical.shape[1]
            mirror_row = nearest_rows(self.canonical[vertices], self.mirrored[vertices, :d])
        return Samples(self, everywhere, vertices, row, ring, sought, faces, mirror_row)


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a shape, and the vertices among which images are sought."""

    shape: ElasticShape
    everywhere: bool  # whether images are sought among all vertices, and not among the samples
    vertices: IntArray  # (m,): the samples
    row: IntArray  # (m,): their rows among the c vertices sought
    ring: IntArray  # (r,): vertices of all faces around the vertices sought
    sought: IntArray  # (c,): rows of the vertices sought in the ring
    faces: IntArray  # (f, 3): those faces, by rows of the ring
    mirror_row: IntArray | None  # (m,): sample nearest to the mirror image of each sample

    @cached_property
    def functions(self) -> FloatArray:
        """(r, K) Laplace–Beltrami functions on the ring."""
        functions: FloatArray = self.shape.prepared.laplace.vectors[self.ring]
        return functions

    @cached_property
    def functions_sought(self) -> FloatArray:
        """(c, K) the same on the vertices sought."""
        return self.functions if self.everywhere else self.functions[self.sought]

    @cached_property
    def canonical(self) -> FloatArray:
        """(c, d) canonical coordinates of the vertices sought."""
        return np.asarray(self.shape.canonical[self.targets])

    @cached_property
    def normals(self) -> FloatArray:
        """(c, 3) their normals."""
        return np.asarray(self.shape.mesh.vertex_normals[self.targets])

    @cached_property
    def targets(self) -> IntArray:
        """(c,) vertices sought."""
        return self.ring[self.sought]


# factor of the Dirichlet energy in these steps; its root is a length in √area; chosen with coarse_functions
COARSE_SMOOTHNESS = (0.01, 0.01, 0.007)

COARSE_FUNCTIONS = (20, 20, 30)  # in the steps of the coarse fit; chosen: limbs, but no details

COARSE_ITERATIONS = (2, 2, 4)  # in each step; docs/notes/other_species.md

SIGNATURE_WEIGHT = 0.05  # beside canonical coordinates; chosen on pairs of animals, not one by one

NORMAL_WEIGHT = 0.05  # in the coarse fit; chosen on pairs of animals, not one by one

LANDMARK_WEIGHT = 30.0  # of a landmark, in samples; chosen, not measured

RIDGE = 1e-9


class Coefficients(NamedTuple):
    """Each shape drawn on the other by its first functions: (k_s, d_t + 3) and (k_t, d_s + 3)."""

    source: FloatArray
    target: FloatArray


class Step(NamedTuple):
    """A step of the fit: functions, smoothness, iterations, and whether maps are made to respect the symmetries."""

    n_functions: int
    smoothness: float
    iterations: int
    symmetric: bool


def coarse_steps() -> tuple[Step, ...]:
    """Return the steps with few functions; after each, only the best fits go on."""
    return tuple(
        Step(k, smoothness, iterations, True)
        for k, smoothness, iterations in zip(COARSE_FUNCTIONS, COARSE_SMOOTHNESS, COARSE_ITERATIONS)
    )


class Images(NamedTuple):
    """Images of the samples both ways, as rows of the vertices sought."""

    forth: IntArray  # (m_s,)
    back: IntArray  # (m_s,)
    misfit: float  # their mean distance
    # mean cosine between the normals of either shape and of its copy drawn on the other, of the wanted side
    orientation: float


class _Drawn(NamedTuple):
    """A shape drawn on the vertices sought of another: canonical coordinates (c, d), and normals (c, 3)."""

    canonical: FloatArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class ElasticFit:
    """Alternates images both ways and the smooth functions that fit them."""

    source: Samples
    target: Samples
    signatures: Embedding  # signatures of all vertices of both
    landmarks: IntArray  # (l, 2): vertices of source and target that correspond
    side: float = 1.0  # 1 for maps that preserve the orientation of the faces, −1 for those that reverse it
    normal_weight: float = NORMAL_WEIGHT  # of normals, beside canonical coordinates

    def from_pairs(self, pairs: IntArray, step: Step) -> Coefficients:
        """Fit smooth maps to pairs (q, 2) of vertices alone."""

        def fitted(onto: Samples, other: Samples, here: IntArray, there: IntArray) -> FloatArray:
            return _smooth(
                onto.shape,
                here,
                other.shape.drawn[there],
                np.ones(len(here)),
                step.n_functions,
                step.smoothness,
            )

        return Coefficients(
            fitted(self.source, self.target, pairs[:, 0], pairs[:, 1]),
            fitted(self.target, self.source, pairs[:, 1], pairs[:, 0]),
        )

    def run(
        self, start: Coefficients, steps: tuple[Step, ...], images: Images | None = None
    ) -> tuple[Coefficients, Images]:
        """Take some steps from a start, whose images may be known."""
        found, images = start, images or self.images(start)
        for step in steps:
            for _ in range(step.iterations):
                found = self._fitted(images, step)
                images = self.images(found)
        return found, images

    def _fitted(self, images: Images, step: Step) -> Coefficients:
        source, target = self.source, self.target
        symmetric = step.symmetric and source.mirror_row is not None and target.mirror_row is not None

        def one(
            onto: Samples, other: Samples, forth: IntArray, back: IntArray, sides: IntArray
        ) -> FloatArray:
            here = [onto.vertices, onto.targets[back], sides[:, 0]]
            there = [other.targets[forth], other.vertices, sides[:, 1]]
            drawn = [other.shape.drawn[v] for v in there]
            if symmetric:  # the mirror image of where the mirror image goes
                mirrored = other.shape.mirrored
                assert mirrored is not None
                here += [onto.vertices]
                drawn += [mirrored[other.targets[forth[onto.mirror_row]]]]
            weights = np.concatenate([np.ones(len(v)) for v in here])
            first = len(here[0]) + len(here[1])
            weights[first : first + len(sides)] = LANDMARK_WEIGHT
            return _smooth(
                onto.shape, np.concatenate(here), np.vstack(drawn), weights, step.n_functions, step.smoothness
            )

        return Coefficients(
            one(source, target, images.forth, images.back, self.landmarks),
            one(target, source, images.back, images.forth, self.landmarks[:, ::-1]),
        )

    def images(self, found: Coefficients) -> Images:
        """Nearest images both ways, in the coordinates of `embedding`."""
        source, target, drawn = self.source, self.target, self._drawn(found)
        nearest = self._nearest_anywhere if source.everywhere else self._nearest_samples
        forth, back, misfit = nearest(drawn)
        cosines = [
            np.einsum("ij,ij->i", shape.normals[onto.row], other.normals[image]).mean()
            for shape, onto, other, image in zip(drawn, (source, target), (target, source), (forth, back))
        ]
        return Images(forth, back, misfit, self.side * float(np.mean(cosines)))

    def embedding(self, found: Coefficients) -> Embedding:
        """Coordinates of the vertices sought of both shapes, in which images are nearest."""
        return self._embedding(self._drawn(found))

    def _embedding(self, drawn: tuple[_Drawn, _Drawn]) -> Embedding:
        return Embedding(
            *(
                np.hstack([moving, SIGNATURE_WEIGHT * signatures[onto.targets]])
                for moving, signatures, onto in zip(
                    self._moving(drawn), self.signatures, (self.source, self.target)
                )
            )
        )

    def _drawn(self, found: Coefficients) -> tuple[_Drawn, _Drawn]:
        """Draw the target on the source, and the source on the target."""
        return _drawn(self.source, found.source), _drawn(self.target, found.target)

    def _moving(self, drawn: tuple[_Drawn, _Drawn]) -> Embedding:
        """Leave the signatures out, which are the same under all maps."""
        source, target, (target_here, source_there) = self.source, self.target, drawn
        weight = self.normal_weight
        return Embedding(
            np.hstack(
                [
                    target_here.canonical,
                    source.canonical,
                    self.side * weight * target_here.normals,
                    weight * source.normals,
                ]
            ),
            np.hstack(
                [
                    target.canonical,
                    source_there.canonical,
                    weight * target.normals,
                    self.side * weight * source_there.normals,
                ]
            ),
        )

    @cached_property
    def _unlike(self) -> Float32Array:
        """(m_s, m_t) squared distances of the weighted signatures of the samples of both."""
        a, b = (
            SIGNATURE_WEIGHT * values[samples.vertices]
            for values, samples in zip(self.signatures, (self.source, self.target))
        )
        return single(np.stack([((row - b) ** 2).sum(axis=1) for row in a]))

    def _nearest_anywhere(self, drawn: tuple[_Drawn, _Drawn]) -> tuple[IntArray, IntArray, float]:
        """Find the images (m_s,) and (m_t,) of the samples both ways, and the sum of both mean distances."""
        source, target, (a, b) = self.source, self.target, self._embedding(drawn)
        from_source, from_target = a[source.row], b[target.row]
        forth = target.shape.prepared.index.vertices(b, from_source)
        back = source.shape.prepared.index.vertices(a, from_target)
        misfit = np.linalg.norm(from_source - b[forth], axis=1).mean()
        return forth, back, float(misfit + np.linalg.norm(from_target - a[back], axis=1).mean())

    def _nearest_samples(self, drawn: tuple[_Drawn, _Drawn]) -> tuple[IntArray, IntArray, float]:
        """Do the same among the samples, by one product for both ways."""
        a, b = self._moving(drawn)
        squared = single(a) @ single(-2 * b).T
        squared += self._unlike
        squared += single(np.einsum("ij,ij->i", b, b))
        squared += single(np.einsum("ij,ij->i", a, a))[:, None]
        forth, back = squared.argmin(axis=1), squared.argmin(axis=0)
        nearest = squared[np.arange(len(a)), forth], squared[back, np.arange(len(b))]
        misfit = sum(np.sqrt(np.maximum(each, 0.0)).mean(dtype=np.float64) for each in nearest)
        return forth, back, float(misfit)

    def asymmetry(self, images: Images) -> float:
        """How far the maps are from exchanging mirror images: a mean distance; 0 unless both are nearly symmetric."""
        apart = []
        for onto, other, image in (
            (self.source, self.target, images.forth),
            (self.target, self.source, images.back),
        ):
            if onto.mirror_row is None or other.shape.mirrored is None:
                return 0.0
            d = other.shape.canonical.shape[1]
            mirrored = other.shape.mirrored[other.targets[image], :d]
            there = other.shape.canonical[other.targets[image[onto.mirror_row]]]
            apart.append(np.linalg.norm(mirrored - there, axis=1).mean())
        return float(np.mean(apart))


def _drawn(onto: Samples, coefficients: FloatArray) -> _Drawn:
    """Draw the other shape on the vertices sought."""
    k = len(coefficients)
    canonical = onto.functions_sought[:, :k] @ coefficients[:, :-3]
    normals = vertex_normals(onto.functions[:, :k] @ coefficients[:, -3:], onto.faces)
    return _Drawn(canonical, normals[onto.sought])


def _smooth(
    shape: ElasticShape,
    vertices: IntArray,
    values: FloatArray,
    weights: FloatArray,
    k: int,
    smoothness: float,
) -> FloatArray:
    """Coefficients that minimise the mean weighted squared error + smoothness × Dirichlet energy."""
    laplace = shape.prepared.laplace
    functions = laplace.vectors[vertices, :k]
    weighted = functions * (weights / weights.sum())[:, None]
    gram = weighted.T @ functions
    gram[np.diag_indices_from(gram)] += smoothness * laplace.values[:k] + RIDGE
    _, coefficients, failed = dposv(gram, weighted.T @ values)
    if failed or not np.isfinite(coefficients).all():
        raise LinAlgError(f"{k} functions of a shape cannot be fitted to {len(vertices)} vertices")
    return np.asarray(coefficients)


# bound of the cost of a distance, see `IntervalCost`; chosen on pairs of animals, not one by one
MOST_COST = 0.6

SOFT = 0.2  # of the same cost; chosen, not measured

BEAM = 600  # partial assignments that are kept; chosen on pairs of animals, not one by one

APART = 0.12  # mean distance, in average distances, by which they differ; as in parts

# starts that do not compare distances from the mirror image, where both shapes have one;
# docs/robustness.md, other species
N_PLAIN_STARTS = 30

# weight of differences of the distance from the mirror image; chosen: as much as the average distance; not measured
ASIDE_COST = 1.0

# largest such distance that counts, in average distances; chosen: as much as the average distance; not measured
MOST_ASIDE = 1.0

# weight of the share of the area that is less remote; chosen on pairs of animals, not one by one
REMOTENESS_COST = 0.5

SIGNATURE_COST = 0.1  # weight of the signatures; chosen on pairs of animals, not one by one

# points of the target among which images are sought; chosen: spacing 0.09, less than APART
N_CANDIDATES = 150

N_ANCHORS = 12  # points of the source that are assigned; chosen on pairs of animals, not one by one


def anchor_starts(
    pair: ShapePair, landmarks: IntArray, shapes: tuple[ElasticShape, ElasticShape] | None = None
) -> list[IntArray]:
    """Assign anchors of the source to points of the target: arrays (m, 2) of vertices."""
    source, target, settings = pair.source, pair.target, pair.config.elastic
    anchors, between = _anchors(source, landmarks[:, 0], N_ANCHORS)
    candidates = np.unique(
        np.concatenate([landmarks[:, 1], target.extremities, target.sample_vertices[:N_CANDIDATES]])
    )
    of_source, of_target = pair.signatures
    unlike = np.abs(of_source[anchors, None] - of_target[candidates]).mean(axis=2)
    unary = SIGNATURE_COST * np.minimum(unlike / max(unlike.mean(), 1e-12), 2.0)
    remote = _remoteness(source)[anchors, None], _remoteness(target)[candidates]
    unary += REMOTENESS_COST * np.abs(remote[0] - remote[1])
    kinds = [(unary, settings.n_starts)]
    if shapes and all(shape.mirrored is not None for shape in shapes):
        aside = [np.minimum(shape.aside / shape.prepared.intrinsic_scale, MOST_ASIDE) for shape in shapes]
        unlike = np.abs(aside[0][anchors, None] - aside[1][candidates])
        kinds = [(unary + ASIDE_COST * unlike, settings.n_starts), (unary, N_PLAIN_STARTS)]

    def assigned(cost: FloatArray, count: int) -> IntArray:
        pin_first(cost, np.searchsorted(candidates, landmarks[:, 1]))
        rows, _ = assign_points(
            target.distances_between(candidates) / target.intrinsic_scale,
            between,
            between,
            cost,
            IntervalCost(settings.forgiven, settings.inside, MOST_COST, SOFT),
            BEAM,
            APART,
        )
        return rows[:count]

    return [np.column_stack([anchors, candidates[row]]) for kind in kinds for row in assigned(*kind)]


def _anchors(shape: PreparedShape, first: IntArray, count: int) -> tuple[IntArray, FloatArray]:
    """Vertices far from each other, and their distances in units of the average."""
    wanted = np.concatenate([first, shape.extremities, shape.column_vertices])
    wanted = wanted[np.sort(np.unique(wanted, return_index=True)[1])]
    distances = shape.distances_between(wanted)
    n_first = min(len(np.union1d(first, shape.extremities)), max(count, len(first)))
    kept = farthest_rows(distances, count, range(n_first))
    return wanted[kept], distances[np.ix_(kept, kept)] / shape.intrinsic_scale


def _remoteness(shape: PreparedShape) -> FloatArray:
    """(n,) share of the area that is less remote than each vertex: it does not depend on how long limbs are."""
    order = np.argsort(shape.average_distance, kind="stable")
    share = np.zeros(len(order))
    share[order] = np.cumsum(shape.body.vertex_areas[order]) / shape.body.area
    return share


# up to which a map of a shape to itself is its mirror image; chosen on pairs of animals, not one by one
MIRROR_MISFIT = 0.26

MIRROR_STARTS = 24  # first maps; chosen, not measured

# relative difference of two distances that costs nothing; chosen: a shape is nearly isometric to its mirror image
MIRROR_FORGIVEN = 0.1

# from which a map to itself is a mirror image; chosen on pairs of animals, not one by one
MIRROR_ORIENTATION = 0.5

N_FOLLOWED = (12, 4, 4)  # of these that go on after each step; docs/notes/other_species.md

NONE = np.zeros((0, 2), dtype=np.int64)


class _SelfMap(NamedTuple):
    """A map of a shape to itself."""

    coefficients: Coefficients
    images: Images


def with_mirror(prepared: PreparedShape, config: Config) -> ElasticShape:
    """Find the map of a shape to itself that reverses its orientation and fits best, if any fits well."""
    settings = config.elastic
    shape = ElasticShape(prepared, settings)
    samples = shape.sampled(N_COARSE, False)
    signatures = Embedding(prepared.signatures, prepared.signatures)
    fit = ElasticFit(samples, samples, signatures, NONE, side=-1.0)
    steps = coarse_steps()

    def first(start: IntArray) -> _SelfMap | None:
        found = fit.from_pairs(start, steps[0])
        images = fit.images(found)
        return None if images.orientation < 0 else _SelfMap(found, images)

    def stepped(known: _SelfMap, step: Step) -> _SelfMap:
        return _SelfMap(*fit.run(known.coefficients, (step,), known.images))

    few = replace(config, elastic=replace(settings, forgiven=MIRROR_FORGIVEN, n_starts=MIRROR_STARTS))
    rows = prepared.sample_vertices[: prepared.config.n_search]
    known = [np.column_stack([rows, rows[each.image_row]]) for each in prepared.symmetries]
    starts = [*anchor_starts(ShapePair(prepared, prepared, few), NONE), *known]
    maps = [each for each in parallel_map(first, starts) if each]
    for step, most in zip(steps, N_FOLLOWED):
        maps = parallel_map(partial(stepped, step=step), maps)
        maps = sorted(maps, key=lambda each: each.images.misfit)[:most]
    clear = [each for each in maps if each.images.orientation >= MIRROR_ORIENTATION]
    if not clear or clear[0].images.misfit > MIRROR_MISFIT:
        return shape
    drawn = clear[0].coefficients.source
    return replace(shape, mirrored=prepared.laplace.vectors[:, : len(drawn)] @ drawn)
