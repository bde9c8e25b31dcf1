"""From two prepared shapes to a map: starts, alignment, choice, refinement."""

from isomatch.matching.config import Config
from isomatch.matching.pipeline import match
from isomatch.matching.prepare import PreparedShape, prepare
from isomatch.matching.result import Alternative, MatchResult, Outcome, Quality

__all__ = ["Alternative", "Config", "MatchResult", "Outcome", "PreparedShape", "Quality", "match", "prepare"]
