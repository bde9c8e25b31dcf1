"""Nearest neighbours in the Laplace–Beltrami basis: the method of the paper with its basis taken away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import FloatArray
from isomatch._settings import Settings, setting
from isomatch._threads import serial_blas
from isomatch.baselines.task import Task
from isomatch.bases import LaplaceBasis
from isomatch.descriptors import GeodesicDistanceDescriptor
from isomatch.errors import SettingError
from isomatch.matching import MatchResult, PreparedShape, spectral
from isomatch.matching.config import Orientation
from isomatch.matching.initial import rotation_from_functions, rotations_from_landmarks
from isomatch.surfaces import Surface


@dataclass(frozen=True)
class LaplaceConfig(Settings):
    """Settings of `laplace_nearest_neighbours`.

    Parameters
    ----------
    n_functions : int
        Laplace–Beltrami functions of each shape; the default is the rank of the distance descriptors of `match`.
    steps : int
        Most iterations.
    orientation : {"any", "preserve", "reverse"}
        What the outcome expects; the method itself cannot tell.
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
    """Match by iterative closest points over orthogonal C in the Laplace–Beltrami basis: Phi, and Phi-5pt, of the paper.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`. At least one hint is needed; an initial map goes before landmarks, they before descriptors.
    config : LaplaceConfig, optional
        Settings.

    Returns
    -------
    MatchResult
        ``.map`` is the `Correspondence` source → target; the outcome rests on residual, stretch and orientation.

    Raises
    ------
    MeshError, LandmarkError, SettingError
        As `match` does.

    Notes
    -----
    Shamai & Kimmel 2017 compare with this method under the name Φ: the same iteration, and the same start from a few
    points, with Φ in place of the distance descriptors. Reconstructed: the number of functions.
    """
    config = config or LaplaceConfig()
    with serial_blas():
        task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
        k = task.functions_at_most(config.n_functions)
        start, origin = first_map(task, k)
        task.clock.start("refinement")
        functional_map = spectral.icp(task.pair, start, k, config.steps)
        return task.result(spectral.coordinates(task.pair, functional_map), config, origin)


def first_map(task: Task, k: int) -> tuple[FloatArray, str]:
    """First functional map, by the rules of `match` for distance descriptors, and where it comes from."""
    if len(task.known):
        return spectral.from_points(task.pair, task.known, k), "initial map"
    source, target = (side.shape.laplace for side in (task.pair.source, task.pair.target))
    clouds = _cloud(target, k), _cloud(source, k)
    if len(task.points):
        at_source, at_target = task.points.T
        return rotations_from_landmarks(*clouds, at_target[None], at_source[None])[0].T, "landmarks"
    of_source, of_target = task.functions
    if of_source.shape[1]:
        rotation = rotation_from_functions(*clouds, of_target, of_source, target.weights, source.weights)
        return rotation.T, "descriptors"
    raise SettingError("nothing to start from: give landmarks, an initial map or descriptors")


def _cloud(basis: LaplaceBasis, k: int) -> GeodesicDistanceDescriptor:
    """Functions in the place of distance descriptors, all of one sign."""
    return GeodesicDistanceDescriptor(basis.vectors[:, :k], np.ones(k))
