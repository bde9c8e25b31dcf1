"""Spectral generalised multidimensional scaling: the functional map that preserves geodesic distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import polar

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting
from isomatch._core.threads import serial_blas
from isomatch.descriptors import standardised
from isomatch.matching import MatchResult
from isomatch.settings import Orientation
from isomatch.shapes import PreparedShape
from isomatch.spectral import LaplaceBasis, spectral_interpolant
from isomatch.surfaces import Surface
from isomatch_lab.baselines.functional_maps import FunctionalEnergy
from isomatch_lab.baselines.task import Task

HEAT_TIMES = 6  # number of times, from local to global, at which heat from a landmark is compared; chosen
WAVE_KERNELS = 20  # number of wave kernels, the first columns of the signatures; the others are curvatures


@dataclass(frozen=True)
class SpectralGmdsConfig(Settings):
    """Settings of `spectral_gmds`.

    Parameters
    ----------
    sizes : tuple of int
        Laplace–Beltrami functions at each stage, increasing; a stage takes O(size⁶).
    distance_weight, data_weight, previous_weight : float
        Weights of the distances, of each kind of prior and the signatures, and of the map of the previous stage.
    icp_steps : int
        Maximum number of iterations in the spectral domain that turn the functional map into a map of points.
    final_sizes : tuple of int
        Laplace–Beltrami functions with which the map of points grows at the end, as in ZoomOut; empty leaves it as it is.
    orientation : {"any", "preserve", "reverse"}
        Orientation that the outcome expects; distances do not depend on it.
    """

    sizes: tuple[int, ...] = (15, 25, 35, 50)
    distance_weight: float = setting(1.0, least=0)
    data_weight: float = setting(1.0, least=0)
    previous_weight: float = setting(1.0, least=0)
    icp_steps: int = setting(15, least=1)
    final_sizes: tuple[int, ...] = setting(
        tuple(range(20, 201, 5)),
        "as `zoomout` from a map; docs/dev/lab/paper.md, Spectral GMDS",
        least=3,
        empty=True,
    )
    orientation: Orientation = "any"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.sizes or self.sizes[0] < 3 or any(np.diff(self.sizes) <= 0):
            raise SettingError(f"sizes = {self.sizes} do not grow from at least 3")


def spectral_gmds(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: SpectralGmdsConfig | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match by spectral GMDS: a map in the Laplace–Beltrami domain that preserves areas and geodesic distances.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`. Each prior gives functions that the map should preserve: heat that spreads from the landmarks, the
        descriptors, and the target's eigenfunctions pulled back by the initial map. Wave kernel signatures are preserved
        as well; alone they do not distinguish left from right on a symmetric shape.
    config : SpectralGmdsConfig, optional
        Settings.

    The result and the errors are the same as for `functional_maps`.

    Notes
    -----
    Aflalo, Dubrovina & Kimmel, *Spectral Generalized Multi-dimensional Scaling*, IJCV 2016: with D ≈ Φ D̂ Φᵀ on both
    shapes and the map P ≈ Φ_s α Φ_tᵀA_t, minimise ‖α D̂_t − D̂_s α‖² and a data term, subject to P 1 = 1 and its
    counterpart for areas: α m_t = m_s and αᵀ m_s = m_t with m = ΦᵀA 1.
    Reconstructed: the data term, with heat in place of the authors' features; the weights, which are all one; the stages,
    each drawn to the map of the previous one; and the orthogonal projection after each stage. Because the
    first function is constant, the constraints determine the first row and column of α, and the rest has a closed form.
    The growth at the end follows Melzi et al., *ZoomOut*, 2019: where shapes stretch, the energy is least beside the
    truth, and few functions fitted to the map of points forget the difference.
    """
    config = config or SpectralGmdsConfig()
    with serial_blas():
        task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
        task.timer.start("functional map")
        alpha, origin = coefficient_map(task, config)
        task.timer.start("refinement")
        functional_map = task.orthogonal_icp(alpha, len(alpha), config.icp_steps)
        if config.final_sizes:
            sizes = sorted({task.functions_at_most(k) for k in config.final_sizes})
            functional_map = task.spectra.fit_and_upsample(task.spectra.image(functional_map), sizes)
        return task.spectral_result(functional_map, config, origin)


def coefficient_map(task: Task, config: SpectralGmdsConfig) -> tuple[FloatArray, str]:
    """Minimise the energy from coarse to fine: α (k, k), functions of the target to the source; and the data's origin."""
    shapes = task.shapes
    sizes = sorted({task.functions_at_most(k) for k in config.sizes})
    distances = [spectral_distances(shape, sizes[-1]) for shape in shapes]
    constants = [shape.laplace.vectors[:, 0] @ shape.laplace.weights for shape in shapes]
    data = _data(task, sizes[-1])
    alpha = np.zeros((0, 0))
    for k in sizes:
        prescribed = np.full((k, k), np.nan)
        prescribed[0], prescribed[:, 0] = 0.0, 0.0
        prescribed[0, 0] = constants[0] / constants[1]
        grown = np.pad(alpha, ((0, k - len(alpha)), (0, 0)))
        of_source, of_target = (d[None, :k, :k] for d in distances)
        energy = FunctionalEnergy(k, k)
        energy.commute(of_source, of_target, k * config.distance_weight)
        for coefficients in data.values():
            energy.preserve(coefficients[0][:k], coefficients[1][:k], config.data_weight)
        energy.preserve(grown, np.eye(k, len(alpha)), config.previous_weight)
        alpha = polar(energy.minimiser(prescribed))[0]
    return alpha, next(iter(data))


def spectral_distances(shape: PreparedShape, k: int) -> FloatArray:
    """D̂ (k, k) with D ≈ Φ D̂ Φᵀ, by spectral MDS from the sampled columns, in units of the average distance."""
    columns = shape.laplace.coefficients(shape.columns.T.astype(np.float64), k)  # (k, p)
    # the columns F ≈ Φ C are interpolated: D ≈ ½ (Φ M Cᵀ Φᵀ + Φ C Mᵀ Φᵀ), as by distance_basis with "smds"
    interpolated: FloatArray = spectral_interpolant(shape.laplace, shape.column_vertices)[:k] @ columns.T
    return (interpolated + interpolated.T) / (2 * shape.intrinsic_scale)


def _data(task: Task, k: int) -> dict[str, tuple[FloatArray, ...]]:
    """Coefficients (k, q) of functions of source and target that should correspond, of norm about 1, by their origin."""
    shapes = task.shapes
    data: dict[str, tuple[FloatArray, ...]] = {}
    if len(task.priors.initial_pairs):
        data["initial map"] = task.functional_map_at(task.priors.initial_pairs, k), np.eye(k)
    if len(task.priors.landmarks):
        data["landmarks"] = tuple(
            _heat(shape.laplace, x, k) for shape, x in zip(shapes, task.priors.landmarks.T)
        )
    if task.priors.functions[0].shape[1]:
        data["descriptors"] = tuple(_smooth(shape, f, k) for shape, f in zip(shapes, task.priors.functions))
    data["signatures"] = tuple(_smooth(shape, shape.signatures[:, :WAVE_KERNELS], k) for shape in shapes)
    return data


def _smooth(shape: PreparedShape, functions: FloatArray, k: int) -> FloatArray:
    """Coefficients of standardised functions."""
    return shape.laplace.coefficients(standardised(functions, shape.laplace.weights), k)


def _heat(basis: LaplaceBasis, vertices: IntArray, k: int) -> FloatArray:
    """Heat from each vertex at several times, without its mean, each of norm 1: (k, q · times)."""
    values = basis.values[1:k]
    times = np.geomspace(0.5 / values[-1], 2 / values[0], HEAT_TIMES)
    heat = basis.vectors[vertices, None, 1:k] * np.exp(-times[:, None] * values)  # (q, times, k - 1)
    heat /= np.maximum(np.linalg.norm(heat, axis=-1, keepdims=True), 1e-300)
    return np.pad(heat.reshape(-1, k - 1).T, ((1, 0), (0, 0)))
