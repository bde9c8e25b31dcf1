"""Matching by way of other shapes: two fragments by a whole of their kind, or by one of each kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from isomatch._core.arrays import UserVertices
from isomatch._core.errors import MeshError, SettingError
from isomatch.correspondence import Correspondence
from isomatch.io import SurfaceLike
from isomatch.matching.assessment.evidence import Evidence, Solution
from isomatch.matching.assessment.quality import covered_share
from isomatch.matching.problem import Problem
from isomatch.matching.result import Quality
from isomatch.matching.strategies import VIA
from isomatch.matching.verify import Verification, on_bodies, verifier_of
from isomatch.shapes import PreparedShape, prepare

Whole: TypeAlias = "SurfaceLike | PreparedShape"
Via: TypeAlias = "Whole | tuple[Whole, ...] | list[Whole | tuple[Whole, ...]]"
"""A shape, shapes one after the other, or a list of several such ways, of which the one that verifies best is taken."""


def chains_of(via: Via) -> list[tuple[Whole, ...]]:
    """Return each chain of shapes that is meant; a tuple (vertices, faces) is a shape."""
    several = [
        each if isinstance(each, tuple) and not (len(each) == 2 and np.ndim(each[0]) == 2) else (each,)
        for each in (via if isinstance(via, list) else [via])
    ]
    if not (several and all(several)):
        raise SettingError(
            "via names no shape; give a whole, or one of the source's kind and one of the target's"
        )
    return several


def solve_via(problem: Problem, via: Via, solved: Callable[[Problem], Solution]) -> Solution:
    """Match two shapes by way of others, each to the next; of several ways, the map that verifies best is taken."""
    if not problem.oriented:
        raise MeshError("via: maps are composed and verified on triangles; give meshes")
    chains = [
        [each if isinstance(each, PreparedShape) else prepare(each, problem.config) for each in chain]
        for chain in chains_of(via)
    ]
    ways = [_match_along_chain(problem, chain, solved) for chain in chains]
    solution = min(ways, key=lambda way: way[1].cost)[0]
    if len(ways) > 1:
        costs = ", ".join(f"{found.cost:.2g}" for _, found in ways)
        reason = f"{solution.reason}; of {len(ways)} ways it verifies best (cost {costs})"
        solution = replace(solution, reason=reason)
    return solution


def _match_along_chain(
    problem: Problem, chain: Sequence[PreparedShape], solved: Callable[[Problem], Solution]
) -> tuple[Solution, Verification]:
    """Match each shape to the next, and compose the maps; it is as sure as the least sure of them."""
    pair, shapes = problem, [problem.source, *chain, problem.target]
    legs = [solved(replace(problem, source=here, target=there)) for here, there in pairwise(shapes)]
    image, errors = legs[0].map, legs[0].expected_error
    for leg in legs[1:]:
        # independent errors, the first in √area of the shape in between, which is worth ``unit`` beyond it
        unit = verifier_of(leg.pair).unit_of(on_bodies(leg.pair, UserVertices(leg.map.vertices)))
        at_rim = np.nanmax(leg.expected_error, initial=0.0)  # next to vertices without an image
        own = image.pull_back(leg.expected_error)
        errors = np.hypot(unit * errors, np.where(np.isnan(own), at_rim, own))
        image = image.then(leg.map, leg.pair.source.surface, leg.pair.target.surface)
    found, bounds = _verify(pair, image), problem.config.parts
    least = min((leg.outcome for leg in legs), key=lambda outcome: outcome.sureness)
    evidence = (
        Evidence.of(least),
        Evidence(poor=found.cost > bounds.poor_via, partial=not image.matched.all()),
    )
    between = "1 other shape" if len(legs) == 2 else f"{len(legs) - 1} other shapes"
    solution = Solution(
        pair,
        image,
        _quality(pair, legs, image, found),
        evidence,
        np.where(image.matched, errors, np.nan),
        notes=tuple(f"map {i}: {note}" for i, leg in enumerate(legs, start=1) for note in leg.notes),
        origin=legs[0].origin,
        reason=f"composed of maps by way of {between}, {', then '.join(leg.outcome.value for leg in legs)}; "
        f"directly, it verifies with cost {found.cost:.2g}, at most {bounds.poor_via:.2g} if sure",
        way=VIA.name,
    )
    return solution, found


def _verify(pair: Problem, image: Correspondence) -> Verification:
    return verifier_of(pair)(on_bodies(pair, UserVertices(image.vertices)))


def _quality(pair: Problem, legs: Sequence[Solution], image: Correspondence, found: Verification) -> Quality:
    """Measure a composed map; what only the way that found a map could tell is unknown."""
    bodies = on_bodies(pair, UserVertices(image.vertices))
    names = (each.name for each in fields(Quality))
    return Quality(
        **{
            **dict.fromkeys(names, np.nan),
            "mirrored": np.inf,
            "runner_up": min(leg.quality.runner_up for leg in legs),
            "orientation": min(leg.quality.orientation for leg in legs),
            "coverage": covered_share(
                pair.target.body, bodies[bodies >= 0], pair.config.outcome.coverage_radius
            ),
            "matched": float(image.matched.mean()),
            "descriptor_distance": found.descriptor_distance,
        }
    )
