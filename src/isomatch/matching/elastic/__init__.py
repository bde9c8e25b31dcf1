"""Matching of shapes that are far from isometric: starts → coarse fits → fine fits → choice, with limbs that stretch."""

from isomatch.matching.elastic.far import FAR, far_from_isometric
from isomatch.matching.elastic.match_elastic import ElasticMatch, match_elastically

__all__ = ["FAR", "ElasticMatch", "far_from_isometric", "match_elastically"]
