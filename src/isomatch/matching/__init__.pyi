from isomatch.matching.body import Body, body_of
from isomatch.matching.both import BothDirections, match_both
from isomatch.matching.config import (
    Config,
    Hypotheses,
    MatchSettings,
    Orientation,
    Refinement,
    Resolution,
    Start,
)
from isomatch.matching.first_map import first_map
from isomatch.matching.hints import Hints
from isomatch.matching.landmarks import nearest_landmarks, read_landmarks
from isomatch.matching.match import match
from isomatch.matching.outcome import Outcome
from isomatch.matching.pair import ShapePair, prepare_pair
from isomatch.matching.prepare import prepare
from isomatch.matching.prepared_shape import PreparedShape
from isomatch.matching.quality import (
    COVERAGE_RADIUS,
    contradicted_landmarks,
    covered_share,
    measure_quality,
    outcome_of,
)
from isomatch.matching.result import Alternative, MatchResult, Quality
from isomatch.matching.settings import (
    AnchorSettings,
    OutcomeSettings,
    PreparationSettings,
    RefinementSettings,
    SearchSettings,
    SelectionSettings,
    SymmetrySettings,
)
from isomatch.matching.stage_timer import Progress, StageTimer, show_progress, two_arguments
from isomatch.matching.vertex_confidence import expected_errors

__all__ = [
    "COVERAGE_RADIUS",
    "Alternative",
    "AnchorSettings",
    "Body",
    "BothDirections",
    "Config",
    "Hints",
    "Hypotheses",
    "MatchResult",
    "MatchSettings",
    "Orientation",
    "Outcome",
    "OutcomeSettings",
    "PreparationSettings",
    "PreparedShape",
    "Progress",
    "Quality",
    "Refinement",
    "RefinementSettings",
    "Resolution",
    "SearchSettings",
    "SelectionSettings",
    "ShapePair",
    "StageTimer",
    "Start",
    "SymmetrySettings",
    "body_of",
    "contradicted_landmarks",
    "covered_share",
    "expected_errors",
    "first_map",
    "match",
    "match_both",
    "measure_quality",
    "nearest_landmarks",
    "outcome_of",
    "prepare",
    "prepare_pair",
    "read_landmarks",
    "show_progress",
    "two_arguments",
]
