from isomatch.matching.both import BothDirections, match_both
from isomatch.matching.first_map import first_map
from isomatch.matching.hints import Hints
from isomatch.matching.match import match
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair, prepare_pair
from isomatch.matching.quality import (
    COVERAGE_RADIUS,
    contradicted_landmarks,
    covered_share,
    measure_quality,
    outcome_of,
)
from isomatch.matching.result import Alternative, MatchResult, Quality
from isomatch.matching.vertex_confidence import expected_errors

__all__ = [
    "COVERAGE_RADIUS",
    "Alternative",
    "BothDirections",
    "Hints",
    "MatchResult",
    "Outcome",
    "Quality",
    "ShapePair",
    "contradicted_landmarks",
    "covered_share",
    "expected_errors",
    "first_map",
    "match",
    "match_both",
    "measure_quality",
    "outcome_of",
    "prepare_pair",
]
