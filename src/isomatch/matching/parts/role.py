"""Whether one of two shapes is a part of the other."""

from __future__ import annotations

from typing import Literal

from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair

Part = Literal["source", "target"]


def part_of(pair: ShapePair, hints: Hints) -> Part | None:
    """Tell which shape is a part, if one is.

    A part has a long boundary, and the other shape has none. Only the joint refinements of maps
    that preserve the orientation know of parts, without an initial map or descriptors.
    """
    config = pair.config
    if config.part not in ("auto", "source", "target") or not pair.oriented:
        return None
    if not (config.looks_further and hints.only_landmarks and config.start == "auto"):
        return None
    if config.part != "auto":
        return config.part
    settings = config.parts
    long = settings.long_boundary
    if pair.source.boundary_length > long >= pair.target.boundary_length:
        return "source"
    return "target" if pair.target.boundary_length > long >= pair.source.boundary_length else None
