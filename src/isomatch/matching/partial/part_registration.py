"""Registration of a part: refine its map by functions of the whole, and bend it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from isomatch._core.arrays import (
    BodyVertices,
    Bool,
    BoolArray,
    Float,
    FloatArray,
    Int,
    PartVertices,
    SearchRows,
)
from isomatch._core.cached import cached_method, cached_property
from isomatch.correspondence import Boundary, Embedding, PrecisePoints, nearest_with_normals
from isomatch.descriptors import deviation_of
from isomatch.matching.bending import Bending, BentShape, CoarseShape, HardLandmarks, Surroundings
from isomatch.matching.coordinates import iterate_images
from isomatch.matching.maps import Fit
from isomatch.matching.parameters import PART_FIT, PART_UNIT
from isomatch.matching.partial.part_pair import PartPair, PartSignatures, WholeSignatures
from isomatch.matching.partial.part_starts import PartStart, complete_anchors, compose_with_self_map
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import vertex_normals

ALL_FUNCTIONS = 10**6  # more functions than any basis has, so that all are used
# lower costs, as of a part mapped onto itself, are raised to this, so that ratios of costs are finite; chosen
MIN_COST = 1e-12


class WholeCoordinates:
    """Coordinates of a whole in which images are searched; they do not depend on a map."""

    # Results are kept for each number of functions in the settings, and for each unit of a part (its √area over the
    # whole's). They are few, because units are rounded (`PartPair.nearest_allowed_unit`).
    def __init__(
        self,
        whole: PreparedShape,
        config: Config,  # settings of the match; the whole may be prepared with others
        landmarks: Int[BodyVertices, "l"],  # vertices of the landmarks on the whole
        functions: Float[FloatArray, "n_whole q"],  # functions that are known on part and whole
    ) -> None:
        self._whole, self._settings, self._landmarks = whole, config.refining, landmarks
        self.signatures = WholeSignatures(whole, functions)

    @cached_property
    def features(self) -> Float[FloatArray, "n_whole k"]:
        """Signatures, and distances from the landmarks."""
        all_vertices = np.arange(self._whole.body.n_vertices)
        # longer distances are lowered to landmark_reach: twisted limbs or unknown detours would disturb them
        distances = self._whole.distances.between(all_vertices, self._landmarks)
        distances = np.clip(distances, 0.0, PART_FIT.landmark_reach)
        return np.hstack([self.signatures.values, distances / self._settings.position_unit])

    @cached_method
    def features_of_part(self, pair: PartPair) -> PartSignatures:
        """Features of a part in the unit of a pair; distances count only where known."""
        signatures, n, bounds = self.signatures.of_part(pair), len(self._landmarks), (pair.lower, pair.along)
        lower, upper = (np.minimum(pair.unit * bound[:n].T, PART_FIT.landmark_reach) for bound in bounds)
        return PartSignatures(
            np.hstack([signatures.values, upper / self._settings.position_unit]),
            np.hstack([signatures.weights, (lower >= PART_UNIT.known_ratio * upper).astype(np.float64)]),
        )

    @cached_method
    def smooth(self, k: int) -> tuple[Float[FloatArray, "n_whole 3"], Float[FloatArray, "n_whole 3"]]:
        """Smooth the whole to its first k functions: vertices and normals."""
        mesh = self._whole.mesh_body
        vertices = self._whole.laplace.low_passed(mesh.vertices, k)
        return vertices, vertex_normals(vertices, mesh.faces)

    @cached_method
    def at(self, k: int, with_positions: bool) -> Float[FloatArray, "n_whole d"]:
        """Coordinates with k functions."""
        settings = self._settings
        columns = [self._whole.laplace.vectors[:, :k] / np.sqrt(k), self.features]
        if with_positions:
            vertices, normals = self.smooth(k)
            columns += [vertices / settings.position_unit, settings.normal_weight * normals]
        return np.hstack(columns)


class PartRefinement:
    """Refines maps of some vertices of the part in one unit."""

    # A map T: part → whole pulls the first k functions Φ of the whole back to the part, Φ ∘ T ≈ Ψ F, where Ψ
    # are functions of the part, and F is the functional map, fitted at the samples. Then T(x) is the vertex
    # of the whole whose row of Φ is nearest to Ψ(x) F; both steps are repeated with more functions (ZoomOut:
    # Melzi et al. 2019; partial functional maps: Rodolà et al. 2017). Functions are pulled from the whole to
    # the part, because functions of the part have no values beyond its boundary. So coordinates of the whole
    # do not depend on the map.
    def __init__(self, pair: PartPair, coordinates: WholeCoordinates, n_rows: int) -> None:
        self._pair, self._whole = pair, coordinates
        self._features = coordinates.features_of_part(pair)
        self.vertices = PartVertices(pair.part.sample_vertices[:n_rows])
        self._basis = pair.part.sampled_basis(n_rows)

    def n_functions(self, k: int) -> int:
        """Count the functions of the part that correspond to the first k functions of the whole."""
        # The large entries of the functional map of a part lie along a slanted line, not along the diagonal:
        # by Weyl's law, λ_j ≈ 4πj / area, its slope is the share of the area (Rodolà et al., Partial
        # functional correspondence, 2017). Counting functions up to an eigenvalue, in units of the whole,
        # does not need this slope.
        part, whole = self._pair.part.laplace, self._pair.whole.laplace
        top = PART_FIT.function_ratio * whole.values[min(k, len(whole.values)) - 1]
        most = min(len(part.values), len(self.vertices) // 3)
        n_below = np.searchsorted(part.values / self._pair.share, top)
        return int(np.clip(n_below + PART_FIT.extra_functions, 6, most))

    def refine(
        self, image: Int[BodyVertices, "r"], sizes: Iterable[int], with_positions: bool = True
    ) -> tuple[Int[BodyVertices, "r"], float]:
        """Refine images; return them, and their mean distance in the last coordinates."""

        def nearest(embedding: Embedding, _: int) -> tuple[BodyVertices, BodyVertices]:
            row = BodyVertices(self._pair.whole.index.vertices(embedding.target, embedding.source))
            return row, row

        def coordinates(image: BodyVertices, size: int) -> Embedding:
            return self.embedding(image, size, self.vertices, with_positions)

        return iterate_images(image, sizes, coordinates, nearest)

    def extend(self, image: BodyVertices, k: int, vertices: PartVertices | None = None) -> BodyVertices:
        """Extend a map of the first samples through k functions, by default to all samples."""
        vertices = self.vertices if vertices is None else vertices
        basis = self._pair.part.sampled_basis(len(image))
        functions = self._pair.whole.laplace.vectors[:, :k]
        k_part = min(self.n_functions(k), len(basis.vertices) // 3)
        pulled_back = basis.functions[vertices, :k_part] @ basis.fit(functions[image], k_part)
        return BodyVertices(self._pair.whole.index.vertices(functions, pulled_back))

    def orientation(self, image: Int[BodyVertices, "r"], k: int) -> float:
        """Mean cosine between normals of the whole and of its copy on the part."""
        vertices, of_whole = self._whole.smooth(k)
        normals = self._pulled_back(vertices[image], self.n_functions(k))[1]
        return float(np.einsum("ij,ij->i", normals[self.vertices], of_whole[image]).mean())

    def embedding(
        self, image: BodyVertices, size: int, vertices: PartVertices, with_positions: bool = True
    ) -> Embedding:
        """Coordinates of some vertices of the part, and of all of the whole, under a map."""
        pair, settings = self._pair, self._pair.config.refining
        k = min(size, len(pair.whole.laplace.values))
        k_part = self.n_functions(k)
        functions = pair.whole.laplace.vectors[:, :k]  # Φ (n_whole, k)
        # Ψ F: (q, k_part) @ (k_part, k)
        pulled_back = pair.part.laplace.vectors[vertices, :k_part] @ self._basis.fit(functions[image], k_part)
        nearest = image if vertices is self.vertices else pair.whole.index.vertices(functions, pulled_back)
        # Where the boundary makes the signature s(x) of the part unreliable (weight w < 1), it is replaced by
        # w s(x) + (1 − w) s(T(x)), with the whole's signature at the present image T(x): at w = 0, it only
        # holds the image in its place.
        weights, on_part = self._features.weights[vertices], self._features.values[vertices]
        on_whole = self._whole.features[nearest]
        columns = [pulled_back / np.sqrt(k), weights * on_part + (1 - weights) * on_whole]
        if with_positions:
            positions, normals = self._pulled_back(self._whole.smooth(k)[0][image], k_part)
            positions = positions[vertices] / settings.position_unit
            columns += [positions, settings.normal_weight * normals[vertices]]
        return Embedding(np.hstack(columns), self._whole.at(k, with_positions))

    def _pulled_back(
        self, positions: Float[FloatArray, "r 3"], k_part: int
    ) -> tuple[Float[FloatArray, "n_part 3"], Float[FloatArray, "n_part 3"]]:
        """Copy the whole to the part by the positions of images: vertices and normals."""
        vertices = self._basis.functions[:, :k_part] @ self._basis.fit(positions, k_part)
        return vertices, vertex_normals(vertices, self._pair.part.mesh_body.faces)


@dataclass(frozen=True, eq=False)
class BentPart(BentShape):
    """A part bent until it lies on the surface of a whole."""

    pair: PartPair  # part and whole in the unit of the map

    def onto_part(self) -> tuple[PrecisePoints, Bool[BoolArray, "n_whole"]]:
        """Map vertices of the whole to nearest points of the part, and find the covered ones."""
        bent, whole, settings = self.mesh, self.onto.mesh, self.pair.config.parts
        points = nearest_with_normals(whole, bent, self.pair.part.index)
        gap = np.linalg.norm(points.interpolated(bent.vertices) - whole.vertices, axis=1)
        # A vertex of the whole that the part lacks has its nearest point on the boundary of the bent part,
        # and might be close to this point. A vertex with its nearest point inside is off only by the error of bending.
        # So the tolerance is smaller at the boundary, unless too few distances are known for an exact map.
        inside = settings.surface_tolerance
        at_boundary = inside if self.pair.is_hardly_known else settings.boundary_tolerance
        return points, gap <= np.where(Boundary(bent).holds(points), at_boundary, inside)


class PartBending(Bending):
    """Bends a part onto a whole by maps."""

    # The energy is as in `Bending`, with lengths of the part times the unit. A map by functions crowds images
    # at the boundary, because functions of the part satisfy Neumann conditions there, and functions of the
    # whole do not. The bent part keeps the spacing of its vertices up to the boundary, so their nearest
    # points on the whole are better images than those of the map that bent it.
    def lay(
        self, pair: PartPair, refinement: PartRefinement, image: BodyVertices, lengths: tuple[float, ...]
    ) -> BentPart:
        """Bend the part coarsely onto the whole, starting from a map."""
        onto = Surroundings(pair.whole.mesh_body, pair.whole.index, pair.unit)
        of_part, of_whole = refinement.embedding(image, ALL_FUNCTIONS, PartVertices(self.vertices))
        start = onto.index.points(of_whole, of_part).interpolated(onto.mesh.vertices)
        bent = self.bend_coarsely(onto, start, lengths, _hard_landmarks(pair))
        return BentPart(bent.rest, bent.mesh, onto, pair)

    def lay_in_full(self, bent: BentPart, lengths: tuple[float, ...]) -> BentPart:
        """Bend the part at full resolution, starting from its bent coarse version."""
        full = self.bend_in_full(bent, lengths, _hard_landmarks(bent.pair))
        return BentPart(full.rest, full.mesh, full.onto, bent.pair)


def _hard_landmarks(pair: PartPair) -> HardLandmarks:
    return pair.anchors[: len(pair.landmarks)], pair.whole.mesh_body.vertices[pair.landmarks]


@dataclass(frozen=True, eq=False, kw_only=True)
class PartFit(Fit):
    """A map of a part, in a unit; ``score`` stays nan, see ``cost``."""

    pair: PartPair  # part and whole in the unit of the map
    refinement: PartRefinement  # refines the images of the same vertices
    bending: PartBending
    stress: float = np.nan  # mean cost of the images of the anchors, see `PartPair.stress`
    lengths: tuple[float, ...] = ()  # lengths by which the part is bent, see ``PartSettings.bending``

    @cached_property
    def descriptor_distances(self) -> Float[FloatArray, "r"]:
        """Descriptor distance of each vertex and its image, by balls; nan where unknown."""
        of_whole = self.pair.whole.balls
        if of_whole is None:
            return np.full(len(self.image), np.nan)
        of_part = self.pair.signature.at(self.refinement.vertices)
        return of_part.descriptor_distance(of_whole.at(self.image), deviation_of(of_whole))

    @cached_property
    def bent(self) -> BentPart:
        """The part bent onto the whole by the map, at a lower resolution."""
        return self.bending.lay(self.pair, self.refinement, self.image, self.lengths)

    @property
    def cost(self) -> float:
        """Cost among other maps: spectral residual × a power of the stress of distances."""
        # The cost is r σ^¼ with the spectral residual r and the stress σ. Only ratios of costs are compared,
        # so log r + ¼ log σ can weigh two quantities of different units. The residual measures detail after a
        # smooth fit; the stress measures distances, to which no map was fitted.
        return max(float(self.spectral_residual * self.stress**PART_FIT.stress_exponent), MIN_COST)

    @property
    def cost_with_bending(self) -> float:
        """Cost of the map by itself, if no other is close: the cost × the cost of bending."""
        # With the spectral residual r and the stress σ, this is r σ^¼ × (stretch × gap). No map was selected
        # by stretch × gap, so this factor is independent evidence about the selected map.
        return max(self.cost * self.bent.bending_cost, MIN_COST)

    @property
    def rough_cost(self) -> float:
        """Cost of a roughly refined map, which may be twisted in places and still become right."""
        # The rough cost is cost / √o × exp(w m), with
        #   o   mean cosine of the normals. A map that is inside out over a share t of the part has
        #       o ≈ 1 − 2t. The fine refinement repairs small twists, so they are penalised only by
        #       1 / √o ≈ 1 + t. This is at most 1 / √0.1 ≈ 3.2, slightly above `PartSettings.hopeless`,
        #       from which a map is dropped. Mirror images, o < 0, were dropped before.
        #   m   mean of the known descriptor distances, 0 without any; w is `PartSettings.descriptor_weight`.
        #       If the log ratio of the densities of m at right and wrong images is linear in m, exp(w Δm) is
        #       the likelihood ratio of two maps whose m differ by Δm. The mean is over the whole part, because
        #       rough maps differ nearly everywhere; fine maps are compared only where they differ
        #       (`weigh_costs`).
        twist = max(self.orientation, PART_FIT.min_orientation)
        known = self.descriptor_distances[np.isfinite(self.descriptor_distances)]
        unlike = self.pair.config.parts.descriptor_weight * float(known.mean()) if len(known) else 0.0
        return float(self.cost / np.sqrt(twist) * np.exp(unlike))


class PartFits:
    """Refines maps of a part, roughly and finely; starts in one unit share results."""

    # The cache holds two refinements for each unit.
    def __init__(
        self,
        pair: PartPair,
        given: Int[BodyVertices, "n_part"] | None = None,  # images under a given map
        coordinates: WholeCoordinates | None = None,  # coordinates of the whole, if already known
    ) -> None:
        config = pair.config
        self.pair, self._config, self.given = pair, config, given
        known = pair.landmarks, pair.functions.target
        self.coordinates = coordinates or WholeCoordinates(pair.whole, config, *known)
        self.bending = PartBending(CoarseShape(pair.part.mesh_body, config.parts.n_bent_vertices))

    @cached_method
    def _refinement(self, pair: PartPair, n_rows: int) -> PartRefinement:
        return PartRefinement(pair, self.coordinates, n_rows)

    @cached_property
    def _near_pairs(
        self,
    ) -> tuple[Bool[BoolArray, "q q"], Bool[BoolArray, "near"], Float[FloatArray, "near"]]:
        """Which pairs of samples are close, which of these have a known distance, and all distances."""
        pair, config = self.pair, self._config
        most = min(config.n_search, config.n_refine, PART_FIT.n_rough_vertices)
        vertices = pair.part.sample_vertices[:most]
        along = np.maximum(pair.part.distances.between(vertices, vertices), 0.0)
        near = (along > PART_FIT.min_near_distance) & (along < PART_FIT.max_near_distance)
        lower = pair.missing.lower_bound(vertices, vertices, along)
        return near, lower[near] >= PART_UNIT.known_ratio * along[near], along[near]

    def local_unit(self, pair: PartPair, image: Int[BodyVertices, "r"]) -> float:
        """Measure the unit: median ratio of distances of images and close known distances."""
        if pair.keeps_unit:
            return pair.unit
        near, exact, along = self._near_pairs
        if exact.sum() < PART_UNIT.min_known_distances:
            return pair.unit
        images = image[: len(near)]
        of_images = np.maximum(pair.whole.distances.between(images, images)[near], 1e-3)
        return pair.nearest_allowed_unit(float(np.median((of_images / along)[exact])))

    def refine_start(self, start: PartStart) -> PartFit | None:
        """Refine a start roughly; None for a mirror image."""
        refinement = self._refinement(start.pair, PART_FIT.n_rough_vertices)
        vertices = PartVertices(refinement.vertices[: self._config.n_search])
        origin = "landmarks" if len(self.pair.landmarks) else "anchors"
        image = refinement.extend(start.extend(vertices), PART_FIT.n_rough_normal_functions)
        return self.refine_roughly(start.pair, image, origin)

    def compose(self, fit: PartFit, image_row: Int[SearchRows, "m_t"]) -> PartFit | None:
        """Compose a roughly refined map with a self-map of the whole, and refine it again."""
        image = compose_with_self_map(fit.pair.whole, fit.image, image_row)
        return self.refine_roughly(fit.pair, image, fit.origin)

    def refine_roughly(self, pair: PartPair, image: Int[BodyVertices, "r"], origin: str) -> PartFit | None:
        """Refine a map of the rough vertices roughly; None for a mirror image."""
        refinement, k = self._refinement(pair, PART_FIT.n_rough_vertices), PART_FIT.n_rough_normal_functions
        if refinement.orientation(image, k) < 0:
            return None
        image, residual = refinement.refine(image, PART_FIT.rough_sizes)
        anchors = refinement.extend(image, PART_FIT.rough_sizes[-1], pair.anchors)
        return self._fit(refinement, pair, image, residual, anchors, k, origin)

    def begin(self, pair: PartPair, image: BodyVertices, origin: str) -> PartFit:
        """Extend a map of the rough vertices to the fine vertices, in the unit that it measures."""
        pair = pair.with_unit(self.local_unit(pair, image))
        refinement = self._refinement(pair, self._config.n_refine)
        image = refinement.extend(image, PART_FIT.rough_sizes[-1])
        return PartFit(image, origin=origin, pair=pair, refinement=refinement, bending=self.bending)

    def refine(self, fit: PartFit) -> PartFit:
        """Refine a map to the end."""
        settings = self._config.refining
        sizes = (*settings.sizes_without_positions, *settings.sizes_of_parts)
        image, spectral_residual = fit.refinement.refine(fit.image, sizes, False)
        if sizes := (*settings.sizes_with_positions, *settings.final_sizes):
            image, spectral_residual = fit.refinement.refine(image, sizes)
        lengths = self._config.parts.bending[::2]
        return self._fit_finely(fit.pair, image, spectral_residual, lengths, fit.origin)

    def refine_from_bending(self, fit: PartFit, again: Callable[[PartFit], PartFit]) -> PartFit:
        """Alternate bending the part by a map, and refining the map from the bent part."""
        for _ in range(PART_FIT.n_bending_rounds):
            image = self.bending.images(fit.bent, fit.refinement.vertices)
            fit = again(replace(fit, image=image, spectral_residual=np.inf))
        return fit

    def refine_again(self, fit: PartFit) -> PartFit:
        """Take the last steps of the refinement."""
        settings = self._config.refining
        steps = (settings.final_sizes, True) if settings.final_sizes else settings.last_step
        image, spectral_residual = fit.refinement.refine(fit.image, *steps)
        return self._fit_finely(fit.pair, image, spectral_residual, self._config.parts.bending, fit.origin)

    def measure(self, pair: PartPair, image: Int[BodyVertices, "r"], origin: str = "") -> PartFit:
        """Measure a map of the fine vertices that another method found, as if it were refined."""
        refinement = self._refinement(pair, self._config.n_refine)
        _, spectral_residual = refinement.refine(image, *self._config.refining.last_step)
        return self._fit_finely(pair, image, spectral_residual, self._config.parts.bending, origin)

    def _fit_finely(
        self, pair: PartPair, image: BodyVertices, residual: float, lengths: tuple[float, ...], origin: str
    ) -> PartFit:
        refinement = self._refinement(pair, self._config.n_refine)
        k = min(PART_FIT.n_anchor_functions, len(pair.whole.laplace.values))
        anchors = complete_anchors(pair, refinement.extend(image, k, pair.anchors), 2)
        error = 0.0
        if self.given is not None:
            error = pair.whole.mean_distance(image, self.given[refinement.vertices])
        fit = self._fit(refinement, pair, image, residual, anchors, PART_FIT.n_fine_normal_functions, origin)
        return replace(fit, lengths=lengths, prior_error=error)

    def _fit(
        self,
        refinement: PartRefinement,
        pair: PartPair,
        image: Int[BodyVertices, "r"],
        residual: float,
        anchors: Int[BodyVertices, "m"],
        k: int,
        origin: str,
    ) -> PartFit:
        """Measure a map; ``anchors`` are its images of the anchors."""
        return PartFit(
            image,
            residual,
            orientation=refinement.orientation(image, k),
            origin=origin,
            pair=pair,
            refinement=refinement,
            bending=self.bending,
            stress=pair.stress(anchors),
        )
