"""A part and a whole in common units: bounds of distances, comparable signatures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray, PartVertices
from isomatch._core.cached import cached_method, cached_property
from isomatch.correspondence import Embedding, IntervalCost, Intervals
from isomatch.descriptors import RADII, BallSignature, ball_signature, mean_curvature
from isomatch.geodesics import MissingRegion, distance_engine
from isomatch.matching.assessment.confidence import nearest_of
from isomatch.matching.coordinates import SmoothPair
from isomatch.matching.parameters import PART_UNIT
from isomatch.matching.priors import NO_LANDMARKS
from isomatch.settings import Config
from isomatch.shapes import CURVATURE_WEIGHT, N_BALLS, WAVE_WEIGHT, PreparedShape


@dataclass(frozen=True)
class PartPair:
    """A part with ``m`` anchors and a whole, each of area 1; pairs are equal if their shapes and units are."""

    part: PreparedShape
    whole: PreparedShape
    unit: float  # √area of the part over √area of the whole
    config: Config  # settings of the match
    missing: MissingRegion = field(compare=False)  # what lies beyond its boundary, in √area of the part
    anchors: Int[PartVertices, "m"] = field(compare=False)  # landmarks, then farthest points
    # lower bounds of distances on the whole, in √area of the part
    lower: Float[FloatArray, "m n_part"] = field(compare=False)
    # distances along the part, which are upper bounds, in √area of the part
    along: Float[FloatArray, "m n_part"] = field(compare=False)
    landmarks: Int[BodyVertices, "l"] = field(compare=False)  # images of the first anchors
    radii: tuple[float, ...] = field(compare=False)  # radii of ball signatures, in √area of the part
    functions: Embedding = field(compare=False)  # functions that are known on part and whole

    @classmethod
    def of(
        cls,
        part: PreparedShape,
        whole: PreparedShape,
        config: Config,
        landmarks: Int[IntArray, "l 2"] = NO_LANDMARKS,
        functions: Embedding | None = None,
    ) -> PartPair:
        """Make the pair in the unit of the files; landmarks are pairs of vertices."""
        mesh, n = part.mesh_body, PART_UNIT.n_anchors
        engine = distance_engine(mesh, part.config.engine, weld=False)
        missing = MissingRegion.of(mesh, engine, PART_UNIT.n_boundary_vertices)
        anchors = PartVertices(np.concatenate([landmarks[:, 0], part.column_vertices[:n]]))
        # The distance D(x, y) on the whole between two points of the part is unknown, but bounded.
        # A path along the part is a path on the whole, so
        #     D(x, y) ≤ d(x, y).
        # A shorter path leaves the part at a boundary point b and returns at a boundary point c, and in
        # between is not shorter than the straight line, so
        #     D(x, y) ≥ min(d(x, y), min_{b, c} d(x, b) + |b − c| + d(c, y))
        # (a criterion of Bracha, Dagès & Kimmel, Wormhole loss for partial shape matching, 2024, used as a
        # bound). If both bounds agree, D(x, y) is known.
        along = part.columns[:n].astype(np.float64)
        if len(landmarks):
            along = np.vstack([engine.distances_from(landmarks[:, 0]), along])
        unit = 1.0 if config.scale == "area" else part.scale / whole.scale
        if part.origin is None:
            lower = missing.lower_bound(anchors, np.arange(mesh.n_vertices), along)
        else:
            # Fused limbs were separated by a cut of no width. A path on the whole may cross the cut, so D is
            # at least the distance on the fused surface, whose two sides are welded at the cut.
            fused = distance_engine(mesh, part.config.engine)
            lower = np.minimum(fused.distances_from(anchors), along)
        functions = functions or SmoothPair(part, whole, config).known
        bounds, known_images = (lower, along), BodyVertices(landmarks[:, 1])
        pair = cls(part, whole, unit, config, missing, anchors, *bounds, known_images, (), functions)
        # A ball of radius r in √area of the whole has radius r / unit in √area of the part. Balls
        # of the part are integrated once, for radii from the least r / largest unit to the largest
        # r / least unit, in small steps; `signature` interpolates between these for any unit.
        units = pair.units
        first, last = RADII[0] / max(*units, PART_UNIT.max_unit), RADII[-1] / min(units)
        n_steps = round(np.log(last / first) / np.log(PART_UNIT.radius_step_ratio))
        radii = np.geomspace(first, last, 2 + n_steps)
        return replace(pair, radii=tuple(radii.tolist()))

    def with_unit(self, unit: float) -> PartPair:
        """Return the pair in another unit of the part."""
        return replace(self, unit=unit)

    @property
    def cost(self) -> IntervalCost:
        """Cost of distances on the whole."""
        # `IntervalCost` of a distance D with bounds l and u is
        #     c(D; l, u) = min(v + inside |D − u|, most) / (soft + u).
        # As most and soft are multiplied by the unit t like l and u, c(t D; t l, t u) = c(D; l, u), so costs in
        # different units can be compared.
        unit = self.unit
        return IntervalCost(most=PART_UNIT.max_distance_cost * unit, soft=PART_UNIT.short_distance * unit)

    @property
    def share(self) -> float:
        """Area of the part over the area of the whole."""
        return self.unit**2

    def intervals(self, vertices: Int[PartVertices, "q"]) -> Intervals:
        """Bounds (m, q) of distances on the whole between the anchors and some vertices."""
        return Intervals(self.lower[:, vertices] * self.unit, self.along[:, vertices] * self.unit)

    @cached_property
    def anchor_intervals(self) -> Intervals:
        """Bounds (m, m) of distances on the whole between anchors, symmetric."""
        lower, upper = self.intervals(self.anchors)
        return Intervals(np.minimum(lower, lower.T), 0.5 * (upper + upper.T))

    @cached_property
    def known_share(self) -> float:
        """Share of the pairs of anchors whose distance on the whole is known."""
        lower, upper = self.anchor_intervals
        return float((lower >= PART_UNIT.known_ratio * upper)[~np.eye(len(lower), dtype=bool)].mean())

    @property
    def is_hardly_known(self) -> bool:
        """Whether so few distances are known that no unit is sure and no map is exact."""
        return self.known_share < PART_UNIT.min_known_share

    @cached_property
    def to_boundary(self) -> Float[FloatArray, "n_part"]:
        """Distance of each vertex of the part to its boundary."""
        return self.missing.to_boundary * self.unit

    @cached_property
    def signature(self) -> BallSignature:
        """The ball signature of the part, in √area of the whole."""
        return _ball_signature_of(self.part, self.radii).scaled(self.unit, RADII)

    def stress(self, images: Int[BodyVertices, "m"]) -> float:
        """Mean cost of the images of the anchors."""
        lower, upper = self.anchor_intervals
        distances = np.maximum(self.whole.distances.between(images, images), 0.0)
        return float(self.cost(distances, lower, upper)[~np.eye(len(images), dtype=bool)].mean())

    @property
    def knows_unit(self) -> bool:
        """Whether the files have a plausible unit for a part."""
        least, most = np.sqrt(PART_UNIT.min_area_share), PART_UNIT.max_unit_ratio
        return bool(self.config.scale != "free" and least / most <= self.unit <= most)

    @cached_property
    def keeps_unit(self) -> bool:
        """Whether the settings fix the unit, or too few distances are known to measure it."""
        cannot_measure = self.config.scale == "auto" and self.is_hardly_known
        return self.config.scale in ("same", "area") or (cannot_measure and self.knows_unit)

    @property
    def units(self) -> tuple[float, ...]:
        """Units of the part in which maps are searched."""
        if self.keeps_unit:
            return (min(self.unit, 1.0),)
        # The true unit is √(area of the part / area of the whole) ≤ 1. If the files have no plausible unit,
        # it is searched from √min_area_share to 1. Otherwise the true unit is taken to differ from the unit
        # of the files by at most the factor `max_unit_ratio`, because people grow and scanners differ.
        first, last = np.sqrt(PART_UNIT.min_area_share), 1.0
        if self.knows_unit:
            first = self.unit / PART_UNIT.max_unit_ratio
            last = min(self.unit * PART_UNIT.max_unit_ratio, 1.0)
        # In a geometric series of ratio `unit_step_ratio` = 1.1, any unit is within a factor √1.1 = 1.05 of a
        # tried unit: the tolerance of `IntervalCost`. Later, `unit_of` measures the unit.
        count = 1 + max(round(np.log(last / first) / np.log(PART_UNIT.unit_step_ratio)), 0)
        return tuple(float(unit) for unit in np.geomspace(first, last, count))

    def unit_of(self, images: Int[BodyVertices, "m"]) -> float:
        """Measure the unit by images of anchors whose distances on the whole are known."""
        # The distance between two images over a known distance is the error of the unit. The median of these
        # ratios tolerates that up to half of the ratios are wrong. Short distances are mostly noise.
        lower, upper = self.anchor_intervals
        exact = (lower >= PART_UNIT.known_ratio * upper) & (upper > PART_UNIT.min_distance * self.unit)
        if exact.sum() < PART_UNIT.min_known_distances:
            return self.unit
        distances = self.whole.distances.between(images, images)
        return self.nearest_allowed_unit(self.unit * float(np.median(distances[exact] / upper[exact])))

    def in_unit_of(self, image: Int[BodyVertices, "n_part"]) -> PartPair:
        """Return the pair in the unit that a map measures, within the searched range."""
        units, unit = self.units, self.unit_of(BodyVertices(image[self.anchors]))
        return self.with_unit(float(np.clip(unit, units[0], units[-1])))

    def nearest_allowed_unit(self, unit: float) -> float:
        """Round a unit to the grid of allowed units, at most slightly above 1."""
        if self.keeps_unit:
            return self.unit
        # the unit is rounded so that maps of nearly the same unit share what is computed in it
        steps = np.round(np.log(unit / self.unit) / PART_UNIT.unit_spacing)
        return min(self.unit * float(np.exp(PART_UNIT.unit_spacing * steps)), PART_UNIT.max_unit)


@cached_method
def _ball_signature_of(part: PreparedShape, radii: tuple[float, ...]) -> BallSignature:
    """Compute the ball signature of a part, in its own √area."""
    return ball_signature(part.mesh_body, radii, unit=1.0, samples=part.sample_vertices[:N_BALLS], weld=False)


def areas_of_samples(shape: PreparedShape, samples: Int[IntArray, "q"]) -> Float[FloatArray, "q"]:
    """Area of the vertices that are nearest to each sample."""
    areas = np.bincount(nearest_of(shape, samples), shape.body.vertex_areas, len(samples))
    return np.asarray(areas, dtype=np.float64)


def shrink_to_neutral(total: FloatArray, count: IntArray, neutral: float, weight: float) -> FloatArray:
    """Mean of ``count`` known values with a total, and of a neutral value that counts ``weight`` times."""
    return np.asarray((total + neutral * weight) / (count + weight))


class PartSignatures(NamedTuple):
    """Signatures of a part, and weights from 0 at the boundary to 1 far from it."""

    values: Float[FloatArray, "n k"]
    weights: Float[FloatArray, "n k"]


@dataclass(frozen=True, eq=False)
class WholeSignatures:
    """Signatures of a whole, and comparable signatures of its parts."""

    whole: PreparedShape  # a mesh of area 1
    functions: Float[FloatArray, "n_whole q"]  # known functions, which no boundary disturbs

    @cached_property
    def _energies(self) -> FloatArray:
        values = self.whole.laplace.values[1:]
        return np.linspace(np.log(values[4]), np.log(values[min(90, len(values) - 1)]), PART_UNIT.n_energies)

    # The wave kernel signature of Aubry, Schlickewei & Cremers (ICCV Workshops 2011) is
    #     Σ_k φ_k(x)² f_e(λ_k) / Σ_k f_e(λ_k),   f_e(λ) = exp(−(e − log λ)² / 2σ²).
    # The denominator is omitted: it is a sum over the spectrum, which differs between part and whole.
    def _waves(
        self, vectors: Float[FloatArray, "n k"], values: Float[FloatArray, "k"]
    ) -> Float[FloatArray, "n 20"]:
        """Logarithms of wave signatures from eigenpairs, in units of the whole."""
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
        """Signatures of the whole; the last columns are the known functions."""
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
        """Signatures of the anchors of a part."""
        return self._of_part(pair, pair.anchors)

    def _of_part(self, pair: PartPair, vertices: Int[PartVertices, "n"]) -> PartSignatures:
        part, sizes = pair.part, pair.config.preparation.curvature_functions
        whole_values, distance = self.whole.laplace.values[1:], pair.to_boundary[vertices, None]
        waves, curvatures = self._raw
        vectors, values = part.laplace.vectors[vertices, 1:], part.laplace.values[1:]
        # If the part is scaled by the unit u, its functions φ are divided by u, as ∫ φ² = 1, eigenvalues by
        # u², and curvatures by u. By Weyl's law, λ_k ≈ 4πk / area, the part has about u² k functions up to
        # the k-th eigenvalue of the whole.
        of_part = self._waves(vectors / pair.unit, values / pair.share)
        signatures = [self._weights[0] * _standardise(of_part, waves)]
        # A function of eigenvalue λ = exp(energy) has wavelength 2π / √λ. Up to about this distance from the
        # boundary, it differs from a function of the whole. So its weight is small there:
        # 1 − exp(−(distance √λ / reach)²).
        weights = [1 - np.exp(-((distance * np.exp(self._energies / 2) / PART_UNIT.boundary_reach) ** 2))]
        for column, size in zip(curvatures.T, sizes):
            k = min(size, len(whole_values))
            k_part = int(np.clip(round(k * pair.share), 8, len(part.laplace.values) - 1))
            curvature = self._curvature_of_part(part, k_part)[vertices]
            on_whole = _standardise(column, column)
            on_part = np.clip(_standardise(curvature / pair.unit, column), on_whole.min(), on_whole.max())
            signatures.append(self._weights[1] * on_part[:, None])
            reach = PART_UNIT.curvature_boundary_reach
            weights.append(1 - np.exp(-((distance * np.sqrt(whole_values[k - 2]) / reach) ** 2)))
        functions = pair.functions.source[vertices]
        weights.append(np.ones_like(functions))
        return PartSignatures(np.hstack([*signatures, functions]), np.hstack(weights))


def _standardise(values: FloatArray, reference: FloatArray) -> FloatArray:
    """Subtract the mean of a reference and divide by its deviation, which may be 0 on a sphere."""
    return np.asarray((values - reference.mean(axis=0)) / np.maximum(reference.std(axis=0), 1e-9))
