"""How good a map looks, without knowing the truth."""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch._core.arrays import BodyVertices, Bool, BoolArray, Float, FloatArray, Int, IntArray
from isomatch.correspondence import PrecisePoints, alignment_residual, signed_procrustes
from isomatch.descriptors import BallSignature, deviation_of
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.parameters import ERRORS
from isomatch.matching.problem import Problem
from isomatch.matching.result import Quality
from isomatch.matching.selection import Ranking
from isomatch.settings import COVERAGE_RADIUS
from isomatch.shapes import orientation_of
from isomatch.surfaces import Graph, Surface, label_components


def measure_quality(pair: Problem, points: PrecisePoints, ranking: Ranking[Any] | None = None) -> Quality:
    """Measure a map of bodies: ``points``, the image of each source vertex, as it was selected if it was."""
    source, target, settings = pair.source, pair.target, pair.config.outcome
    image = BodyVertices(points.corners[:, 0])
    vertices = pair.refinement_vertices
    unit = 1.0
    if any(isinstance(shape.body, Graph) for shape in (source, target)):  # no area to measure lengths by
        unit = source.intrinsic_scale / target.intrinsic_scale
    there = unit * target.distances.between(image[source.column_vertices], image[vertices])
    distortion = np.abs(source.columns[:, vertices] - there)
    aligned = source.points.at(vertices), target.points.at(image[vertices])
    positions = image_positions(source.body, target.body, points)
    landmark_error, initial_map_error = prior_errors(
        pair, image, pair.priors.landmarks, pair.priors.initial_pairs
    )
    orientation = np.nan
    if pair.oriented:
        basis = pair.spectra.source
        orientation = orientation_of(source, basis, target, image[vertices], ERRORS.n_normal_functions)
    return Quality(
        spectral_residual=ranking.best.spectral_residual if ranking else np.nan,
        runner_up=ranking.runner_up if ranking else np.nan,
        mirrored=ranking.mirrored if ranking else np.nan,
        residual=alignment_residual(*aligned, signed_procrustes(*aligned)),
        stretch=edge_stretch(source.body, positions, settings.torn),
        torn_off=torn_off_share(source.body, target.body.area, positions, settings.torn_apart),
        orientation=orientation,
        distortion_mean=float(distortion.mean()),
        distortion_p95=float(np.quantile(distortion, 0.95)),
        coverage=_coverage(pair, points),
        matched=float((source.body_vertex >= 0).mean()),
        landmark_error=landmark_error,
        initial_map_error=initial_map_error,
    )


def descriptor_distance_of(
    here: BallSignature | None,
    there: BallSignature | None,
    image: Int[IntArray, "n_s"],
    matched: Bool[BoolArray, "n_s"] | None = None,
) -> Float[FloatArray, "n_s"] | None:
    """Descriptor distance in space of each vertex and its image, nan where unknown; None without triangles."""
    if here is None or there is None:
        return None
    descriptor_distance = here.descriptor_distance(there.at(image), deviation_of(here, there))
    return descriptor_distance if matched is None else np.where(matched, descriptor_distance, np.nan)


def mean_known(values: Float[FloatArray, "q"] | None, areas: Float[FloatArray, "q"]) -> float:
    """Mean over the area of what is known of the values of vertices; nan if nothing is."""
    if values is None or not (finite := np.isfinite(values)).any():
        return np.nan
    return float(np.average(values[finite], weights=areas[finite]))


def covered_share(surface: Surface, images: Int[IntArray, "q"], radius: float = COVERAGE_RADIUS) -> float:
    """Coverage: share of the area of a surface within a radius, in √area along edges, of images."""
    if not len(images):
        return 0.0
    gap, _ = distance_along_edges_to_nearest(surface, np.unique(images))
    return float(surface.vertex_areas[gap <= radius * np.sqrt(surface.area)].sum() / surface.area)


def _coverage(pair: Problem, points: PrecisePoints) -> float:
    """Coverage of the target, or of the original of a variant, by the images of the source's own vertices."""
    source, target, radius = pair.source, pair.target, pair.config.outcome.coverage_radius
    if source.original:
        n = source.original.body.n_vertices
        points = PrecisePoints(points.corners[:n], points.barycentric[:n])
    if target.original is None:
        return covered_share(target.body, points.corners[:, 0], radius)
    points, near = target.on_original(points)
    return covered_share(target.original.body, points.corners[near, 0], radius)


def image_positions(
    source: Surface, target: Surface, points: PrecisePoints
) -> Float[FloatArray, "n_s 3"] | None:
    """Where the images of the source's vertices lie in space; None unless both surfaces have coordinates."""
    if isinstance(source, Graph) or isinstance(target, Graph):
        return None
    return np.asarray(points.interpolation(target.n_vertices) @ target.vertices)


def edge_stretch(
    source: Surface,
    images: Float[FloatArray, "n_s 3"] | None,
    torn: float,
    unit: float = 1.0,
    matched: Bool[BoolArray, "n_s"] | None = None,
) -> float:
    """Dirichlet energy of the map on edges: squared lengths of their images over their own; nan without."""
    # Σ_e min(|f(e)|², torn |e|²) / Σ_e |e|² over edges e between matched vertices; unit: worth of the source's lengths
    if isinstance(source, Graph) or images is None:
        return np.nan
    i, j = (source.edges if matched is None else source.edges[matched[source.edges].all(axis=1)]).T
    there, here = (((x[i] - x[j]) ** 2).sum(axis=1) for x in (images, unit * source.vertices))
    return float(np.minimum(there, torn * here).sum() / here.sum())


def torn_off_share(source: Surface, target_area: float, images: FloatArray | None, apart: float) -> float:
    """Share of the source's area in the largest piece that a map to ``images`` tears from the rest; nan without."""
    # an edge is torn if |f(e)| / √A_t − |e| / √A_s > apart; pieces hang together by the edges that are not
    if isinstance(source, Graph) or images is None:
        return np.nan
    i, j = source.edges.T
    both = (images, target_area), (source.vertices, source.area)
    there, here = (np.linalg.norm(x[i] - x[j], axis=1) / np.sqrt(area) for x, area in both)
    whole = there - here <= apart
    _, piece = label_components(source.n_vertices, (i[whole], j[whole]))
    shares = np.sort(np.bincount(piece, source.vertex_areas))[::-1] / source.vertex_areas.sum()
    return float(shares[1]) if len(shares) > 1 else 0.0


def distances_to_priors(
    pair: Problem, target_vertex: Int[BodyVertices, "n_s"], pairs: Int[BodyVertices, "q 2"]
) -> Float[FloatArray, "q"]:
    """Distance between the images under a map and the second vertices of pairs, in √area."""
    return pair.target.distance(target_vertex[pairs[:, 0]], pairs[:, 1])


def prior_errors(
    pair: Problem,
    target_vertex: Int[BodyVertices, "n_s"],
    landmarks: Int[BodyVertices, "m 2"],
    initial_pairs: Int[BodyVertices, "q 2"],
) -> tuple[float, float]:
    """Mean and median of these distances for landmarks and for an initial map; nan without."""
    off = distances_to_priors(pair, target_vertex, landmarks)
    off_initial = distances_to_priors(pair, target_vertex, initial_pairs)
    mean = float(off.mean()) if len(off) else np.nan
    return mean, float(np.median(off_initial)) if len(off_initial) else np.nan


def contradicted_landmarks(pair: Problem, points: PrecisePoints) -> list[str]:
    """Name the landmarks that a map of bodies contradicts, in the users' vertices; no note if it contradicts none."""
    priors = pair.priors
    apart = distances_to_priors(pair, BodyVertices(points.corners[:, 0]), priors.landmarks)
    against = np.flatnonzero(apart > pair.config.outcome.contradiction)
    if not len(against):
        return []
    worst = against[np.argsort(-apart[against], kind="stable")[: ERRORS.max_named_landmarks]]
    pairs = zip(priors.user_landmarks[worst], apart[worst])
    named = ", ".join(f"{i} → {j} ({distance:.2f} √area off)" for (i, j), distance in pairs)
    more = ", …" if len(against) > len(worst) else ""
    which = "the map" if pair.config.pin is None else "the map before it was bent"
    return [f"{which} contradicts {len(against)} of {len(priors.landmarks)} landmarks: {named}{more}"]
