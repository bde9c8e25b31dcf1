"""A part and a whole in common units: bounds of the distances on the whole, and signatures that both share."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray, PartVertices
from isomatch._core.cached import cached_method, cached_property
from isomatch.correspondence import Embedding, IntervalCost
from isomatch.descriptors import RADII, BallSignature, ball_signature, mean_curvature
from isomatch.geodesics import MissingRegion, distance_engine
from isomatch.matching.assessment.confidence import nearest_of
from isomatch.matching.parameters import PART_UNIT
from isomatch.matching.priors import NO_LANDMARKS
from isomatch.matching.smooth_pair import SmoothPair
from isomatch.settings import Config
from isomatch.shapes import CURVATURE_WEIGHT, N_BALLS, WAVE_WEIGHT, PreparedShape
from isomatch.surfaces import Mesh


@dataclass(frozen=True)
class PartPair:
    """A part with ``m`` anchors and a whole; lengths are in √area of the whole. Equal if their shapes and units are."""

    part: PreparedShape
    whole: PreparedShape
    unit: float  # what √area of the part is worth in √area of the whole
    config: Config  # of the match
    missing: MissingRegion = field(compare=False)  # beyond the part's boundary, in units of the part
    anchors: Int[PartVertices, "m"] = field(compare=False)  # landmarks, then farthest points
    # bounds of distances on the whole, in units of the part
    lower: Float[FloatArray, "m n_part"] = field(compare=False)
    along: Float[FloatArray, "m n_part"] = field(compare=False)  # distances along the part, in its units
    landmarks: Int[BodyVertices, "l"] = field(compare=False)  # of the whole, where the first anchors go
    radii: tuple[float, ...] = field(compare=False)  # of its balls, in units of the part
    functions: Embedding = field(compare=False)  # known functions

    @classmethod
    def of(
        cls,
        part: PreparedShape,
        whole: PreparedShape,
        config: Config,
        landmarks: Int[IntArray, "l 2"] = NO_LANDMARKS,
        functions: Embedding | None = None,
    ) -> PartPair:
        """Assume that both shapes came in the same units; landmarks are vertices of part and whole."""
        mesh, n = part.mesh_body, PART_UNIT.n_anchors
        engine = distance_engine(mesh, part.config.engine, weld=False)
        missing = MissingRegion.of(mesh, engine, PART_UNIT.n_boundary_vertices)
        anchors = PartVertices(np.concatenate([landmarks[:, 0], part.column_vertices[:n]]))
        # The distance D of two points of the part on the whole is not known, but bounded on both sides. From above, for
        # a path along the part is a path on the whole:
        #     D(x, y) ≤ d(x, y)
        # From below, for a shorter path leaves the part at a boundary point b and comes back at c, and what is missing
        # in between cannot be shorter than the straight line through the hole:
        #     D(x, y) ≥ min(d(x, y), min_{b, c} d(x, b) + |b − c| + d(c, y))
        # (the criterion of Bracha, Dagès & Kimmel, Wormhole loss for partial shape matching, 2024, used as a bound).
        # Where both agree, D is known, although much is missing.
        along = part.columns[:n].astype(np.float64)
        if len(landmarks):
            along = np.vstack([engine.distances_from(landmarks[:, 0]), along])
        unit = 1.0 if config.scale == "area" else part.scale / whole.scale
        if part.origin is None:
            lower = missing.lower_bound(anchors, np.arange(mesh.n_vertices), along)
        else:
            # Limbs cut apart where they are fused, along a cut of no width: a path that leaves through the cut goes on
            # at the other side of it, so D is at least the distance on the fused surface, whose vertices are welded.
            fused = distance_engine(mesh, part.config.engine)
            lower = np.minimum(fused.distances_from(anchors), along)
        functions = functions or SmoothPair(part, whole, config).known
        bounds, known_images = (lower, along), BodyVertices(landmarks[:, 1])
        pair = cls(part, whole, unit, config, missing, anchors, *bounds, known_images, (), functions)
        # A ball of radius r in units of the whole has radius r / unit in those of the part. Balls of the part are
        # integrated once, for radii from the least r over the largest unit to the largest r over the least unit, in
        # steps small enough to interpolate between, so that `signature` costs nothing in any unit.
        units = pair.units
        first, last = RADII[0] / max(*units, PART_UNIT.max_unit), RADII[-1] / min(units)
        radii = np.geomspace(
            first, last, 2 + round(np.log(last / first) / np.log(PART_UNIT.radius_step_ratio))
        )
        return replace(pair, radii=tuple(radii.tolist()))

    def with_unit(self, unit: float) -> PartPair:
        """Return the pair with another unit of the part."""
        return replace(self, unit=unit)

    @property
    def meshes(self) -> tuple[Mesh, Mesh]:
        """The bodies of part and whole."""
        return self.part.mesh_body, self.whole.mesh_body

    @property
    def cost(self) -> IntervalCost:
        """Cost of distances on the whole."""
        # c(D; l, u) = min(v + inside |D − u|, most) / (soft + u). With l, u, most and soft all multiplied by the unit,
        #     c(t D; t l, t u) = c(D; l, u):
        # a smaller unit is no cheaper only because all lengths are, so costs in different units can be compared.
        return IntervalCost(
            most=PART_UNIT.max_distance_cost * self.unit, soft=PART_UNIT.short_distance * self.unit
        )

    @property
    def share(self) -> float:
        """Area of the part over that of the whole."""
        return self.unit**2

    def intervals(
        self, vertices: Int[PartVertices, "q"]
    ) -> tuple[Float[FloatArray, "m q"], Float[FloatArray, "m q"]]:
        """Lower and upper bounds of distances on the whole between the anchors and some vertices."""
        return self.lower[:, vertices] * self.unit, self.along[:, vertices] * self.unit

    @cached_property
    def anchor_intervals(self) -> tuple[Float[FloatArray, "m m"], Float[FloatArray, "m m"]]:
        """The same between anchors, symmetric."""
        lower, upper = self.intervals(self.anchors)
        return np.minimum(lower, lower.T), 0.5 * (upper + upper.T)

    @cached_property
    def known_share(self) -> float:
        """Share of the pairs of anchors whose distance on the whole is known."""
        lower, upper = self.anchor_intervals
        return float((lower >= PART_UNIT.known_ratio * upper)[~np.eye(len(lower), dtype=bool)].mean())

    @property
    def is_hardly_known(self) -> bool:
        """Whether so little of the whole is known that no unit is sure, and no map exact."""
        return self.known_share < PART_UNIT.min_known_share

    @cached_property
    def to_boundary(self) -> Float[FloatArray, "n_part"]:
        """Distance of each vertex of the part to its boundary."""
        return self.missing.to_boundary * self.unit

    @cached_property
    def signature(self) -> BallSignature:
        """The ball signature of the part, in units of the whole."""
        return _ball_signature_of(self.part, self.radii).scaled(self.unit, RADII)

    def stress(self, images: Int[BodyVertices, "m"]) -> float:
        """Mean cost of the images of the anchors."""
        lower, upper = self.anchor_intervals
        distances = np.maximum(self.whole.distances.between(images, images), 0.0)
        return float(self.cost(distances, lower, upper)[~np.eye(len(images), dtype=bool)].mean())

    @property
    def knows_unit(self) -> bool:
        """Whether the unit of the files is one that a part may have."""
        least, most = np.sqrt(PART_UNIT.min_area_share), PART_UNIT.max_unit_ratio
        return bool(self.config.scale != "free" and least / most <= self.unit <= most)

    @cached_property
    def keeps_unit(self) -> bool:
        """Whether the unit is fixed: by what is asked for, or because too few distances are known to measure it."""
        unmeasured = self.config.scale == "auto" and self.is_hardly_known
        return self.config.scale in ("same", "area") or (unmeasured and self.knows_unit)

    @property
    def units(self) -> tuple[float, ...]:
        """Units to search in, by what is asked for; that of the files may be anything."""
        if self.keeps_unit:
            return (min(self.unit, 1.0),)
        # With s = area(part) / area(whole) on the true body, the unit is √s: what is cut off changes √area of the part,
        # in which its lengths come. s ≤ 1 for a part. It is at least `least_share` where the files say nothing; otherwise
        # the unit is that of the files up to `largest_change` both ways, for a person grows, and scanners differ.
        first, last = np.sqrt(PART_UNIT.min_area_share), 1.0
        if self.knows_unit:
            first = self.unit / PART_UNIT.max_unit_ratio
            last = min(self.unit * PART_UNIT.max_unit_ratio, 1.0)
        # In a geometric series of ratio q, any unit is within a factor √q of one that is tried: 1.05 for q = 1.1, which
        # is what the tolerance of `IntervalCost` (0.05) forgives. The unit is then measured by `unit_of`.
        count = 1 + max(round(np.log(last / first) / np.log(PART_UNIT.unit_step_ratio)), 0)
        return tuple(float(unit) for unit in np.geomspace(first, last, count))

    def unit_of(self, images: Int[BodyVertices, "m"]) -> float:
        """Measure the unit by images of the anchors whose distances on the whole are known, where it may change."""
        # Where the interval of a distance is a point, D = d: its ratio to the distance of the images is the error of the
        # unit. The median withstands up to half of the images being wrong. Short distances are mostly noise.
        lower, upper = self.anchor_intervals
        exact = (lower >= PART_UNIT.known_ratio * upper) & (upper > PART_UNIT.min_distance * self.unit)
        if exact.sum() < PART_UNIT.min_known_distances:
            return self.unit
        distances = self.whole.distances.between(images, images)
        return self.nearest_allowed_unit(self.unit * float(np.median(distances[exact] / upper[exact])))

    def in_unit_of(self, image: Int[BodyVertices, "n_part"]) -> PartPair:
        """Return the pair in the unit that a map measures, within those to search in."""
        units, unit = self.units, self.unit_of(BodyVertices(image[self.anchors]))
        return self.with_unit(float(np.clip(unit, units[0], units[-1])))

    def nearest_allowed_unit(self, unit: float) -> float:
        """Return the nearest unit that is allowed: one on a grid around that of the pair, and not much above 1."""
        if self.keeps_unit:
            return self.unit
        # on a grid, so that maps which measure nearly the same unit share what was computed in it
        steps = np.round(np.log(unit / self.unit) / PART_UNIT.unit_spacing)
        return min(self.unit * float(np.exp(PART_UNIT.unit_spacing * steps)), PART_UNIT.max_unit)


@cached_method
def _ball_signature_of(part: PreparedShape, radii: tuple[float, ...]) -> BallSignature:
    """Compute the ball signature of a part, in its own units."""
    return ball_signature(part.mesh_body, radii, unit=1.0, samples=part.sample_vertices[:N_BALLS], weld=False)


def areas_of_samples(shape: PreparedShape, samples: Int[IntArray, "q"]) -> Float[FloatArray, "q"]:
    """Area of the vertices nearest to each of some samples."""
    areas = np.bincount(nearest_of(shape, samples), shape.body.vertex_areas, len(samples))
    return np.asarray(areas, dtype=np.float64)


class PartSignatures(NamedTuple):
    """Signatures of a part, and weights between 0 (at the boundary) and 1 (far from it)."""

    values: Float[FloatArray, "n k"]
    weights: Float[FloatArray, "n k"]


@dataclass(frozen=True, eq=False)
class WholeSignatures:
    """Signatures of a whole, and those of its parts in comparable numbers."""

    whole: PreparedShape  # a mesh of area 1
    functions: Float[FloatArray, "n_whole q"]  # the known ones, which have no boundary to fear

    @cached_property
    def _energies(self) -> FloatArray:
        values = self.whole.laplace.values[1:]
        return np.linspace(np.log(values[4]), np.log(values[min(90, len(values) - 1)]), PART_UNIT.n_energies)

    # The wave kernel signature of Aubry, Schlickewei & Cremers (ICCV Workshops 2011) is
    #     Σ_k φ_k(x)² f_e(λ_k) / Σ_k f_e(λ_k),   f_e(λ) = exp(−(e − log λ)² / 2σ²).
    # The denominator, a sum over the spectrum, differs between a part and the whole, so it is left out here.
    def _waves(
        self, vectors: Float[FloatArray, "n k"], values: Float[FloatArray, "k"]
    ) -> Float[FloatArray, "n 20"]:
        """Logarithms of wave signatures of eigenpairs in units of the whole."""
        width = 1.4 * (self._energies[1] - self._energies[0])
        filters = np.exp(-0.5 * ((self._energies - np.log(values[:, None])) / width) ** 2)
        return np.asarray(np.log(vectors**2 @ filters + 1e-3))

    @cached_property
    def _raw(self) -> tuple[FloatArray, FloatArray]:
        """Wave signatures and curvatures before they are standardised."""
        laplace, settings = self.whole.laplace, self.whole.config.preparation
        mesh = self.whole.mesh_body
        sizes = [min(size, len(laplace.values) - 1) for size in settings.curvature_functions]
        curvatures = np.stack([mean_curvature(mesh, laplace, k, weld=False) for k in sizes], axis=1)
        return self._waves(laplace.vectors[:, 1:], laplace.values[1:]), curvatures

    @cached_property
    def _weights(self) -> tuple[float, float]:
        n_curvatures = len(self.whole.config.preparation.curvature_functions)
        return WAVE_WEIGHT / np.sqrt(PART_UNIT.n_energies), CURVATURE_WEIGHT / np.sqrt(n_curvatures)

    @cached_property
    def values(self) -> Float[FloatArray, "n_whole k"]:
        """Signatures, of which the last are the known functions."""
        weighted = [weight * _standardise(raw, raw) for weight, raw in zip(self._weights, self._raw)]
        return np.hstack([*weighted, self.functions])

    @cached_method
    def _curvature_of_part(self, part: PreparedShape, k: int) -> FloatArray:
        return mean_curvature(part.mesh_body, part.laplace, k, weld=False)

    @cached_method
    def of_part(self, pair: PartPair) -> PartSignatures:
        """Signatures of a part in the unit of a pair."""
        return self._of_part(pair, PartVertices(np.arange(len(pair.to_boundary))))

    @cached_method
    def of_anchors(self, pair: PartPair) -> PartSignatures:
        """Those of its anchors alone."""
        return self._of_part(pair, pair.anchors)

    def _of_part(self, pair: PartPair, vertices: Int[PartVertices, "n"]) -> PartSignatures:
        part, sizes = pair.part, pair.config.preparation.curvature_functions
        whole_values, distance = self.whole.laplace.values[1:], pair.to_boundary[vertices, None]
        waves, curvatures = self._raw
        vectors, values = part.laplace.vectors[vertices, 1:], part.laplace.values[1:]
        # The part times u: ∫ φ² = 1 over u² times the area asks for φ / u; λ is an inverse area, and curvature an inverse
        # length. By Weyl's law, λ_k ≈ 4πk / area, the part has about u² k functions where the whole has k.
        of_part = self._waves(vectors / pair.unit, values / pair.share)
        signatures = [self._weights[0] * _standardise(of_part, waves)]
        # A function of eigenvalue λ = exp(energy) has wavelength 2π / √λ, and differs from that of the whole up to about
        # so far from the boundary: there its value is given no weight, 1 − exp(−(distance √λ / reach)²).
        weights = [1 - np.exp(-((distance * np.exp(self._energies / 2) / PART_UNIT.boundary_reach) ** 2))]
        for column, size in zip(curvatures.T, sizes):
            k = min(size, len(whole_values))
            k_part = int(np.clip(round(k * pair.share), 8, len(part.laplace.values) - 1))
            curvature = self._curvature_of_part(part, k_part)[vertices]
            here = _standardise(curvature / pair.unit, column)
            there = _standardise(column, column)
            signatures.append(self._weights[1] * np.clip(here, there.min(), there.max())[:, None])
            weights.append(
                1
                - np.exp(
                    -((distance * np.sqrt(whole_values[k - 2]) / PART_UNIT.curvature_boundary_reach) ** 2)
                )
            )
        functions = pair.functions.source[vertices]
        weights.append(np.ones_like(functions))
        return PartSignatures(np.hstack([*signatures, functions]), np.hstack(weights))


def _standardise(values: FloatArray, reference: FloatArray) -> FloatArray:
    """Subtract the mean of a reference and divide by its deviation; of a sphere, nothing deviates."""
    return np.asarray((values - reference.mean(axis=0)) / np.maximum(reference.std(axis=0), 1e-9))
