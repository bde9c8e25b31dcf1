"""The elastic match: first maps, coarse fits of all, fine fits of the best, and the choice among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from isomatch.correspondence import Embedding
from isomatch.matching.elastic.elastic_fit import Coefficients, ElasticFit, Images, Step, coarse_steps
from isomatch.matching.elastic.elastic_starts import anchor_starts
from isomatch.matching.elastic.mirror import with_mirror
from isomatch.matching.pair import ShapePair
from isomatch.runtime.threads import parallel_map
from isomatch.settings import ElasticSettings
from isomatch.values.arrays import IntArray


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
    rival : float
        Score of the best map that differs, over that of the best; inf if none does.
    reason : str
        One sentence.
    """

    embedding: Embedding
    rival: float
    reason: str


def match_elastically(
    pair: ShapePair, landmarks: IntArray, ordinary: IntArray, others: Sequence[IntArray]
) -> ElasticMatch | None:
    """Match two meshes whose distances do not agree.

    Parameters
    ----------
    pair : ShapePair
        Two meshes.
    landmarks : (l, 2) array of int
        Vertices of source and target that correspond.
    ordinary : (q, 2) array of int
        The map found otherwise, as vertices of source and target.
    others : sequence of (q, 2) arrays of int
        Further first maps.

    Returns
    -------
    ElasticMatch or None
        None if the ordinary map scores best.

    Notes
    -----
    Maps are scored by misfit × a small power of the stretch, see `ElasticFit`; normals, which a map that turns a body
    over fits as well, take no part. The ordinary map is scored as it is, drawn by as many functions.
    """
    search = _Search(pair, landmarks)
    source, target = search.shapes
    back = anchor_starts(
        ShapePair(pair.target, pair.source, pair.config), landmarks[:, ::-1], (target, source)
    )
    forth = anchor_starts(pair, landmarks, (source, target))
    starts = [*forth, *(start[:, ::-1] for start in back), ordinary, *others]
    rough = [found for found in parallel_map(search.roughly, starts) if found]
    rough.sort(key=lambda found: found.score)
    fits = sorted(parallel_map(search.finely, search.distinct(rough)), key=lambda found: found.score)
    if not fits or fits[0].score >= search.unchanged(ordinary).score:
        return None
    best = fits[0]
    apart = pair.config.selection.rival_distance
    rivals = [
        found.score
        for found in fits[1:]
        if pair.target.mean_distance(found.images.forth, best.images.forth) > apart
    ]
    rival = min(rivals, default=np.inf) / best.score
    return ElasticMatch(
        search.fine.embedding(best.coefficients),
        rival,
        f"least score of {len(starts)} elastic maps, {len(fits)} fitted to the end",
    )


class _Search:
    """Fits first maps coarsely, among few samples, and then finely, among all vertices."""

    def __init__(self, pair: ShapePair, landmarks: IntArray) -> None:
        self._pair, self._settings = pair, pair.config.elastic
        source, target = parallel_map(
            lambda shape: with_mirror(shape, pair.config), (pair.source, pair.target)
        )
        self.shapes = source, target

        def fit(count: int, everywhere: bool, settings: ElasticSettings) -> ElasticFit:
            first, second = (shape.sampled(count, everywhere) for shape in self.shapes)
            return ElasticFit(first, second, pair.signatures, landmarks, settings)

        settings = self._settings
        self.coarse = fit(settings.n_coarse, False, settings)
        self.fine = fit(
            pair.config.n_refine, True, replace(settings, normal_weight=settings.fine_normal_weight)
        )
        self._judge = replace(
            self.fine, settings=replace(settings, normal_weight=settings.score_normal_weight)
        )
        self._coarse_steps = coarse_steps(settings)
        self._fine_steps = tuple(
            Step(k, smoothness, settings.fine_iterations, k < settings.free_functions)
            for k, smoothness in zip(settings.fine_functions, settings.fine_smoothness)
        )

    def roughly(self, start: IntArray) -> _Found | None:
        """Fit a first map (q, 2) with few functions; None if it reverses the orientation, or is twisted."""
        coarse, settings = self.coarse, self._settings
        found = coarse.from_pairs(start, self._coarse_steps[0])
        if coarse.orientation(found, coarse.images(found)) < 0:
            return None
        found, images = coarse.run(found, self._coarse_steps)
        if coarse.orientation(found, images) < settings.least_orientation:
            return None
        penalty = (settings.asymmetry_unit + coarse.asymmetry(images)) ** settings.asymmetry_exponent
        return _Found(found, images, images.misfit * penalty)

    def distinct(self, order: list[_Found]) -> list[_Found]:
        """Keep the first ones that differ from each other."""
        settings, kept = self._settings, list[_Found]()

        def vertices(found: _Found) -> IntArray:
            return self.coarse.target.targets[found.images.forth]

        for found in order:
            if len(kept) < settings.n_contenders and all(
                self._pair.target.mean_distance(vertices(found), vertices(other)) > settings.same_map
                for other in kept
            ):
                kept.append(found)
        return kept

    def finely(self, start: _Found) -> _Found:
        """Fit with all functions."""
        return self._scored(*self.fine.run(start.coefficients, self._fine_steps))

    def unchanged(self, ordinary: IntArray) -> _Found:
        """Score a map (q, 2) as it is."""
        found = self.fine.from_pairs(ordinary, self._fine_steps[-1])
        return self._scored(found, self.fine.images(found))

    def _scored(self, found: Coefficients, images: Images) -> _Found:
        misfit, stretch = self._judge.images(found).misfit, self._judge.stretch(found)
        return _Found(found, images, misfit * stretch**self._settings.stretch_exponent)
