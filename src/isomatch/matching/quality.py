"""How good a map looks, without knowing the truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from isomatch._arrays import IntArray
from isomatch.matching.alignment import orthogonal_alignment, residual
from isomatch.matching.choice import orientation_of
from isomatch.matching.config import Orientation
from isomatch.matching.features import nearest_along_edges
from isomatch.matching.pair import Glimpse, Pair
from isomatch.matching.prepare import LARGE_COMPONENT, PreparedShape
from isomatch.matching.refine import JointFit, differ, score_of
from isomatch.matching.result import Outcome, Quality
from isomatch.surfaces import Graph, Surface

REACH = 0.05  # a target vertex this near to an image along edges, in √area, is covered
SMOOTH = 60  # functions of the surfaces whose normals are compared
RIVAL = 0.15  # mean distance between images, in √area, from which a map is another one, not a variant of it
TIE = 1.05  # score of a different map, against that returned, below which nothing decides between them
MIRROR_TIE = (
    1.5  # the same for a map of the other side, where either is allowed: poses alone may differ as much
)
# Where the evidence speaks against a map on its own: right maps of noisy scans, and of limbs that stretch, stay below
POOR_MISFIT, POOR_RESIDUAL, POOR_STRETCH, POOR_ORIENTATION = 0.66, 0.38, 1.3, 0.65


def quality_of(
    pair: Pair,
    image: IntArray,
    pull_back: csr_array,
    fits: list[JointFit],
    landmarks: IntArray | None,
) -> Quality:
    """Measure a map of bodies.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    image : (n_s,) array of int
        Target body vertex of each source body vertex.
    pull_back : (n_s, n_t) sparse array
        The precise map, as the matrix that interpolates at the images.
    fits : list of JointFit
        Refined winner, then its rivals, best first; none for a map found otherwise.
    landmarks : (m, 2) array of int, optional
        Given pairs, in the users' indices.
    """
    source, target = pair.source.shape, pair.target.shape
    rows = source.spread[: source.config.n_refine]
    unit = 1.0
    if any(
        isinstance(shape.body, Graph) for shape in (source, target)
    ):  # which has no area to measure lengths by
        unit = source.intrinsic_scale / target.intrinsic_scale
    there = unit * target.distances.between(image[source.samples], image[rows])
    distortion = np.abs(source.columns[:, rows] - there)
    gap, _ = nearest_along_edges(target.body, np.unique(image))
    at_target, at_source = target.cloud.at(image[rows]), source.cloud.at(rows)
    landmark_error = np.nan
    if landmarks is not None:
        on_body = source.body_vertex[landmarks[:, 0]]
        landmark_error = landmark_errors(pair, np.where(on_body >= 0, image[on_body], -1), landmarks)
    return Quality(
        misfit=fits[0].misfit if fits else np.nan,
        rival=_rival(pair, fits, lambda fit: differ(pair, fit, fits[0], RIVAL)),
        mirrored=_rival(pair, fits, lambda fit: fit.side != fits[0].side),
        residual=residual(at_target, at_source, orthogonal_alignment(at_target, at_source)),
        stretch=_stretch(source.body, target.body, pull_back),
        orientation=orientation_of(Glimpse(source, rows), target, image[rows], SMOOTH)
        if pair.sided
        else np.nan,
        distortion_mean=float(distortion.mean()),
        distortion_p95=float(np.quantile(distortion, 0.95)),
        coverage=float(target.body.vertex_areas[gap < REACH].sum() / target.body.area),
        matched=float((source.body_vertex >= 0).mean()),
        landmark_error=landmark_error,
    )


def _stretch(source: Surface, target: Surface, pull_back: csr_array) -> float:
    """Dirichlet energy of the map on edges: squared lengths of their images over their own; nan without coordinates."""
    if isinstance(source, Graph) or isinstance(target, Graph):
        return np.nan
    i, j = source.edges.T
    points = pull_back @ target.vertices
    images, lengths = (((x[i] - x[j]) ** 2).sum() for x in (points, source.vertices))
    return float(images / lengths)


def _rival(pair: Pair, fits: list[JointFit], is_rival: Callable[[JointFit], bool]) -> float:
    """Score of the best rival over that of the winner; inf if there is none, nan if there is no winner either."""
    if not fits:
        return np.nan
    rivals = [score_of(pair, fit) for fit in fits[1:] if is_rival(fit)]
    return rivals[0] / max(score_of(pair, fits[0]), 1e-12) if rivals else np.inf


def landmark_errors(pair: Pair, image: IntArray, landmarks: IntArray) -> float:
    """Mean geodesic distance on the target between images (m,) of landmarks and their given targets / √area."""
    wanted = pair.target.shape.body_vertex[landmarks[:, 1]]
    held = (image >= 0) & (wanted >= 0)
    return pair.target.shape.mean_distance(image[held], wanted[held])


def outcome_of(
    quality: Quality, source: PreparedShape, target: PreparedShape, wanted: Orientation, hinted: bool = False
) -> Outcome:
    """Sum up the evidence; hints may have led to the side that was not wanted."""
    kept = {"preserve": 1.0, "reverse": -1.0, "any": np.sign(quality.orientation)}[
        wanted
    ] * quality.orientation
    turned = hinted and kept < -POOR_ORIENTATION
    poor = (
        quality.misfit > POOR_MISFIT
        or quality.residual > POOR_RESIDUAL
        or quality.stretch > POOR_STRETCH
        or (kept < POOR_ORIENTATION and not turned)
        or quality.rival < 1.0
    )
    if poor:
        return Outcome.LOW_CONFIDENCE
    if quality.rival < TIE or quality.mirrored < MIRROR_TIE or turned:
        return Outcome.SYMMETRY_AMBIGUOUS
    if any(shape.left_out > LARGE_COMPONENT for shape in (source, target)):
        return Outcome.PARTIAL
    return Outcome.CONVERGED
