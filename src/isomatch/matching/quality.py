"""How good a map looks, without knowing the truth."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._arrays import IntArray
from isomatch.matching.choice import Judged
from isomatch.matching.pair import Pair
from isomatch.matching.prepare import LARGE_COMPONENT, PreparedShape
from isomatch.matching.result import Outcome, Quality

REACH = 0.05  # a target vertex this near to an image, in √area, is covered


def quality_of(pair: Pair, image: IntArray, order: list[Judged], landmarks: IntArray | None) -> Quality:
    """Measure a map of bodies.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    image : (n_s,) array of int
        Target body vertex of each source body vertex.
    order : list of Judged
        The winner and its rivals.
    landmarks : (m, 2) array of int, optional
        Given pairs, in the users' indices.
    """
    source, target = pair.source.shape, pair.target.shape
    rows = pair.source.rows
    distortion = np.abs(
        source.columns[:, rows] - target.distances.distance(image[source.samples][:, None], image[rows])
    )
    gap, _ = cKDTree(target.body.vertices[np.unique(image)]).query(target.body.vertices)
    winner = order[0]
    rivals = [j.energy for j in order[1:] if j.orientation * winner.orientation > 0]
    landmark_error = np.nan
    if landmarks is not None:
        at_source = source.body_vertex[landmarks[:, 0]]
        landmark_error = landmark_errors(pair, np.where(at_source >= 0, image[at_source], -1), landmarks)
    return Quality(
        distortion_mean=float(distortion.mean()),
        distortion_p95=float(np.quantile(distortion, 0.95)),
        coverage=float(target.body.vertex_areas[gap < REACH].sum() / target.body.area),
        matched=float((source.body_vertex >= 0).mean()),
        orientation=winner.orientation,
        residual=winner.residual,
        curvature_mismatch=winner.curvature_mismatch,
        energy_ratio=min(rivals) / winner.energy if rivals and winner.energy > 0 else np.inf,
        landmark_error=landmark_error,
    )


def landmark_errors(pair: Pair, image: IntArray, landmarks: IntArray) -> float:
    """Mean geodesic distance on the target between images (m,) of landmarks and their given targets / √area."""
    wanted = pair.target.shape.body_vertex[landmarks[:, 1]]
    held = (image >= 0) & (wanted >= 0)
    apart = pair.target.shape.distances.distance(image[held], wanted[held])
    return float(np.where(image[held] == wanted[held], 0.0, np.maximum(apart, 0.0)).mean())


def outcome_of(
    quality: Quality,
    order: list[Judged],
    notes: tuple[str, ...],
    source: PreparedShape,
    target: PreparedShape,
) -> Outcome:
    """Sum up the evidence."""
    if quality.energy_ratio < 1.05:
        return Outcome.SYMMETRY_AMBIGUOUS
    if quality.distortion_mean > 0.1 or quality.curvature_mismatch > 0.9:
        return Outcome.LOW_CONFIDENCE
    if any(shape.left_out > LARGE_COMPONENT for shape in (source, target)):
        return Outcome.PARTIAL
    return Outcome.CONVERGED
