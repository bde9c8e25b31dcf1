"""How good a map looks, without knowing the truth."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._arrays import IntArray
from isomatch.matching.choice import Judged
from isomatch.matching.pair import Pair
from isomatch.matching.prepare import LARGE_COMPONENT, PreparedShape
from isomatch.matching.refine import JointFit
from isomatch.matching.result import Outcome, Quality

DIFFERENT = 0.05  # mean distance in space between images, in √area, from which two refined maps are two
TIE = 1.05  # misfit of a different map, against the best, below which nothing decides between them
POOR_MISFIT, POOR_DISTORTION = 0.5, 0.1
REACH = 0.05  # a target vertex this near to an image, in √area, is covered


def quality_of(
    pair: Pair, image: IntArray, order: list[Judged], fits: list[JointFit], landmarks: IntArray | None
) -> Quality:
    """Measure a map of bodies.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    image : (n_s,) array of int
        Target body vertex of each source body vertex.
    order : list of Judged
        The winner and its rivals.
    fits : list of JointFit
        Refined winner and contenders, in the same order.
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
    landmark_error = np.nan
    if landmarks is not None:
        at_source = source.body_vertex[landmarks[:, 0]]
        landmark_error = landmark_errors(pair, np.where(at_source >= 0, image[at_source], -1), landmarks)
    return Quality(
        misfit=fits[0].misfit,
        rival_misfit=_rival(pair, fits),
        distortion_mean=float(distortion.mean()),
        distortion_p95=float(np.quantile(distortion, 0.95)),
        coverage=float(target.body.vertex_areas[gap < REACH].sum() / target.body.area),
        matched=float((source.body_vertex >= 0).mean()),
        orientation=winner.orientation,
        residual=winner.residual,
        curvature_mismatch=winner.curvature_mismatch,
        landmark_error=landmark_error,
    )


def _rival(pair: Pair, fits: list[JointFit]) -> float:
    """Misfit of the best contender that ended elsewhere, over that of the winner; inf if there is none."""
    places = pair.target.shape.body.vertices
    for fit in fits[1:]:
        apart = np.linalg.norm(places[fit.image] - places[fits[0].image], axis=1).mean()
        if apart > DIFFERENT:
            return fit.misfit / max(fits[0].misfit, 1e-12)
    return np.inf


def landmark_errors(pair: Pair, image: IntArray, landmarks: IntArray) -> float:
    """Mean geodesic distance on the target between images (m,) of landmarks and their given targets / √area."""
    wanted = pair.target.shape.body_vertex[landmarks[:, 1]]
    held = (image >= 0) & (wanted >= 0)
    apart = pair.target.shape.distances.distance(image[held], wanted[held])
    return float(np.where(image[held] == wanted[held], 0.0, np.maximum(apart, 0.0)).mean())


def outcome_of(quality: Quality, source: PreparedShape, target: PreparedShape) -> Outcome:
    """Sum up the evidence."""
    if quality.misfit > POOR_MISFIT or quality.distortion_mean > POOR_DISTORTION:
        return Outcome.LOW_CONFIDENCE
    if quality.rival_misfit < TIE:
        return Outcome.SYMMETRY_AMBIGUOUS
    if any(shape.left_out > LARGE_COMPONENT for shape in (source, target)):
        return Outcome.PARTIAL
    return Outcome.CONVERGED
