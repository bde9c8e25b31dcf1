"""The inverse of an isometry, in the coordinates in which that was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from isomatch._core.arrays import BodyVertices
from isomatch._core.stage_timer import StageTimer
from isomatch.correspondence import Embedding
from isomatch.matching.assessment.evidence import Measured
from isomatch.matching.coordinates import SmoothPair
from isomatch.matching.isometric.isometry import IsometricMatch, Isometry
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.model import Proposals
from isomatch.matching.problem import Problem
from isomatch.matching.selection import Ranking


class Inverse(Isometry):
    """The map back of an isometry: images are nearest points in the same coordinates.

    Parameters
    ----------
    problem : Problem
        The problem in the other direction.
    hypotheses : sequence of Candidate
        The map and its alternatives, turned around, the map first; they are only listed.
    found : Match
        The match of the isometry, whose lead over other maps holds for the inverse.
    """

    def __init__(self, problem: Problem, hypotheses: Sequence[Candidate], found: IsometricMatch) -> None:
        super().__init__(problem, hypotheses)
        self.found, self._alignment = found, hypotheses[0].alignment

    def propose(self, timer: StageTimer) -> Proposals[Fit]:
        """List the alternatives; nothing is left to refine."""
        return replace(super().propose(timer), contenders=(), rivals=())

    def rank(
        self, maps: list[Fit], rivals: list[Fit], proposals: Proposals[Fit], timer: StageTimer
    ) -> Ranking[Fit]:
        """Take the nearest points, and measure them."""
        known, (of_source, of_target) = self.found.ranking, self._turned(self.found.coordinates)
        image = BodyVertices(self.target.index.vertices(of_target, of_source[self.vertices]))
        candidate = next(c for c in proposals.eligible if c.alignment is self._alignment)
        first = replace(known.best, candidate=candidate)
        return Ranking(self.measure_fit(first, image), (), known.runner_up, known.mirrored)

    def coordinates(self, best: Fit) -> Embedding:
        """Coordinates of all vertices in which images are nearest points."""
        return self._turned(self.found.coordinates)

    def polish(self, match: IsometricMatch) -> tuple[SmoothPair, Embedding]:
        """Return the finer level, and the coordinates there."""
        return self.pair.polishable, self._turned(self.found.polished[1])

    def measure(self, match: IsometricMatch) -> Measured:
        """Measure the map; nothing was compared."""
        return replace(
            super().measure(match), reason="nearest points in the coordinates of the other direction"
        )

    def find_symmetric_rivals(self, map_: Measured) -> list[Candidate]:
        """Return none, as none was found in the first direction."""
        return []

    def _turned(self, embedding: Embedding) -> Embedding:
        return Embedding(embedding.target, embedding.source)
