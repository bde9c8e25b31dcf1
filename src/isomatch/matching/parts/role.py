"""Whether one of two shapes is a part of the other."""

from __future__ import annotations

from typing import Literal

from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair

Part = Literal["source", "target"]


def part_of(pair: ShapePair, hints: Hints) -> Part | None:
    """Tell which shape is a part, if one is.

    A part has a long boundary and less area than the other shape, which has none. Only the joint refinements of maps
    that preserve the orientation know of parts, without an initial map or descriptors.
    """
    config = pair.config
    if config.part not in ("auto", "source", "target") or not pair.oriented:
        return None
    if not (config.looks_further and hints.only_landmarks):
        return None
    if config.part != "auto":
        return config.part
    settings = config.parts
    open_sides = [shape.boundary_length > settings.long_boundary for shape in (pair.source, pair.target)]
    share = (pair.source.scale / pair.target.scale) ** 2
    if open_sides == [True, False] and share < settings.largest_share:
        return "source"
    if open_sides == [False, True] and 1 / share < settings.largest_share:
        return "target"
    return None
