"""The colour in which pages and notebooks tell an outcome."""

from isomatch.matching import Outcome

# safe for the colour-blind (Okabe & Ito); the text states the outcome as well
_COLOURS = {Outcome.CONVERGED: "#0072b2", Outcome.LOW_CONFIDENCE: "#d55e00", Outcome.MIRROR_IMAGE: "#d55e00"}
_UNDECIDED = "#e69f00"


def outcome_colour(outcome: Outcome) -> str:
    """Colour of an outcome, as CSS writes it."""
    return _COLOURS.get(outcome, _UNDECIDED)
