"""Starts: functions of a problem that propose first maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from isomatch._core.arrays import BodyVertices, Int
from isomatch._core.errors import SettingError
from isomatch.matching.problem import Problem, Start, name_of, search_pairs
from isomatch.matching.proposals.anchors import starts_from_anchors
from isomatch.matching.proposals.from_priors import first_maps_from_points
from isomatch.matching.proposals.pose import starts_from_poses


def starts_from_extremities(pair: Problem) -> Iterator[Int[BodyVertices, "m_s 2"]]:
    """First maps from all assignments of extremal points."""
    settings = pair.config.search
    for count in settings.extremity_counts:
        group = [points for points in pair.extremity_assignments if len(points) == count]
        if group:
            starts = first_maps_from_points(pair, BodyVertices(np.array(group)), settings.off_diagonal[0])
            yield from (search_pairs(pair, start) for start in starts)


default_starts: tuple[Start, ...] = (starts_from_extremities, starts_from_poses, starts_from_anchors)
"""The starts of a match by default; priors come before them."""


def first_maps_of(starts: Iterable[Start], pair: Problem) -> list[tuple[Int[BodyVertices, "_ 2"], str]]:
    """Collect the first maps of some starts, checked, with the name of each start."""
    first_maps = []
    sizes = pair.source.body.n_vertices, pair.target.body.n_vertices
    for start in starts:
        maps = start(pair)
        if maps is None or (isinstance(maps, np.ndarray) and maps.ndim < 3):
            what = "None" if maps is None else f"one array of shape {maps.shape}"
            raise SettingError(
                f"the start {name_of(start)} gave {what}; expected a list of first maps, which may be empty"
            )
        for pairs in map(np.asarray, maps):
            fits = pairs.ndim == 2 and pairs.shape[1] == 2 and pairs.dtype.kind in "iu" and len(pairs) >= 3
            if not fits or (pairs < 0).any() or (pairs >= sizes).any():
                raise SettingError(
                    f"the start {name_of(start)} gave an array of shape {pairs.shape} and type {pairs.dtype}; expected "
                    f"at least three rows (source vertex, target vertex) of bodies of {sizes[0]} and {sizes[1]} vertices"
                )
            first_maps.append((BodyVertices(pairs), name_of(start)))
    return first_maps
