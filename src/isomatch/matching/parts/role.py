"""Whether one of two shapes is a part of the other."""

from __future__ import annotations

from typing import Literal

from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair

Part = Literal["source", "target"]
Parts = Part | Literal["both"]


def part_of(pair: ShapePair, hints: Hints) -> Parts | None:
    """Tell which shape is a part, if one is, or both.

    A part has a long boundary. Only the joint refinements of maps that preserve the orientation know of parts, without
    descriptors.
    """
    config = pair.config
    if config.part == "none" or not pair.oriented:
        return None
    if not config.looks_further or hints.functions[0].shape[1]:
        return None
    if config.part != "auto":
        return config.part
    settings = config.parts
    open_source, open_target = (
        shape.longest_boundary > settings.long_boundary for shape in (pair.source, pair.target)
    )
    if open_source and open_target:
        return "both"
    return "source" if open_source else "target" if open_target else None
