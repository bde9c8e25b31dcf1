"""Matching through intermediate shapes: fragments through one whole, or two."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from isomatch._core.arrays import UserVertices
from isomatch._core.errors import MeshError, SettingError
from isomatch.io import SurfaceLike
from isomatch.matching.assessment.evidence import Evidence, Solution
from isomatch.matching.assessment.quality import covered_share, quality_of
from isomatch.matching.problem import Problem
from isomatch.matching.strategies import VIA
from isomatch.matching.verify import Verification, on_bodies, verifier_of
from isomatch.shapes import PreparedShape, prepare

Whole: TypeAlias = "SurfaceLike | PreparedShape"
Via: TypeAlias = "Whole | tuple[Whole, ...] | list[Whole | tuple[Whole, ...]]"
"""A shape, a chain of shapes, or a list of these, of which the best verified is used."""


def chains_of(via: Via) -> list[tuple[Whole, ...]]:
    """Turn the argument into a list of chains of shapes; a tuple (vertices, faces) is one shape."""
    chains = [
        entry if isinstance(entry, tuple) and not (len(entry) == 2 and np.ndim(entry[0]) == 2) else (entry,)
        for entry in (via if isinstance(via, list) else [via])
    ]
    if not (chains and all(chains)):
        raise SettingError(
            "via names no shape; give a whole, or one of the source's kind and one of the target's"
        )
    return chains


def solve_via(problem: Problem, via: Via, solve: Callable[[Problem], Solution]) -> Solution:
    """Match two shapes through others; of several chains, return the best verified map."""
    if not problem.oriented:
        raise MeshError("via: maps are composed and verified on triangles; give meshes")
    chains = [
        [shape if isinstance(shape, PreparedShape) else prepare(shape, problem.config) for shape in chain]
        for chain in chains_of(via)
    ]
    found = [_match_along_chain(problem, chain, solve) for chain in chains]
    solution = min(found, key=lambda verified: verified[1].cost)[0]
    if len(found) > 1:
        costs = ", ".join(f"{verification.cost:.2g}" for _, verification in found)
        reason = f"{solution.reason}; of {len(found)} ways it verifies best (cost {costs})"
        solution = replace(solution, reason=reason)
    return solution


def _match_along_chain(
    problem: Problem, chain: Sequence[PreparedShape], solve: Callable[[Problem], Solution]
) -> tuple[Solution, Verification]:
    """Match each shape to the next, and compose the maps; the least sure one counts."""
    shapes = [problem.source, *chain, problem.target]
    legs = [solve(replace(problem, source=source, target=target)) for source, target in pairwise(shapes)]
    image, errors = legs[0].map, legs[0].expected_error
    for leg in legs[1:]:
        # Errors of the maps composed so far, and of the next map, are independent. The former are in √area of
        # the shape between both, which is ``unit`` √area of the next shape.
        unit = verifier_of(leg.pair).unit_of(on_bodies(leg.pair, UserVertices(leg.map.vertices)))
        largest = np.nanmax(leg.expected_error, initial=0.0)  # taken where a vertex has no image
        leg_errors = image.pull_back(leg.expected_error)
        errors = np.hypot(unit * errors, np.where(np.isnan(leg_errors), largest, leg_errors))
        image = image.then(leg.map, leg.pair.source.surface, leg.pair.target.surface)
    bodies, bounds = on_bodies(problem, UserVertices(image.vertices)), problem.config.parts
    found = verifier_of(problem)(bodies)
    quality = quality_of(  # measures that only a search could give stay nan
        mirrored=np.inf,
        runner_up=min(leg.quality.runner_up for leg in legs),
        orientation=min(leg.quality.orientation for leg in legs),
        coverage=covered_share(
            problem.target.body, bodies[bodies >= 0], problem.config.outcome.coverage_radius
        ),
        matched=float(image.matched.mean()),
        descriptor_distance=found.descriptor_distance,
    )
    least = min((leg.outcome for leg in legs), key=lambda outcome: outcome.sureness)
    is_poor = found.cost > bounds.poor_via
    evidence = Evidence.of(least), Evidence(poor=is_poor, partial=not image.matched.all())
    between = "1 other shape" if len(legs) == 2 else f"{len(legs) - 1} other shapes"
    solution = Solution(
        problem,
        image,
        quality,
        evidence,
        np.where(image.matched, errors, np.nan),
        notes=tuple(f"map {i}: {note}" for i, leg in enumerate(legs, start=1) for note in leg.notes),
        origin=legs[0].origin,
        reason=f"composed of maps by way of {between}, {', then '.join(leg.outcome.value for leg in legs)}; "
        f"directly, it verifies with cost {found.cost:.2g}, at most {bounds.poor_via:.2g} if sure",
        way=VIA.name,
    )
    return solution, found
