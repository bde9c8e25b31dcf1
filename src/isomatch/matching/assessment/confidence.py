"""Expected errors of the images of vertices, and regions where a map is doubtful."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray, SampleRows, single
from isomatch._core.compiled import compiled
from isomatch._core.errors import InputError
from isomatch._core.threads import row_product
from isomatch.correspondence import UNMATCHED, PrecisePoints
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.coordinates import SmoothPair
from isomatch.matching.parameters import ERRORS
from isomatch.matching.problem import Problem
from isomatch.shapes import PreparedShape, SmoothShape
from isomatch.surfaces import connected_regions

# √area for lengths, 1 / area for squared slopes; lower values are raised to this before they divide; chosen
MIN_LENGTH = 1e-12


def expected_errors(
    pair: SmoothPair, points: PrecisePoints, doubt: Float[FloatArray, "n_s"] | None = None, unit: float = 1.0
) -> Float[FloatArray, "n_s"]:
    """Estimate the geodesic error of a map at each vertex, in √area of the source. O(n K²).

    ``doubt`` is added to the estimate: the error expected because another map may be right. ``unit`` is what √area of
    the source is worth in √area of the target, 1 except for parts. If a map is wrong as a whole, for example exchanges
    left and right, the estimate covers only what does not fit.
    """
    # Let Φ_s, Φ_t be K Laplace–Beltrami functions of both shapes, and f the map. The smooth part of Φ_t ∘ f
    # is the fit Φ_s F. For an isometry, Φ_t ∘ f = Φ_s F, and F is orthogonal. If the image of vertex i is
    # displaced by δ(i), the residual r(i) = Φ_t(f(i)) − Φ_s(i) F has, to first order, the size |∇(Φ_s F)|
    # δ(i). So
    #   δ(i) = ‖r(i)‖ / |∇(Φ_s F)|               is a length,
    #   ε(i) = log(|∇(Φ_s F)|² / |∇Φ_s|²)        is a strain, 0 if F is orthogonal,
    # and the expected error is error_scale · √(δ |ε|), smoothed by the heat kernel: lab/benchmarks.md,
    # confidence.
    source = pair.source
    k = pair.n_functions
    functions = source.functions[:, :k]
    pulled_back = single(points.interpolated(pair.target.functions[:, :k]))
    coefficients = pair.spectra.source.fit(pulled_back[pair.refinement_vertices].astype(np.float64), k)
    fit = row_product(functions, coefficients)
    lengths = np.maximum(source.body.edge_lengths, MIN_LENGTH)
    slopes_fit, slopes = (_squared_slopes(x, source.body.edges, lengths) for x in (fit, functions))
    slopes_fit, slopes = np.maximum(slopes_fit, MIN_LENGTH), np.maximum(unit**2 * slopes, MIN_LENGTH)
    displacement = np.sqrt(((pulled_back - fit) ** 2).sum(axis=1) / slopes_fit)
    local = ERRORS.error_scale * np.sqrt(displacement * np.abs(np.log(slopes_fit / slopes)))
    return diffuse(source, local if doubt is None else local + doubt, ERRORS.smoothing_radius)


def doubt_of(
    pair: Problem, image: Int[BodyVertices, "r"], runner_up: Int[BodyVertices, "r"], ratio: float
) -> Float[FloatArray, "n_s"]:
    """Distance between two maps that tie, times the chance that the other is right, in √area."""
    # If the probability of a map is proportional to score^−10, the other map, with ``ratio`` times the score,
    # has the chance 1 / (1 + ratio^10), which is ½ at a tie.
    chance = 1 / (1 + ratio**ERRORS.runner_up_exponent)
    rows = nearest_of(pair.source, pair.refinement_vertices)
    return np.asarray(chance * pair.target.distance(image, runner_up)[rows])


def nearest_of(shape: SmoothShape, vertices: Int[IntArray, "m"]) -> Int[SampleRows, "n_body"]:
    """For each vertex of a body, find the number of the nearest of given vertices along edges."""
    number = np.zeros(shape.body.n_vertices, dtype=np.int64)
    number[vertices] = np.arange(len(vertices))
    return SampleRows(number[distance_along_edges_to_nearest(shape.body, vertices)[1]])


def _squared_slopes(
    x: Float[FloatArray, "n k"], edges: Int[IntArray, "e 2"], lengths: Float[FloatArray, "e"]
) -> Float[FloatArray, "n"]:
    """Sum the squared slopes of all functions along an edge, and average the sums over the edges at each vertex."""
    squared = np.zeros(len(edges))
    _fill_squared(x, edges, squared)
    ends = edges.ravel()
    total = np.bincount(ends, np.repeat(squared / lengths**2, 2), len(x))
    return np.asarray(total / np.maximum(np.bincount(ends, minlength=len(x)), 1))


@compiled()
def _fill_squared(x: FloatArray, edges: IntArray, squared: FloatArray) -> None:
    """Sum squared differences of all functions between the ends of each edge, without a copy."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        for c in range(x.shape[1]):
            step = np.float64(x[i, c] - x[j, c])
            squared[e] += step * step


def diffuse(shape: SmoothShape, values: Float[FloatArray, "n"], radius: float) -> Float[FloatArray, "n"]:
    """Smooth values by heat diffusion over a radius; results below half the least value are raised to it."""
    # u_t = Σ_j e^{−t λ_j} ⟨φ_j, u⟩ φ_j solves the heat equation. In the plane, heat spreads in the time t to
    # a mean square distance of 4 t, so t is radius² / 4.
    laplace, time = shape.laplace, radius**2 / 4
    coefficients = np.exp(-time * laplace.values) * laplace.coefficients(values[:, None])[:, 0]
    return np.asarray(np.maximum(laplace.vectors @ coefficients, 0.5 * values.min()))


# first reason why a region is doubtful, as notes say it
ANOTHER_MAP = "another map that fits nearly as well sends it elsewhere"
UNLIKE_ITS_IMAGE = "it looks unlike its image"  # second reason why a region is doubtful


@dataclass(frozen=True, eq=False)
class DoubtfulRegion:
    """A connected region of the source where the map may be wrong.

    Parameters
    ----------
    vertices : (m,) array of int
        Source vertices of the region, the most doubtful first.
    area : float
        Share of the source's area.
    reason : str
    runner_up : (m,) array of int, optional
        Target vertices to which another map sends them, if that map is the reason.
    """

    vertices: Int[IntArray, "m"]
    area: float
    reason: str
    runner_up: Int[IntArray, "m"] | None = None

    def __repr__(self) -> str:
        return f"DoubtfulRegion({self})"

    def __str__(self) -> str:
        return f"{self.area:.1%} of the area around vertex {self.vertices[0]}: {self.reason}"

    def to_dict(self) -> dict[str, Any]:
        """Return area, size, reason, and the most doubtful vertex with its other image."""
        return {
            "area": self.area,
            "n_vertices": len(self.vertices),
            "vertex": int(self.vertices[0]),
            "runner_up": None if self.runner_up is None else int(self.runner_up[0]),
            "reason": self.reason,
        }

    @classmethod
    def from_dict(cls, summary: Mapping[str, Any]) -> DoubtfulRegion:
        """Restore a region from ``to_dict``, with its most doubtful vertex only."""
        vertex, other = summary["vertex"], summary["runner_up"]
        runner_up = None if other is None else np.array([other])
        return cls(np.array([vertex]), summary["area"], summary["reason"], runner_up)


def regions_of_doubt(
    pair: Problem,
    descriptor_distance: Float[FloatArray, "n_s"] | None = None,  # between each vertex and its image
    tied_images: tuple[Int[BodyVertices, "r"], Int[BodyVertices, "r"]] | None = None,  # under tied maps
) -> tuple[DoubtfulRegion, ...]:
    """Find the connected regions of the source's body where a map is doubtful, largest first."""
    source, target, bounds = pair.source, pair.target, pair.config.outcome
    doubts, runner_up = {}, None  # doubt of each vertex, for each reason; above 1, a vertex is doubtful
    if tied_images is not None:
        image, runner_up = (x[nearest_of(source, pair.refinement_vertices)] for x in tied_images)
        doubts[ANOTHER_MAP] = target.distance(image, runner_up) / pair.config.selection.runner_up_distance
    if descriptor_distance is not None and np.isfinite(descriptor_distance[pair.refinement_vertices]).any():
        # the median is subtracted, because two people look different everywhere, two poses do not
        usual = np.nanmedian(descriptor_distance[pair.refinement_vertices])
        excess = average_around(source, descriptor_distance) - usual
        doubts[UNLIKE_ITS_IMAGE] = np.nan_to_num(excess / bounds.doubtful_descriptor_distance)
    if not doubts:
        return ()
    body, greatest = source.body, np.max(list(doubts.values()), axis=0)
    regions = []
    for vertices, area in connected_regions(body.edges, greatest > 1.0, body.vertex_areas):
        share = float(source.share * area / body.vertex_areas.sum())
        if share <= ERRORS.min_region_area:
            break
        vertices = vertices[np.argsort(-greatest[vertices], kind="stable")]
        held = {reason: (doubt[vertices] > 1.0).mean() for reason, doubt in doubts.items()}
        reasons = [reason for reason in held if held[reason] > ERRORS.min_reason_share]
        images = runner_up[vertices] if runner_up is not None and ANOTHER_MAP in reasons else None
        regions.append(DoubtfulRegion(vertices, share, " and ".join(reasons), images))
    return tuple(regions)


def average_around(shape: PreparedShape, values: Float[FloatArray, "n"]) -> Float[FloatArray, "n"]:
    """Average values in the neighbourhood of each vertex of a body; nan where most are unknown."""
    finite = np.isfinite(values)
    total = diffuse(shape, np.where(finite, values, 0.0), ERRORS.smoothing_radius)
    weight = diffuse(shape, finite.astype(float), ERRORS.smoothing_radius)
    least = ERRORS.min_known_share
    return np.where(weight > least, total / np.maximum(weight, least), np.nan)


def lift_regions(
    regions: Iterable[DoubtfulRegion], source: PreparedShape, target: PreparedShape
) -> tuple[DoubtfulRegion, ...]:
    """Carry regions of the bodies to the users' vertices."""
    carried = []
    for region in regions:
        rank = np.full(source.body.n_vertices, -1)
        rank[region.vertices] = np.arange(len(region.vertices))
        ranks = source.lift(rank, -1)
        vertices = np.flatnonzero(ranks >= 0)
        vertices = vertices[np.argsort(ranks[vertices], kind="stable")]
        images = region.runner_up
        runner_up = None if images is None else target.user_vertex[images[ranks[vertices]]]
        if len(vertices):
            carried.append(replace(region, vertices=vertices, runner_up=runner_up))
    return tuple(carried)


def doubt_in(regions: Sequence[DoubtfulRegion], n_vertices: int) -> Float[FloatArray, "n"]:
    """Compute the expected error of the vertices of a body that look unlike their images."""
    doubt = np.zeros(n_vertices)
    for region in regions:
        if UNLIKE_ITS_IMAGE in region.reason:
            doubt[region.vertices] = ERRORS.unlike_error * np.sqrt(region.area)
    return doubt


def pack_regions(regions: Sequence[DoubtfulRegion]) -> dict[str, IntArray]:
    """Make arrays for a file: sizes (r,), concatenated vertices and runners-up (d,), or −1."""
    vertices = [region.vertices for region in regions]
    nowhere = (np.full(len(region.vertices), UNMATCHED) for region in regions)
    runners_up = [none if r.runner_up is None else r.runner_up for r, none in zip(regions, nowhere)]
    nothing = np.zeros(0, dtype=np.int64)
    return {
        "region_sizes": np.array(list(map(len, vertices)), dtype=np.int64),
        "region_vertices": np.concatenate([nothing, *vertices]),
        "region_runners_up": np.concatenate([nothing, *runners_up]),
    }


def unpack_regions(arrays: dict[str, Any], about: Sequence[tuple[float, str]]) -> tuple[DoubtfulRegion, ...]:
    """Take regions out of the arrays of a file; files of early versions have no regions."""
    if "region_sizes" not in arrays:
        return ()
    ends = np.cumsum(arrays.pop("region_sizes"))
    stacked = [arrays.pop(f"region_{name}") for name in ("vertices", "runners_up")]
    if (np.diff(ends, prepend=0) < 1).any() or ends[-1:].sum() != len(stacked[0]):
        raise InputError(f"regions that end at {ends.tolist()} of {len(stacked[0])} vertices")
    vertices, runners_up = (np.split(array, ends)[:-1] for array in stacked)
    return tuple(
        DoubtfulRegion(which, area, reason, runner_up if (runner_up != UNMATCHED).any() else None)
        for which, runner_up, (area, reason) in zip(vertices, runners_up, about, strict=True)
    )
