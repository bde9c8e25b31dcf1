from isomatch.matching.assessment.confidence import DoubtfulRegion, expected_errors
from isomatch.matching.assessment.evidence import (
    Evidence,
    Solution,
    lower_outcome,
    measured_evidence,
    outcome_of,
    result_of,
)
from isomatch.matching.assessment.quality import contradicted_landmarks, covered_share, measure_quality
from isomatch.matching.assessment.questions import Question, questions
from isomatch.matching.coordinates import joint_coordinates
from isomatch.matching.elastic.elastic import Elastic
from isomatch.matching.isometric.candidates import first_map
from isomatch.matching.isometric.isometry import Isometry
from isomatch.matching.judge import Judgement, judge
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.match import BothDirections, continue_with, match, match_both
from isomatch.matching.model import Match, MatchingModel, Proposals, RefiningModel
from isomatch.matching.partial.part import Part
from isomatch.matching.partial.two_parts import TwoParts
from isomatch.matching.pipeline import match_under, search_under
from isomatch.matching.priors import Priors
from isomatch.matching.problem import Joint, Problem, Refinement, Start, prepare_pair
from isomatch.matching.proposals.starts import default_starts
from isomatch.matching.refinements import REFINEMENTS, check_refinement
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.matching.strategies import STRATEGIES, select_strategies
from isomatch.matching.verify import Verification, verify
from isomatch.settings import COVERAGE_RADIUS

__all__ = [
    "COVERAGE_RADIUS",
    "REFINEMENTS",
    "STRATEGIES",
    "Alternative",
    "BothDirections",
    "Candidate",
    "DoubtfulRegion",
    "Elastic",
    "Evidence",
    "Fit",
    "Isometry",
    "Joint",
    "Judgement",
    "Match",
    "MatchResult",
    "MatchingModel",
    "Outcome",
    "Part",
    "Priors",
    "Problem",
    "Proposals",
    "Quality",
    "Question",
    "Refinement",
    "RefiningModel",
    "Solution",
    "Start",
    "TwoParts",
    "Verification",
    "check_refinement",
    "continue_with",
    "contradicted_landmarks",
    "covered_share",
    "default_starts",
    "expected_errors",
    "first_map",
    "joint_coordinates",
    "judge",
    "lower_outcome",
    "match",
    "match_both",
    "match_under",
    "measure_quality",
    "measured_evidence",
    "outcome_of",
    "prepare_pair",
    "questions",
    "result_of",
    "search_under",
    "select_strategies",
    "verify",
]
