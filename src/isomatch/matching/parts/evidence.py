"""How sure the map of a part is: how well it fits, and how clearly it is better than others."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.matching.outcome import Outcome
from isomatch.settings import PartSettings

NO_LEAD = 1e-9  # so that the doubt of a tie is finite


@dataclass(frozen=True)
class Evidence:
    """The evidence for a map of a part.

    Parameters
    ----------
    score : float
        What speaks against the map.
    rival : float
        Score of the best map that differs, over that of the map; inf if none does.
    trusted : float
        Share of the pairs of anchors whose distance on the whole is known.
    settings : PartSettings
        The bounds.
    """

    score: float
    rival: float
    trusted: float
    settings: PartSettings

    @property
    def doubt(self) -> float:
        """1 / (1 / score − 1 / score of the rival): the score if no map comes near, more and more towards a tie."""
        return self.score / max(1 - 1 / self.rival, NO_LEAD)

    @property
    def is_clear(self) -> bool:
        """Whether no other map comes near: where little is known, a wrong map may fit as well as a right one."""
        return self.trusted >= self.settings.little_trusted or self.rival >= self.settings.clear

    @property
    def outcome(self) -> Outcome:
        """A map must fit well; the worse it fits, the more clearly it must be better than others."""
        settings = self.settings
        if self.rival < settings.tie and self.score <= settings.poor_doubt:
            return Outcome.SYMMETRY_AMBIGUOUS
        sure = self.doubt <= settings.poor_doubt and self.is_clear
        return Outcome.PARTIAL if sure else Outcome.LOW_CONFIDENCE

    def notes(self, hinted: bool) -> list[str]:
        """Say why a map is not sure, and what to do; no note if it is."""
        if self.outcome is Outcome.PARTIAL:
            return []
        why = "it fits badly"
        if self.score <= self.settings.poor_doubt:
            why = f"the score of another map is only {self.rival:.2f} times as high"
            if not self.is_clear:
                why += (
                    f", and too much is missing: {self.trusted:.1%} of the distances on the whole are known"
                )
        return [
            f"the map is not sure, for {why} (doubt {self.doubt:.1e}, at most {self.settings.poor_doubt:.1e} if sure); "
            f"look at the picture, and give {'more' if hinted else 'three to five'} landmarks at extremities"
        ]
