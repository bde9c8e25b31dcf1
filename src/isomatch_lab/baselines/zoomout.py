"""ZoomOut: a functional map refined while its size grows."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from isomatch._core.settings import require_least, setting
from isomatch._core.threads import serial_blas
from isomatch.matching import MatchResult
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Surface
from isomatch_lab.baselines.functional_maps import (
    FunctionalMapsConfig,
    FunctionalRefinement,
    solve_functional_map,
)
from isomatch_lab.baselines.task import Task


@dataclass(frozen=True)
class ZoomOutConfig(FunctionalMapsConfig):
    """Settings of `zoomout`: of the functional map it starts from, and of its growth.

    Parameters
    ----------
    first : int
        Size of the functional map fitted to an initial map; without an initial map, growth starts from ``n_functions``.
    last : int
        Number of functions at the end.
    step : int
        Number of functions added in each step.
    n_functions, descriptor_weight, product_weight, orientation_weight, laplacian_weight
        As for `FunctionalMapsConfig`.
    signatures, orientation, refinement
        The same; by default there is no refinement.
    """

    refinement: FunctionalRefinement = "none"
    first: int = setting(20, least=2)
    last: int = 200
    step: int = setting(5, least=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_least(self, last=max(self.first, self.n_functions))


def zoomout(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: ZoomOutConfig | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match by spectral upsampling, from an initial map or else from the map of `functional_maps`.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`. If an initial map is given, landmarks and descriptors are not used.
    config : ZoomOutConfig, optional
        Settings.

    The result and the errors are the same as for `functional_maps`.

    Notes
    -----
    Melzi, Ren, Rodolà, Sharma, Wonka & Ovsjanikov, *ZoomOut: Spectral Upsampling for Efficient Surface Correspondence*,
    SIGGRAPH Asia 2019; written from the paper. While the map grows, images are computed for ``n_refine`` source vertices,
    which is the paper's acceleration by sampling, but among all target vertices; at the end, for all source vertices. The
    paper leaves sizes and step to the user. About 2 s for 5 000 vertices, and as long again for the functional map.
    """
    config = config or ZoomOutConfig()
    with serial_blas():
        task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
        if len(task.priors.initial_pairs):
            first = task.functions_at_most(min(config.first, len(task.priors.initial_pairs)))
            functional_map = task.functional_map_at(task.priors.initial_pairs, first)
        else:
            functional_map = solve_functional_map(task, config)
        task.timer.start("refinement")
        sizes = range(len(functional_map) + config.step, task.functions_at_most(config.last) + 1, config.step)
        functional_map = task.spectra.upsample(functional_map, sizes)
        origin = "initial map" if len(task.priors.initial_pairs) else "functional map"
        return task.spectral_result(functional_map, config, origin)
