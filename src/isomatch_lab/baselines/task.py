"""The task of a baseline: from two prepared shapes and checked priors to a `MatchResult`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.stage_timer import StageTimer
from isomatch.correspondence import Embedding, SpectralPair, fit_functional_map
from isomatch.io import SurfaceLike
from isomatch.matching import (
    MatchResult,
    Priors,
    Problem,
    Solution,
    contradicted_landmarks,
    expected_errors,
    measure_quality,
    measured_evidence,
    prepare_pair,
    result_of,
)
from isomatch.settings import Config, MatchSettings
from isomatch.shapes import PreparedShape

NOT_JUDGED = "a baseline tries no other map: there is no spectral residual or runner-up, and symmetric maps go unnoticed"


AT_FULL_RESOLUTION = Config(resolution="full", n_functions=200)  # settings of Melzi et al. 2019


@dataclass(frozen=True, eq=False)
class Task:
    """Two prepared shapes, and the priors about their map."""

    pair: Problem  # the two shapes, with landmarks and maps that the user gave
    seed: int
    timer: StageTimer = field(repr=False)

    @classmethod
    def of(
        cls,
        source: SurfaceLike | PreparedShape,
        target: SurfaceLike | PreparedShape,
        landmarks: ArrayLike | None,
        initial_map: ArrayLike | None,
        initial_descriptors: tuple[ArrayLike, ArrayLike] | None,
        seed: int,
    ) -> Self:
        """Prepare the shapes that are not prepared yet, and check the priors as `match` does."""
        timer = StageTimer()
        timer.start("prepare")
        prepared = any(isinstance(shape, PreparedShape) for shape in (source, target))
        pair = prepare_pair(source, target, None if prepared else AT_FULL_RESOLUTION, seed)
        priors = Priors.of(pair.source, pair.target, landmarks, initial_map, initial_descriptors)
        return cls(replace(pair, priors=priors), seed, timer)

    @property
    def priors(self) -> Priors:
        """What the user gave, in vertices of the bodies."""
        return self.pair.priors

    @property
    def shapes(self) -> tuple[PreparedShape, PreparedShape]:
        """Source and target."""
        return self.pair.source, self.pair.target

    @property
    def spectra(self) -> SpectralPair:
        """Their Laplace–Beltrami bases."""
        return self.pair.spectra

    def functions_at_most(self, wanted: int) -> int:
        """Return a number of Laplace–Beltrami functions: the one wanted, but no more than both shapes have."""
        return min(wanted, self.pair.n_functions)

    def functional_map_at(self, points: IntArray, k: int) -> FloatArray:
        """Fit a functional map of the first k functions to corresponding vertices (q, 2), source and target."""
        return self.functional_map_from(points[:, 0], self.pair.target.laplace.vectors[points[:, 1], :k])

    def functional_map_from(self, source_vertex: IntArray, target_functions: FloatArray) -> FloatArray:
        """Fit a functional map to values (q, k) of the target's first k functions at the images of source vertices."""
        k = target_functions.shape[1]
        return fit_functional_map(self.pair.source.laplace.vectors[source_vertex, :k], target_functions)

    def orthogonal_icp(self, functional_map: FloatArray, k: int, steps: int) -> FloatArray:
        """Refine by iterative closest points in the spectral domain, see `SpectralPair.orthogonal_icp`."""
        return self.spectra.orthogonal_icp(functional_map, k, steps, self.pair.source.laplace.weights)

    def spectral_result(self, functional_map: FloatArray, config: MatchSettings, origin: str) -> MatchResult:
        """Make the result in which images are nearest points in the spectral domain under a functional map."""
        return self.result(self.spectra.embedding(functional_map), config, origin)

    def result(self, embedding: Embedding, config: MatchSettings, origin: str) -> MatchResult:
        """Map every source vertex to the nearest point of the target in a common space, and measure as `match` does."""
        source, target = self.shapes
        self.timer.start("points")
        points = target.index.points(embedding.target, embedding.source)
        self.timer.start("quality")
        quality = measure_quality(self.pair, points)
        solution = Solution(
            self.pair,
            source.correspondence(target, points),
            quality,
            (measured_evidence(self.pair, quality, config.orientation, self.priors.any),),
            source.lift_smooth(expected_errors(self.pair, points)),
            notes=(
                *self.pair.notes,
                *self.priors.notes,
                NOT_JUDGED,
                *contradicted_landmarks(self.pair, points),
            ),
            origin=origin,
            config=config,
        )
        return result_of(solution, self.timer, self.seed)
