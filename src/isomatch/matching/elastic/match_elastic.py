"""The elastic match: first maps, coarse fits of all, fine fits of the best, and the choice among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isomatch._arrays import IntArray
from isomatch._threads import parallel_map
from isomatch.correspondence import Embedding
from isomatch.matching.elastic.elastic_fit import Coefficients, ElasticFit, Images, Step
from isomatch.matching.elastic.elastic_shape import ElasticShape
from isomatch.matching.elastic.elastic_starts import anchor_starts
from isomatch.matching.pair import ShapePair


@dataclass(frozen=True, eq=False)
class _Found:
    coefficients: Coefficients
    images: Images
    score: float


@dataclass(frozen=True, eq=False)
class ElasticMatch:
    """What an elastic match found.

    Parameters
    ----------
    embedding : Embedding
        Coordinates of all vertices of both bodies, in which images are nearest points.
    score : float
        What speaks against the map: misfit × stretch × powers of curvature mismatch and asymmetry.
    rival : float
        Score of the best map that differs, over that of the best; inf if none does.
    n_tried, n_refined : int
        First maps, and those that were fitted to the end.
    """

    embedding: Embedding
    score: float
    rival: float
    n_tried: int
    n_refined: int


def match_elastically(
    pair: ShapePair, landmarks: IntArray, known: Sequence[IntArray]
) -> ElasticMatch | None:
    """Match two meshes whose distances do not agree.

    Parameters
    ----------
    pair : ShapePair
        Two meshes.
    landmarks : (l, 2) array of int
        Vertices that correspond.
    known : sequence of (q, 2) arrays of int
        Other first maps: vertices of source and target.

    Returns
    -------
    ElasticMatch or None
        None if no map keeps the orientation of the faces.
    """
    settings = pair.config.elastic
    shapes = ElasticShape(pair.source, settings), ElasticShape(pair.target, settings)

    def fit(count: int, everywhere: bool) -> ElasticFit:
        samples = [shape.sampled(count, everywhere) for shape in shapes]
        return ElasticFit(samples[0], samples[1], pair.signatures, landmarks, settings)

    coarse, fine = fit(settings.n_coarse, False), fit(pair.config.n_refine, True)
    first = Step(settings.coarse_functions[0], settings.coarse_smoothness[0], 0, True)
    steps = tuple(
        Step(k, smoothness, settings.coarse_iterations, True)
        for k, smoothness in zip(settings.coarse_functions, settings.coarse_smoothness)
    )

    def roughly(start: IntArray) -> _Found | None:
        found = coarse.from_pairs(start, first)
        if coarse.orientation(found, coarse.images(found)) < 0:
            return None
        found, images = coarse.run(found, steps)
        if coarse.orientation(found, images) < settings.least_orientation:
            return None
        return _Found(found, images, images.misfit * coarse_penalty(coarse.asymmetry(images)))

    def coarse_penalty(asymmetry: float) -> float:
        return float((settings.asymmetry_unit + asymmetry) ** settings.asymmetry_exponent)

    starts = [*anchor_starts(pair, landmarks, settings), *known]
    rough = [found for found in parallel_map(roughly, starts) if found]
    rough.sort(key=lambda found: found.score)
    kept: list[_Found] = []
    for found in rough:
        if len(kept) < settings.n_contenders and all(
            pair.target.mean_distance(
                coarse.target.targets[found.images.forth], coarse.target.targets[other.images.forth]
            )
            > settings.same_map
            for other in kept
        ):
            kept.append(found)
    if not kept:
        return None
    steps = tuple(
        Step(k, smoothness, settings.fine_iterations, k < settings.free_functions)
        for k, smoothness in zip(settings.fine_functions, settings.fine_smoothness)
    )

    def finely(start: _Found) -> _Found:
        found, images = fine.run(start.coefficients, steps)
        score = images.misfit * fine.stretch(found) * fine.curvature_mismatch(images) ** settings.curvature_exponent
        return _Found(found, images, score * coarse_penalty(fine.asymmetry(images)))

    fits = sorted(parallel_map(finely, kept), key=lambda found: found.score)
    best = fits[0]
    rivals = [
        other.score
        for other in fits[1:]
        if pair.target.mean_distance(other.images.forth, best.images.forth)
        > pair.config.selection.rival_distance
    ]
    return ElasticMatch(
        fine.embedding(best.coefficients),
        best.score,
        min(rivals, default=np.inf) / best.score,
        len(starts),
        len(fits),
    )
