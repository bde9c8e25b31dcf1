"""Registration of a part: its map is refined by functions of the whole, and the part is bent onto the whole."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from isomatch.correspondence import Boundary, Embedding, PrecisePoints, SampledBasis, nearest_with_normals
from isomatch.descriptors import deviation_of
from isomatch.matching.coordinates import iterated
from isomatch.matching.fit import Fit
from isomatch.matching.relations.bending import Bending, Bent, Held, Surroundings
from isomatch.matching.relations.part_pair import (
    FEWEST_KNOWN,
    TRUSTED,
    PartPair,
    PartSignatures,
    WholeSignatures,
)
from isomatch.matching.relations.part_starts import PartStart, completed, composed
from isomatch.matching.search import FromAnchors
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh, vertex_normals
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_method, cached_property


@dataclass(frozen=True, eq=False)
class LandmarkDistances:
    """Distances from landmarks, up to a reach beyond which a twisted limb or an unknown detour spoils them."""

    whole: PreparedShape  # a mesh of area 1
    landmarks: IntArray  # (l,): vertices of its body
    reach: float  # larger distances count as this, in √area of the whole

    @cached_property
    def values(self) -> FloatArray:
        """(n_whole, l) distances."""
        everywhere = np.arange(self.whole.body.n_vertices)
        return np.clip(self.whole.distances.between(everywhere, self.landmarks), 0.0, self.reach)

    def of_part(self, pair: PartPair) -> PartSignatures:
        """Distances on a part in the unit of a pair, trusted where no path beyond the boundary can be shorter."""
        bounds = (each[: len(self.landmarks)] for each in (pair.lower, pair.along))
        lower, upper = (np.minimum(pair.unit * bound.T, self.reach) for bound in bounds)
        return PartSignatures(upper, (lower >= TRUSTED * upper).astype(np.float64))


# a boundary needs more functions than the share of the area says; chosen on cuts and holes, not one by one
FUNCTION_RATIO = 1.75

# distances from landmarks, in √area, up to which they are coordinates of the refinement; docs/robustness.md: parts
LANDMARK_REACH = 0.3

# distances along the part, in its √area, whose ratios to those of the images measure the unit;
# chosen on cuts and holes, not one by one
LEAST_NEAR, MOST_NEAR = 0.08, 0.3

EXTRA_FUNCTIONS = 3
N_ROUGH_VERTICES = 500  # of the part in the short refinement; chosen on cuts and holes, not one by one


class _Smooth(NamedTuple):
    """The whole through its first functions: vertices (n, 3) and normals (n, 3)."""

    vertices: FloatArray
    normals: FloatArray


class WholeCoordinates:
    """Coordinates of a whole in which images are sought."""

    def __init__(
        self, whole: PreparedShape, config: Config, landmarks: IntArray, functions: FloatArray
    ) -> None:
        self._whole, self._settings = whole, config.refining
        self.signatures = WholeSignatures(whole, functions)
        self._distances = LandmarkDistances(whole, landmarks, LANDMARK_REACH)

    @cached_property
    def known(self) -> FloatArray:
        """Signatures, and distances from the landmarks: (n, 23 + q + l)."""
        return np.hstack([self.signatures.values, self._distances.values / self._settings.position_unit])

    @cached_method
    def known_of_part(self, pair: PartPair) -> PartSignatures:
        """Return the same of a part in the unit of a pair."""
        signatures, distances = self.signatures.of_part(pair), self._distances.of_part(pair)
        return PartSignatures(
            np.hstack([signatures.values, distances.values / self._settings.position_unit]),
            np.hstack([signatures.weights, distances.weights]),
        )

    @cached_method
    def smooth(self, k: int) -> _Smooth:
        """Give the whole through its first k functions."""
        mesh = self._whole.mesh_body
        vertices = self._whole.laplace.low_passed(mesh.vertices, k)
        return _Smooth(vertices, vertex_normals(vertices, mesh.faces))

    @cached_method
    def at(self, k: int, with_positions: bool) -> FloatArray:
        """Give the coordinates (n, m) with k functions."""
        settings = self._settings
        columns = [self._whole.laplace.vectors[:, :k] / np.sqrt(k), self.known]
        if with_positions:
            smooth = self.smooth(k)
            columns += [smooth.vertices / settings.position_unit, settings.normal_weight * smooth.normals]
        return np.hstack(columns)


class PartSamples:
    """The sample vertices of a part, in any unit."""

    def __init__(self, pair: PartPair) -> None:
        self._pair = pair

    def basis(self, n_rows: int) -> SampledBasis:
        """Functions of the part, to be fitted to values at its first sample vertices."""
        return self._pair.part.sampled_basis(n_rows)

    @cached_property
    def near(self) -> tuple[BoolArray, BoolArray, FloatArray]:
        """Near pairs of the first q vertices (q, q), which of them have a known distance on the whole, and those along."""
        pair, config = self._pair, self._pair.config
        vertices = pair.part.sample_vertices[: min(config.n_search, config.n_refine, N_ROUGH_VERTICES)]
        along = np.maximum(pair.part.distances.between(vertices, vertices), 0.0)
        near = (along > LEAST_NEAR) & (along < MOST_NEAR)
        known = pair.missing.lower_bound(vertices, vertices, along)[near] >= TRUSTED * along[near]
        return near, known, along[near]


class PartRefinement:
    """Refines maps of some vertices of the part."""

    def __init__(
        self, pair: PartPair, coordinates: WholeCoordinates, samples: PartSamples, n_rows: int
    ) -> None:
        self._pair, self._whole, self._samples = pair, coordinates, samples
        self._known = coordinates.known_of_part(pair)
        self.vertices = pair.part.sample_vertices[:n_rows]
        self._basis = samples.basis(n_rows)

    def n_functions(self, k: int) -> int:
        """Count the functions of the part with eigenvalues up to those of the first k of the whole, and somewhat more."""
        part, whole = self._pair.part.laplace, self._pair.whole.laplace
        top = FUNCTION_RATIO * whole.values[min(k, len(whole.values)) - 1]
        most = min(len(part.values), len(self.vertices) // 3)
        return int(np.clip(np.searchsorted(part.values / self._pair.share, top) + EXTRA_FUNCTIONS, 6, most))

    def refined(
        self, image: IntArray, sizes: Iterable[int], with_positions: bool = True
    ) -> tuple[IntArray, float]:
        """Refine the images (r,) of the vertices; returns them, and their mean distance in the last coordinates."""

        def nearest(embedding: Embedding, _: int) -> tuple[IntArray, IntArray]:
            row = self._pair.whole.index.vertices(embedding.target, embedding.source)
            return row, row

        return iterated(
            image,
            sizes,
            lambda image, size: self.embedding(image, size, self.vertices, with_positions),
            nearest,
        )

    def extended(self, image: IntArray, k: int) -> IntArray:
        """Map the vertices of this refinement by a map (q,) of another number of sample vertices, through k functions."""
        return self._drawn(self._samples.basis(len(image)), image, k, self.vertices)

    def at(self, image: IntArray, k: int, vertices: IntArray) -> IntArray:
        """Map other vertices (q,) of the part by a map (r,) of those of this refinement, through k functions."""
        return self._drawn(self._basis, image, k, vertices)

    def _drawn(self, basis: SampledBasis, image: IntArray, k: int, vertices: IntArray) -> IntArray:
        functions = self._pair.whole.laplace.vectors[:, :k]
        k_part = min(self.n_functions(k), len(basis.vertices) // 3)
        drawn = basis.functions[vertices, :k_part] @ basis.fit(functions[image], k_part)
        return self._pair.whole.index.vertices(functions, drawn)

    def local_unit(self, image: IntArray) -> float:
        """Measure the unit by images (r,): the median ratio of known distances between near ones and along the part."""
        known = self._samples.near[1]
        if known.sum() < FEWEST_KNOWN:
            return self._pair.unit
        return self._pair.restricted(float(np.median(self._ratios(image)[known])))

    def _ratios(self, image: IntArray) -> FloatArray:
        """Ratios of distances between images and along the part, over pairs of near vertices."""
        near, _, along = self._samples.near
        image = image[: len(near)]
        there: FloatArray = self._pair.whole.distances.between(image, image)[near]
        return np.maximum(there, 1e-3) / along

    def orientation(self, image: IntArray, k: int) -> float:
        """Mean cosine of the normals of the whole and of its copy drawn on the part."""
        smooth = self._whole.smooth(k)
        normals = self._drawn_normals(smooth.vertices[image], self.n_functions(k))[1]
        return float(np.einsum("ij,ij->i", normals[self.vertices], smooth.normals[image]).mean())

    def embedding(
        self, image: IntArray, size: int, vertices: IntArray, with_positions: bool = True
    ) -> Embedding:
        """Coordinates of some vertices of the part, and of all of the whole, under a map (r,)."""
        pair, settings = self._pair, self._pair.config.refining
        k = min(size, len(pair.whole.laplace.values))
        k_part = self.n_functions(k)
        functions = pair.whole.laplace.vectors[:, :k]
        drawn = pair.part.laplace.vectors[vertices, :k_part] @ self._basis.fit(functions[image], k_part)
        nearest = image if vertices is self.vertices else pair.whole.index.vertices(functions, drawn)
        trusted = self._known.weights[vertices]
        there = self._whole.known[nearest]
        columns = [drawn / np.sqrt(k), trusted * self._known.values[vertices] + (1 - trusted) * there]
        if with_positions:
            smooth = self._whole.smooth(k)
            positions, normals = self._drawn_normals(smooth.vertices[image], k_part)
            columns += [
                positions[vertices] / settings.position_unit,
                settings.normal_weight * normals[vertices],
            ]
        return Embedding(np.hstack(columns), self._whole.at(k, with_positions))

    def _drawn_normals(self, positions: FloatArray, k_part: int) -> tuple[FloatArray, FloatArray]:
        """Draw the whole on the part by the positions of the images (r, 3): vertices and normals."""
        mesh = self._pair.meshes[0]
        drawn = self._basis.functions[:, :k_part] @ self._basis.fit(positions, k_part)
        return drawn, vertex_normals(drawn, mesh.faces)


ALL_FUNCTIONS = 10**6


@dataclass(frozen=True, eq=False)
class BentPart(Bent):
    """A part bent until it lies on the surface of a whole."""

    pair: PartPair  # the shapes, in the unit of the map

    def onto_part(self) -> tuple[PrecisePoints, BoolArray]:
        """Points of the part for the vertices of the whole, and which of these the part covers."""
        bent, whole, settings = self.mesh, self.onto.mesh, self.pair.config.parts
        points = nearest_with_normals(whole, bent, self.pair.part.index)
        gap = np.linalg.norm(points.interpolated(bent.vertices) - whole.vertices, axis=1)
        rim = settings.off if self.pair.is_hardly_known else settings.rim
        return points, gap <= np.where(Boundary(bent).holds(points), rim, settings.off)


class PartBending:
    """Bends a part onto a whole by maps: at a lower resolution, and for the last one in full."""

    def __init__(self, part: Mesh, n_vertices: int) -> None:
        self._bending = Bending(part, n_vertices)

    def coarsely(
        self, pair: PartPair, refinement: PartRefinement, image: IntArray, lengths: tuple[float, ...]
    ) -> BentPart:
        """Lay the part on the whole by a map (r,) of the vertices of a refinement, and bend it."""
        onto = Surroundings(pair.meshes[1], pair.whole.index, pair.unit)
        of_part, of_whole = refinement.embedding(image, ALL_FUNCTIONS, self._bending.vertices)
        start = onto.index.points(of_whole, of_part).interpolated(onto.mesh.vertices)
        bent = self._bending.coarsely(onto, start, lengths, _held(pair))
        return BentPart(bent.flat, bent.mesh, onto, pair)

    def image(self, bent: BentPart, vertices: IntArray) -> IntArray:
        """Vertices of the whole nearest to some vertices (r,) of the part that is bent at the lower resolution."""
        return self._bending.images(bent, vertices)

    def spread(self, values: FloatArray) -> FloatArray:
        """Interpolate values (n_coarse,) at the lower resolution on the vertices of the part."""
        return self._bending.spread(values)

    def in_full(self, bent: BentPart, lengths: tuple[float, ...]) -> BentPart:
        """Bend the part in full, from where it lies at the lower resolution."""
        full = self._bending.in_full(bent, lengths, _held(bent.pair))
        return BentPart(full.flat, full.mesh, full.onto, bent.pair)


def _held(pair: PartPair) -> Held:
    return pair.anchors[: len(pair.landmarks)], pair.meshes[1].vertices[pair.landmarks]


# cost = misfit × stress to this power; docs/notes/ball_signature.md: 0.15 to 0.4 choose alike
STRESS_EXPONENT = 0.25

# functions of the whole in the short refinement; chosen on cuts and holes, not one by one
ROUGH_SIZES = (20, 40, 70)

N_BENT = 2  # times that a map is settled; docs/robustness.md: parts

LEAST_SCORE = 1e-12  # so that scores have a ratio where a part is copied onto itself without error
N_ROUGH_FUNCTIONS, N_FINE_FUNCTIONS = (
    40,
    60,
)  # functions of the whole that are drawn on the part, to see where normals point
N_DRAWN = 200  # functions by which the anchors of a fine map are drawn


@dataclass(frozen=True, eq=False, kw_only=True)
class PartFit(Fit):
    """A map of a part, in a unit."""

    pair: PartPair  # the shapes, in the unit of the map
    refinement: PartRefinement  # refines the vertices that are mapped
    bending: PartBending  # bends the part
    stress: float = np.nan  # mean cost of the images of the anchors, see `PartPair.stress`
    lengths: tuple[
        float, ...
    ] = ()  # lengths over which the part resists when it is bent by the map, see `PartSettings`

    @cached_property
    def mismatches(self) -> FloatArray:
        """(r,) how differently part and whole look around each vertex and its image; nan where nothing is known."""
        here, there = self.pair.signature, self.pair.whole.balls
        if there is None:
            return np.full(len(self.image), np.nan)
        return here.at(self.refinement.vertices).mismatch(there.at(self.image), deviation_of(there))

    @property
    def mismatch(self) -> float:
        """Their mean, or 0 if nothing is known."""
        known = self.mismatches[np.isfinite(self.mismatches)]
        return float(known.mean()) if len(known) else 0.0

    @cached_property
    def bent(self) -> BentPart:
        """The part bent onto the whole by the map, at a lower resolution."""
        return self.bending.coarsely(self.pair, self.refinement, self.image, self.lengths)

    @property
    def is_measured(self) -> bool:
        """Whether the relation has measured the map."""
        return bool(np.isfinite(self.misfit) and np.isfinite(self.stress))

    @property
    def share(self) -> float:
        """Area of the part over that of the whole, by the map."""
        return self.refinement.local_unit(self.image) ** 2

    @property
    def cost(self) -> float:
        """What the map costs among others: how badly coordinates and distances agree."""
        return max(float(self.misfit * self.stress**STRESS_EXPONENT), LEAST_SCORE)

    @property
    def bent_cost(self) -> float:
        """What the map costs by itself, where no other is compared: the part is bent by it, too."""
        return max(self.cost * self.bent.misfit, LEAST_SCORE)

    @property
    def promise(self) -> float:
        """The cost of a map that is refined roughly: one twisted in places may still become the right one."""
        twist = np.sqrt(max(self.orientation, 0.1))
        return float(self.cost / twist * np.exp(self.pair.config.parts.mismatch_weight * self.mismatch))


class PartFits:
    """The two refinements of a start, rough and fine, with what they share for all starts in the same unit."""

    def __init__(
        self, pair: PartPair, hinted: IntArray | None = None, coordinates: WholeCoordinates | None = None
    ) -> None:
        config = pair.config
        self.pair, self._config, self._hinted, self._samples = pair, config, hinted, PartSamples(pair)
        self.coordinates = coordinates or WholeCoordinates(
            pair.whole, config, pair.landmarks, pair.functions.target
        )
        self.bending = PartBending(pair.meshes[0], config.parts.n_bent_vertices)
        self._known: dict[tuple[float, int], PartRefinement] = {}
        self._refined: dict[tuple[float, bytes], PartFit] = {}
        self._settled: dict[tuple[float, bytes], PartFit] = {}

    def of_part(self, part: PreparedShape) -> PartFits:
        """Return those of another part on which distances are the same, as of a mirror image."""
        return PartFits(replace(self.pair, part=part), self._hinted, self.coordinates)

    def _refinement(self, pair: PartPair, n_rows: int) -> PartRefinement:
        """Refine some vertices in the unit of a pair."""
        key = pair.unit, n_rows
        if key not in self._known:
            self._known[key] = PartRefinement(pair, self.coordinates, self._samples, n_rows)
        return self._known[key]

    def _rough_refinement(self, pair: PartPair) -> PartRefinement:
        return self._refinement(pair, N_ROUGH_VERTICES)

    def fine_refinement(self, pair: PartPair) -> PartRefinement:
        """Refine the vertices of a fine map in the unit of a pair."""
        return self._refinement(pair, self._config.n_refine)

    def rough(self, start: PartStart) -> PartFit | None:
        """Refine some vertices a little; None for a mirror image."""
        refinement = self._rough_refinement(start.pair)
        vertices = refinement.vertices[: self._config.n_search]
        origin = "landmarks" if len(self.pair.landmarks) else FromAnchors.name
        return self.roughly(start.pair, refinement.extended(start.dense(vertices), N_ROUGH_FUNCTIONS), origin)

    def varied(self, fit: PartFit, image_row: IntArray) -> PartFit | None:
        """Compose a roughly refined map with a map of the whole onto itself, and refine it again."""
        return self.roughly(fit.pair, composed(fit.pair.whole, fit.image, image_row), fit.origin)

    def roughly(self, pair: PartPair, image: IntArray, origin: str) -> PartFit | None:
        """Refine a map of the vertices of a rough one a little; None for a mirror image."""
        refinement = self._rough_refinement(pair)
        if refinement.orientation(image, N_ROUGH_FUNCTIONS) < 0:
            return None
        image, misfit = refinement.refined(image, ROUGH_SIZES)
        anchors = refinement.at(image, ROUGH_SIZES[-1], pair.anchors)
        return _fit(refinement, pair, image, misfit, anchors, N_ROUGH_FUNCTIONS, self.bending, origin)

    def begun(self, pair: PartPair, image: IntArray, origin: str) -> PartFit:
        """Extend a map of the vertices of a rough one to those of a fine one, in the unit that it measures."""
        pair = pair.with_unit(self._rough_refinement(pair).local_unit(image))
        refinement = self.fine_refinement(pair)
        image = refinement.extended(image, ROUGH_SIZES[-1])
        return PartFit(image, origin=origin, pair=pair, refinement=refinement, bending=self.bending)

    def refined(self, fit: PartFit) -> PartFit:
        """Refine a map to the end, unless the same was refined before."""
        return _remembered(self._refined, fit, self._refined_now)

    def _refined_now(self, fit: PartFit) -> PartFit:
        settings = self._config.refining
        sizes = (*settings.sizes_without_positions, *settings.sizes_of_parts)
        image, misfit = fit.refinement.refined(fit.image, sizes, False)
        if sizes := (*settings.sizes_with_positions, *settings.final_sizes):
            image, misfit = fit.refinement.refined(image, sizes)
        return self._finely(fit.pair, image, misfit, self._config.parts.bending[::2], fit.origin)

    def settled(self, fit: PartFit, again: Callable[[PartFit], PartFit]) -> PartFit:
        """Refine a map again from where the part lies that was bent by it, bend the part by the new map, and so on."""

        def settled_now(fit: PartFit) -> PartFit:
            for _ in range(N_BENT):
                image = self.bending.image(fit.bent, fit.refinement.vertices)
                fit = again(replace(fit, image=image, misfit=np.inf))
            return fit

        return _remembered(self._settled, fit, settled_now)

    def refined_again(self, fit: PartFit) -> PartFit:
        """Take the last steps of the refinement."""
        settings = self._config.refining
        steps = (settings.final_sizes, True) if settings.final_sizes else settings.last_step
        image, misfit = fit.refinement.refined(fit.image, *steps)
        return self._finely(fit.pair, image, misfit, self._config.parts.bending, fit.origin)

    def measured(self, pair: PartPair, image: IntArray, origin: str = "") -> PartFit:
        """Measure a map of the vertices of a fine one that was found otherwise, as if it were refined."""
        _, misfit = self.fine_refinement(pair).refined(image, *self._config.refining.last_step)
        return self._finely(pair, image, misfit, self._config.parts.bending, origin)

    def _finely(
        self, pair: PartPair, image: IntArray, misfit: float, lengths: tuple[float, ...], origin: str
    ) -> PartFit:
        refinement, most = self.fine_refinement(pair), len(pair.whole.laplace.values)
        anchors = completed(pair, refinement.at(image, min(N_DRAWN, most), pair.anchors), 2)
        error = 0.0
        if self._hinted is not None:
            error = pair.whole.mean_distance(image, self._hinted[refinement.vertices])
        k = N_FINE_FUNCTIONS
        return _fit(refinement, pair, image, misfit, anchors, k, self.bending, origin, lengths, error)


def _remembered(
    known: dict[tuple[float, bytes], PartFit], fit: PartFit, function: Callable[[PartFit], PartFit]
) -> PartFit:
    """Apply a function to a map, unless it was applied to the same one before."""
    key = fit.pair.unit, fit.image.tobytes()
    if key not in known:
        known[key] = function(fit)
    found = known[key]
    return found if found.origin == fit.origin else replace(found, origin=fit.origin)


def _fit(
    refinement: PartRefinement,
    pair: PartPair,
    image: IntArray,
    misfit: float,
    anchors: IntArray,
    k: int,
    bending: PartBending,
    origin: str,
    lengths: tuple[float, ...] = (),
    hint_error: float = 0.0,
) -> PartFit:
    """Gather the evidence for a map, and for the images that it gives the anchors."""
    return PartFit(
        image,
        misfit,
        orientation=refinement.orientation(image, k),
        hint_error=hint_error,
        origin=origin,
        pair=pair,
        refinement=refinement,
        bending=bending,
        stress=pair.stress(anchors),
        lengths=lengths,
    )
