from isomatch.matching.assessment.confidence import DoubtfulRegion, expected_errors
from isomatch.matching.assessment.evidence import (
    Evidence,
    Solution,
    lowered,
    measured_evidence,
    outcome_of,
    verified,
)
from isomatch.matching.assessment.quality import contradicted_landmarks, covered_share, measure_quality
from isomatch.matching.assessment.questions import Question, questions
from isomatch.matching.coordinates import joint_coordinates
from isomatch.matching.elastic.elastic import Elastic
from isomatch.matching.isometric.candidates import first_map
from isomatch.matching.isometric.isometry import Isometry
from isomatch.matching.maps import Candidate, Fit, Hypothesis
from isomatch.matching.match import BothDirections, continue_with, match, match_both, stages_of
from isomatch.matching.partial.both_parts import BothParts
from isomatch.matching.partial.part import Part
from isomatch.matching.pipeline import Joint, Refinement, Relation, Stages
from isomatch.matching.problem import ShapePair, prepare_pair
from isomatch.matching.proposals.priors import Priors
from isomatch.matching.proposals.starts import Start, default_starts
from isomatch.matching.refinements import REFINEMENTS, check_refinement
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.matching.strategies import WAYS
from isomatch.matching.verify import Verification, verify
from isomatch.settings import COVERAGE_RADIUS

__all__ = [
    "COVERAGE_RADIUS",
    "REFINEMENTS",
    "WAYS",
    "Alternative",
    "BothDirections",
    "BothParts",
    "Candidate",
    "DoubtfulRegion",
    "Elastic",
    "Evidence",
    "Fit",
    "Hypothesis",
    "Isometry",
    "Joint",
    "MatchResult",
    "Outcome",
    "Part",
    "Priors",
    "Quality",
    "Question",
    "Refinement",
    "Relation",
    "ShapePair",
    "Solution",
    "Stages",
    "Start",
    "Verification",
    "check_refinement",
    "continue_with",
    "contradicted_landmarks",
    "covered_share",
    "default_starts",
    "expected_errors",
    "first_map",
    "joint_coordinates",
    "lowered",
    "match",
    "match_both",
    "measure_quality",
    "measured_evidence",
    "outcome_of",
    "prepare_pair",
    "questions",
    "stages_of",
    "verified",
    "verify",
]
