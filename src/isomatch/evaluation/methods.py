"""The methods a benchmark can run, by name, and the true landmarks some of them are given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
from isomatch.datasets import BenchmarkPair
from isomatch.geodesics import distance_engine
from isomatch.maps import Correspondence
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
        Settings of the prepared shapes it is given; by default it is given meshes.
    """

    function: Callable[..., MatchResult | Correspondence]
    n_landmarks: int = 0
    preparation: Config | None = None

    def hints(self, pair: BenchmarkPair, seed: int) -> dict[str, IntArray]:
        """Arguments that tell the method part of the truth."""
        return {"landmarks": true_landmarks(pair, self.n_landmarks, seed)} if self.n_landmarks else {}

    def __call__(
        self, pair: BenchmarkPair, hints: dict[str, IntArray]
    ) -> tuple[Correspondence, dict[str, Any]]:
        """Map source to target; also give what the method tells of itself."""
        return self.on(pair.source, pair.target, hints)

    def on(
        self, source: Surface, target: Surface, given: dict[str, IntArray]
    ) -> tuple[Correspondence, dict[str, Any]]:
        """Do the same with meshes or shapes prepared with the settings of ``preparation``."""
        found = self.function(source, target, **given)
        return (found.map, found.to_dict()) if isinstance(found, MatchResult) else (found, {})


def _from_map(source: Surface, target: Surface, start: IntArray) -> MatchResult:
    """Align descriptors from a given map, and refine jointly."""
    return match(source, target, initial_map=start, config=Config(hypotheses="given"))


def _from_map_as_published(source: Surface, target: Surface, start: IntArray) -> MatchResult:
    """Align descriptors from a given map, then iterative closest points in the Laplace–Beltrami basis."""
    return gdd_post(source, target, initial_map=start)


USUAL, PUBLISHED = Config(), Config(weights="uniform")
METHODS = {
    "isomatch": Method(match, 0, USUAL),
    "gdd": Method(gdd, N_LANDMARKS, PUBLISHED),
    "gdd_post": Method(gdd_post, N_LANDMARKS, PUBLISHED),
    "phi": Method(laplace_nearest_neighbours, N_LANDMARKS, USUAL),
    "functional_maps": Method(functional_maps, 0, USUAL),
    "functional_maps_5pt": Method(functional_maps, N_LANDMARKS, USUAL),
    "zoomout": Method(zoomout, 0, USUAL),
    "zoomout_5pt": Method(zoomout, N_LANDMARKS, USUAL),
    "gmds": Method(gmds, 0, USUAL),
    "gmds_5pt": Method(gmds, N_LANDMARKS, USUAL),
    "gw": Method(gromov_wasserstein, 0, USUAL),
    "gw_5pt": Method(gromov_wasserstein, N_LANDMARKS, USUAL),
    "sgmds": Method(spectral_gmds, 0, USUAL),
    "sgmds_5pt": Method(spectral_gmds, N_LANDMARKS, USUAL),
    "sgf": Method(spectral_gradient_fields, 0, USUAL),
    "sgf_5pt": Method(spectral_gradient_fields, N_LANDMARKS, USUAL),
    "pyfm": Method(pyfm_zoomout),
}

CONTINUATIONS = {
    "gdd": Method(_from_map, 0, USUAL),
    "post": Method(_from_map_as_published, 0, PUBLISHED),
}
"""What starts from the map of another method, its third argument."""


def true_landmarks(pair: BenchmarkPair, count: int = N_LANDMARKS, seed: int = 0) -> IntArray:
    """Draw true pairs far from one another: farthest points of the source among those whose image is known.

    Parameters
    ----------
    pair : BenchmarkPair
        Two shapes and the truth.
    count : int
        Landmarks to draw.
    seed : int
        Draws references; the first landmark is the point farthest from the first of them.

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
    source, target = (distance_engine(shape) for shape in (pair.source, pair.target))
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
