"""Matching of a part to a whole: intervals → starts → refinement → choice."""

from isomatch.matching.parts.result import part_result
from isomatch.matching.parts.role import part_of

__all__ = ["part_of", "part_result"]
