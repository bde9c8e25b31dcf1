"""The methods of the paper: `match` without its extensions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from isomatch.matching import MatchResult, match
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Surface

PAPER_SETTINGS: dict[str, Any] = {"hypotheses": "given", "weights": "uniform", "resolution": "full"}


def gdd(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match by geodesic distance descriptors alone: GDD-5pt of the paper from landmarks, GDD from another method's map.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`. At least one prior is needed.
    config : Config, optional
        Settings; the paper's hypotheses, refinement, weights and resolution replace the given ones.

    Returns
    -------
    MatchResult
        The result of `match`.

    Raises
    ------
    MeshError, LandmarkError, MapError, DescriptorError, SettingError
        As `match` does; a `SettingError` also if a prepared shape has area weights.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017. Reconstructed: distances are divided by their average,
    and images are precise. Landmarks at extremities leave the front and the back of a thin body undecided, so flips of
    the first map that agree with the landmarks are tried as well, and the selection is the one in `match`. Automatic
    hypotheses are searched as alternatives only if the settings switch ``search_runners_up`` on.
    """
    config = replace(config or Config(), refinement="none", **PAPER_SETTINGS)
    return match(source, target, landmarks, initial_map, initial_descriptors, config, seed)


def gdd_post(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match by geodesic distance descriptors, then post-process in the Laplace–Beltrami basis.

    In the paper, the post-processing is iterative closest points with an
    orthogonal functional map. Here the functional map grows from a few functions to ``n_functions`` of the settings, see
    ``laplace_icp_embedding``.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, config, seed
        As for `gdd`. The result and the errors are the same, too.
    """
    config = replace(config or Config(), refinement="laplace_icp", **PAPER_SETTINGS)
    return match(source, target, landmarks, initial_map, initial_descriptors, config, seed)
