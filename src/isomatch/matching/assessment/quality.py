"""Measures of a map that need no ground truth."""

from __future__ import annotations

from dataclasses import fields
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
    """Measure a map of bodies: the images ``points`` of source vertices, and its ranking."""
    source, target, settings = pair.source, pair.target, pair.config.outcome
    image = BodyVertices(points.corners[:, 0])
    vertices = pair.refinement_vertices
    unit = 1.0
    if any(isinstance(shape.body, Graph) for shape in (source, target)):  # a graph has no √area as unit
        unit = source.intrinsic_scale / target.intrinsic_scale
    of_images = unit * target.distances.between(image[source.column_vertices], image[vertices])
    distortion = np.abs(source.columns[:, vertices] - of_images)
    aligned = source.points.at(vertices), target.points.at(image[vertices])
    positions = image_positions(source.body, target.body, points)
    priors = pair.priors
    landmark_error, initial_map_error = prior_errors(pair, image, priors.landmarks, priors.initial_pairs)
    orientation = np.nan
    if pair.oriented:
        basis = pair.spectra.source
        orientation = orientation_of(source, basis, target, image[vertices], ERRORS.n_normal_functions)
    return Quality(
        spectral_residual=ranking.best.spectral_residual if ranking else np.nan,
        runner_up=ranking.runner_up if ranking else np.nan,
        mirrored=ranking.mirrored if ranking else np.nan,
        residual=alignment_residual(*aligned, signed_procrustes(*aligned)),
        stretch=edge_stretch(source.body, positions, settings.max_counted_growth),
        torn_off=torn_off_share(source.body, target.body.area, positions, settings.torn_growth),
        orientation=orientation,
        distortion_mean=float(distortion.mean()),
        distortion_p95=float(np.quantile(distortion, 0.95)),
        coverage=_coverage(pair, points),
        matched=float((source.body_vertex >= 0).mean()),
        landmark_error=landmark_error,
        initial_map_error=initial_map_error,
    )


def quality_of(**known: float) -> Quality:
    """Collect the measures of a map; those that are not given are unknown."""
    return Quality(**(dict.fromkeys((field.name for field in fields(Quality)), np.nan) | known))


def descriptor_distance_of(
    source: BallSignature | None,
    target: BallSignature | None,
    image: Int[IntArray, "n_s"],
    matched: Bool[BoolArray, "n_s"] | None = None,
) -> Float[FloatArray, "n_s"] | None:
    """Descriptor distance between each vertex and its image, nan if unknown; None without triangles."""
    if source is None or target is None:
        return None
    distance = source.descriptor_distance(target.at(image), deviation_of(source, target))
    return distance if matched is None else np.where(matched, distance, np.nan)


def mean_known(values: Float[FloatArray, "q"] | None, areas: Float[FloatArray, "q"]) -> float:
    """Mean of the known values of vertices, weighted by area; nan if none is known."""
    if values is None or not (finite := np.isfinite(values)).any():
        return np.nan
    return float(np.average(values[finite], weights=areas[finite]))


def covered_share(surface: Surface, images: Int[IntArray, "q"], radius: float = COVERAGE_RADIUS) -> float:
    """Coverage: share of the area of a surface within a radius of images, in √area along edges."""
    if not len(images):
        return 0.0
    gap, _ = distance_along_edges_to_nearest(surface, np.unique(images))
    return float(surface.vertex_areas[gap <= radius * np.sqrt(surface.area)].sum() / surface.area)


def _coverage(pair: Problem, points: PrecisePoints) -> float:
    """Share of the target that images of source vertices cover; for variants, between their originals."""
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
    """Positions of the images of source vertices; None unless both surfaces have coordinates."""
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
    """Dirichlet energy of a map: squared lengths of edges' images over their own, or nan."""
    # Let the edges e join matched vertices, and let f map them to segments between images. The stretch is
    # Σ_e min(|f(e)|², torn |e|²) / Σ_e |e|², where lengths |e| on the source are multiplied by the unit.
    if isinstance(source, Graph) or images is None:
        return np.nan
    i, j = (source.edges if matched is None else source.edges[matched[source.edges].all(axis=1)]).T
    after, before = (((x[i] - x[j]) ** 2).sum(axis=1) for x in (images, unit * source.vertices))
    return float(np.minimum(after, torn * before).sum() / before.sum())


def torn_off_share(
    source: Surface, target_area: float, images: FloatArray | None, max_growth: float
) -> float:
    """Share of the area in the largest piece that a map tears from the rest, or nan."""
    # An edge e with image f(e) is torn if |f(e)| / √(area of the target) − |e| / √(area of the source) >
    # max_growth. A piece is connected by edges that are not torn.
    if isinstance(source, Graph) or images is None:
        return np.nan
    i, j = source.edges.T
    both = (images, target_area), (source.vertices, source.area)
    after, before = (np.linalg.norm(x[i] - x[j], axis=1) / np.sqrt(area) for x, area in both)
    whole = after - before <= max_growth
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
    """Mean distance of images from the targets of landmarks, and median from the initial map; nan without them."""
    errors = distances_to_priors(pair, target_vertex, landmarks)
    initial_errors = distances_to_priors(pair, target_vertex, initial_pairs)
    mean = float(errors.mean()) if len(errors) else np.nan
    return mean, float(np.median(initial_errors)) if len(initial_errors) else np.nan


def contradicted_landmarks(pair: Problem, points: PrecisePoints) -> list[str]:
    """Make a note on the landmarks that a map contradicts, in the users' vertices."""
    priors = pair.priors
    errors = distances_to_priors(pair, BodyVertices(points.corners[:, 0]), priors.landmarks)
    contradicted = np.flatnonzero(errors > pair.config.outcome.contradiction)
    if not len(contradicted):
        return []
    worst = contradicted[np.argsort(-errors[contradicted], kind="stable")[: ERRORS.max_named_landmarks]]
    pairs = zip(priors.user_landmarks[worst], errors[worst])
    named = ", ".join(f"{i} → {j} ({error:.2f} √area off)" for (i, j), error in pairs)
    more = ", …" if len(contradicted) > len(worst) else ""
    which = "the map" if pair.config.pin is None else "the map before it was bent"
    return [f"{which} contradicts {len(contradicted)} of {len(priors.landmarks)} landmarks: {named}{more}"]
