"""Nearest neighbours in the Laplace–Beltrami basis, which here takes the place of the distance descriptors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting
from isomatch._core.threads import serial_blas
from isomatch.correspondence import SignedPoints, alignment_from_functions, alignments_from_points
from isomatch.matching import MatchResult
from isomatch.settings import Orientation
from isomatch.shapes import PreparedShape
from isomatch.spectral import LaplaceBasis
from isomatch.surfaces import Surface
from isomatch_lab.baselines.task import Task


@dataclass(frozen=True)
class LaplaceConfig(Settings):
    """Settings of `laplace_nearest_neighbours`.

    Parameters
    ----------
    n_functions : int
        Laplace–Beltrami functions of each shape; the default is the rank of the distance descriptors of `match`.
    steps : int
        Maximum number of iterations.
    orientation : {"any", "preserve", "reverse"}
        Orientation that the outcome expects; the method itself does not depend on it.
    """

    n_functions: int = setting(50, least=2)
    steps: int = setting(15, least=1)
    orientation: Orientation = "any"


def laplace_nearest_neighbours(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: LaplaceConfig | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match by iterative closest points with orthogonal C in the Laplace–Beltrami basis: Φ and Φ-5pt of the paper.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`. At least one prior is needed. The initial map takes precedence, then the landmarks.
    config : LaplaceConfig, optional
        Settings.

    The result and the errors are the same as for `functional_maps`.

    Notes
    -----
    Shamai & Kimmel 2017 compare their method with this one under the name Φ. Iteration and start from a few points are
    the same, with Φ in place of the distance descriptors. Reconstructed: the number of functions.
    """
    config = config or LaplaceConfig()
    with serial_blas():
        task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
        k = task.functions_at_most(config.n_functions)
        start, origin = first_functional_map(task, k)
        task.timer.start("refinement")
        functional_map = task.orthogonal_icp(start, k, config.steps)
        return task.spectral_result(functional_map, config, origin)


def first_functional_map(task: Task, k: int) -> tuple[FloatArray, str]:
    """First functional map, computed as `match` does from distance descriptors, and where it comes from."""
    if len(task.priors.initial_pairs):
        return task.functional_map_at(task.priors.initial_pairs, k), "initial map"
    source, target = (shape.laplace for shape in task.shapes)
    points = _points(source, k), _points(target, k)
    if len(task.priors.landmarks):
        at_source, at_target = task.priors.landmarks.T
        return alignments_from_points(*points, at_source[None], at_target[None])[0].T, "landmarks"
    of_source, of_target = task.priors.functions
    if of_source.shape[1]:
        rotation = alignment_from_functions(*points, of_source, of_target, source.weights, target.weights)
        return rotation.T, "descriptors"
    raise SettingError("nothing to start from: give landmarks, an initial map or descriptors")


def _points(basis: LaplaceBasis, k: int) -> SignedPoints:
    """Functions in place of distance descriptors, all of one sign."""
    return SignedPoints(basis.vectors[:, :k], np.ones(k))
