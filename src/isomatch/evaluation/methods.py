"""The methods a benchmark can run, by name, and the true landmarks some of them are given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from isomatch._arrays import IntArray
from isomatch.baselines import (
    functional_maps,
    gdd,
    gdd_post,
    gmds,
    gromov_wasserstein,
    laplace_nearest_neighbours,
    pyfm_zoomout,
    spectral_gmds,
    spectral_gradient_fields,
    zoomout,
)
from isomatch.correspondence import Correspondence
from isomatch.datasets import BenchmarkPair
from isomatch.errors import SettingError
from isomatch.geodesics import DistanceEngine, distance_engine
from isomatch.matching import Config, MatchResult, PreparedShape, match
from isomatch.surfaces import Mesh

Surface: TypeAlias = Mesh | PreparedShape

N_LANDMARKS = 5  # as in the paper
REFERENCES = 30  # true pairs by which others are checked
SOUND = 0.95  # share of the truth from which landmarks are drawn


@dataclass(frozen=True)
class Method:
    """How a benchmark runs a method.

    Parameters
    ----------
    function : callable
        Of source and target, and of ``landmarks`` if it takes them.
    n_landmarks : int
        True landmarks it is given.
    preparation : Config, optional
        Settings of the prepared shapes it is given; None where it takes meshes alone.
    """

    function: Callable[..., MatchResult | Correspondence]
    n_landmarks: int = 0
    preparation: Config | None = field(default_factory=Config)

    def __call__(
        self, source: Surface, target: Surface, given: Mapping[str, IntArray]
    ) -> tuple[Correspondence, dict[str, Any]]:
        """Map source to target from what is given, by names of arguments; also give what the method tells of itself."""
        found = self.function(source, target, **given)
        return (found.map, found.to_dict()) if isinstance(found, MatchResult) else (found, {})


AS_PUBLISHED = Config(weights="uniform")
METHODS = {
    "isomatch": Method(match),
    "gdd": Method(gdd, N_LANDMARKS, AS_PUBLISHED),
    "gdd_post": Method(gdd_post, N_LANDMARKS, AS_PUBLISHED),
    "phi": Method(laplace_nearest_neighbours, N_LANDMARKS),
    "functional_maps": Method(functional_maps),
    "functional_maps_5pt": Method(functional_maps, N_LANDMARKS),
    "zoomout": Method(zoomout),
    "zoomout_5pt": Method(zoomout, N_LANDMARKS),
    "gmds": Method(gmds),
    "gmds_5pt": Method(gmds, N_LANDMARKS),
    "gw": Method(gromov_wasserstein),
    "gw_5pt": Method(gromov_wasserstein, N_LANDMARKS),
    "sgmds": Method(spectral_gmds),
    "sgmds_5pt": Method(spectral_gmds, N_LANDMARKS),
    "sgf": Method(spectral_gradient_fields),
    "sgf_5pt": Method(spectral_gradient_fields, N_LANDMARKS),
    "pyfm": Method(pyfm_zoomout, preparation=None),
}

CONTINUATIONS = {
    "isomatch": Method(partial(match, config=Config(hypotheses="given"))),
    "gdd": Method(gdd, preparation=AS_PUBLISHED),
    "gdd_post": Method(gdd_post, preparation=AS_PUBLISHED),
}
"""What can start from the map of another method: "sgmds_5pt+gdd" is GDD from the map of SGMDS."""


def parts_of(name: str) -> tuple[str, str]:
    """Split the name of a method into a key of ``METHODS`` and one of ``CONTINUATIONS``, or "".

    Raises
    ------
    SettingError
        If there is no such method.
    """
    base, plus, ending = name.partition("+")
    if base not in METHODS or (plus and ending not in CONTINUATIONS):
        raise SettingError(
            f"unknown method {name}; known are {', '.join(METHODS)}, and any of them followed by "
            + " or ".join(f"+{known}" for known in CONTINUATIONS)
        )
    return base, ending


def true_landmarks(
    pair: BenchmarkPair,
    count: int = N_LANDMARKS,
    seed: int = 0,
    engines: tuple[DistanceEngine, DistanceEngine] | None = None,
) -> IntArray:
    """Draw true pairs far from one another: farthest points of the source among those whose image is known.

    Parameters
    ----------
    pair : BenchmarkPair
        Two shapes and the truth.
    count : int
        Landmarks to draw.
    seed : int
        Draws references; the first landmark is the point farthest from the first of them.
    engines : two DistanceEngine, optional
        Distances on the source and on the target; by default by fast marching.

    Returns
    -------
    (count, 2) array of int
        Rows (source vertex, target vertex).

    Notes
    -----
    Published truth has a few wrong rows where limbs touch, a hand for the other. So distances to the references are
    compared on both shapes, and the twentieth of the rows that fits worst is not drawn from.
    """
    references = pair.truth[np.random.default_rng(seed).integers(len(pair.truth), size=REFERENCES)]
    source, target = engines or (distance_engine(pair.source), distance_engine(pair.target))
    here = source.distances_from(references[:, 0])[:, pair.truth[:, 0]] / np.sqrt(pair.source.area)
    there = target.distances_from(references[:, 1])[:, pair.truth[:, 1]] / np.sqrt(pair.target.area)
    joined = np.isfinite(here) & np.isfinite(there)  # where not, on another component, the mismatch is √area
    mismatch = np.abs(np.subtract(here, there, where=joined, out=np.ones(here.shape))).mean(axis=0)
    known = np.flatnonzero(joined[0] & (mismatch <= np.quantile(mismatch, SOUND)))
    rows = [known[here[0, known].argmax()]]
    nearest = np.full(len(known), np.inf)
    while len(rows) < count:
        distances = source.distances_from(pair.truth[rows[-1:], 0])[0]
        nearest = np.minimum(nearest, distances[pair.truth[known, 0]])
        rows.append(known[nearest.argmax()])
    return pair.truth[rows]
