from isomatch.matching.candidates import first_map
from isomatch.matching.confidence import DoubtfulRegion, expected_errors
from isomatch.matching.coordinates import joint_coordinates
from isomatch.matching.evidence import (
    Evidence,
    Solution,
    lowered,
    measured_evidence,
    outcome_of,
    verified,
)
from isomatch.matching.fit import Candidate, Fit, Hypothesis
from isomatch.matching.match import BothDirections, continue_with, match, match_both, stages_of
from isomatch.matching.pair import ShapePair, prepare_pair
from isomatch.matching.priors import Priors
from isomatch.matching.quality import contradicted_landmarks, covered_share, measure_quality
from isomatch.matching.questions import Question, questions
from isomatch.matching.refinements import REFINEMENTS, check_refinement
from isomatch.matching.relations.both_parts import BothParts
from isomatch.matching.relations.elastic import Elastic
from isomatch.matching.relations.isometry import Isometry
from isomatch.matching.relations.part import Part
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality
from isomatch.matching.solve import WAYS
from isomatch.matching.stages import Joint, Refinement, Relation, Stages, Start
from isomatch.matching.starts import default_starts
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
