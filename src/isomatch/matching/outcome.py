"""How a match ended, in one word, and what to do about it."""

from __future__ import annotations

from enum import Enum

from isomatch.loading.first_use import Shown


class Outcome(Shown, Enum):
    """How a match ended; ``advice`` says what it means and what to do. Where several hold, the first one is given."""

    HINTS_CONTRADICTED = "hints contradicted"
    MIRROR_IMAGE = "mirror image"
    LOW_CONFIDENCE = "low confidence"
    SYMMETRY_AMBIGUOUS = "symmetry ambiguous"
    PARTIAL = "partial"
    CONVERGED = "converged"

    @property
    def advice(self) -> str:
        """One sentence: what happened, why, what to do."""
        return _ADVICE[self]

    @property
    def is_doubtful(self) -> bool:
        """Whether the map may be wrong altogether."""
        return self.sureness <= Outcome.LOW_CONFIDENCE.sureness

    @property
    def sureness(self) -> int:
        """Rank among the outcomes; 0 is the least sure."""
        return list(Outcome).index(self)


_ADVICE = {
    Outcome.HINTS_CONTRADICTED: (
        "The map does not agree with the landmarks or the initial map. Either may be wrong: check that landmarks are "
        "pairs (source vertex, target vertex) that count from 0; if they are right, match with hypotheses = 'given'."
    ),
    Outcome.MIRROR_IMAGE: (
        "The mirror image of the source fits clearly better than any map that keeps the orientation of the faces, so "
        "this map is wrong: perhaps one shape is a left and the other a right one, or a file is mirrored. Match with "
        "orientation = 'any', or reflect one of the shapes."
    ),
    Outcome.LOW_CONFIDENCE: (
        "The shapes fit badly under this map, as a whole or in its regions of doubt; it may be wrong there or "
        "altogether. Look at the picture; give three to five landmark pairs at extremities, or start = 'pose' if the "
        "shapes are roughly aligned in space; or check that both shapes are complete and of one kind."
    ),
    Outcome.SYMMETRY_AMBIGUOUS: (
        "A second, symmetric map fits as well, or the hints led to the mirror image. If sides matter, give landmarks: "
        "three to five pairs, at least one on one side only (a left hand, a right ear), and say which orientation "
        "is meant; or start = 'pose' if the shapes are roughly aligned in space."
    ),
    Outcome.PARTIAL: (
        "One shape is a part of the other, both are parts of one body, or one has further components; what has no "
        "counterpart is marked unmatched (−1). "
        "The notes say what is missing. Landmarks on two components make them partners."
    ),
    Outcome.CONVERGED: "The evidence agrees on one map.",
}
