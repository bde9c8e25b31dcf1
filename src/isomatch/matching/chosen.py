"""`continue_with`: an alternative of a result becomes the map."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from typing import Any

from numpy.typing import ArrayLike

from isomatch.assets import SurfaceLike
from isomatch.errors import SettingError
from isomatch.matching.match import match
from isomatch.matching.result import Alternative, MatchResult
from isomatch.runtime.stage_timer import Progress
from isomatch.settings import Config
from isomatch.shapes import PreparedShape

BEFORE = "the map before, "


def continue_with(
    result: MatchResult,
    number: int,
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    progress: Progress | None = None,
) -> MatchResult:
    """Refine an alternative of a result and measure it; the former map becomes the first alternative.

    Parameters
    ----------
    result : MatchResult
        Result of `match` for the two shapes.
    number : int
        Number of the alternative, from 1.
    source, target : Mesh, PointCloud, Graph, PreparedShape, path_like, tuple or object
        The shapes, as for `match`.
    landmarks : (m, 2) array_like of int, optional
        Rows (source vertex, target vertex) that hold if ``result.config.pin`` is set; otherwise they are not used.
    progress : callable, optional
        See `match`.

    Returns
    -------
    MatchResult
        Quality and outcome are those of the new map. Its settings are those of the result with ``hypotheses="given"``
        and ``start="auto"``, and a note names what was chosen.

    Raises
    ------
    SettingError
        If there is no alternative of that number, or the result is of a baseline.
    MapError
        If the maps are between other shapes.
    """
    others = result.alternatives
    if not 1 <= number <= len(others):
        raise SettingError(
            f"there is no alternative {number}; the result has {len(others) or 'none'} of them"
        )
    if not isinstance(result.config, Config):
        raise SettingError(f"the result is of {type(result.config).__name__}; only maps of match are refined")
    chosen = others[number - 1]
    start: Any = chosen.map  # with the hashes of its surfaces
    config = replace(result.config, hypotheses="given", start="auto")
    found = match(
        source,
        target,
        landmarks=None if config.pin is None else landmarks,
        initial_map=start,
        config=config,
        seed=result.seed,
        progress=progress,
    )
    before = result.map  # and nothing else of the result
    former = Alternative(lambda: before, nan, nan, BEFORE + result.origin)
    left = [
        replace(other, origin=other.origin.removeprefix(BEFORE)) for other in others if other is not chosen
    ]
    origin = chosen.origin.removeprefix(BEFORE)
    note = f"alternative {number}, from {origin}, was chosen and refined; the map before is alternative 1"
    return replace(found, alternatives=(former, *left), origin=origin, notes=(note, *found.notes))
