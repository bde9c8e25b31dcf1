"""Whether two shapes are far from isometric, by what the match found that takes them for isometric."""

from __future__ import annotations

from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair
from isomatch.matching.result import Quality

FAR = (
    "the shapes are far from isometric, so a map was sought that lets limbs stretch; it may be wrong in places: look at "
    "the picture, and give five landmarks at extremities if it is"
)


def far_from_isometric(pair: ShapePair, hints: Hints, quality: Quality) -> bool:
    """Tell whether the best map that keeps distances fits badly, so that an elastic one should be sought.

    Two meshes are needed, without an initial map or descriptors, and maps that are not given.
    """
    config = pair.config
    if not (pair.oriented and config.looks_further and config.hypotheses == "all" and hints.only_landmarks):
        return False
    bounds = config.outcome
    return (
        quality.misfit > bounds.poor_misfit
        or quality.residual > bounds.poor_residual
        or quality.stretch > bounds.poor_stretch
    )
