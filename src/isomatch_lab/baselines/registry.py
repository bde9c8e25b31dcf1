"""The registry of baselines, which benchmarks and tests run by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from isomatch._core.settings import Settings
from isomatch.correspondence import Correspondence
from isomatch.matching import MatchResult
from isomatch.settings import Config
from isomatch_lab.baselines.functional_maps import FunctionalMapsConfig, functional_maps
from isomatch_lab.baselines.gdd import gdd, gdd_post
from isomatch_lab.baselines.gmds import GmdsConfig, gmds
from isomatch_lab.baselines.gromov_wasserstein import GromovWassersteinConfig, gromov_wasserstein
from isomatch_lab.baselines.laplace_nearest_neighbours import LaplaceConfig, laplace_nearest_neighbours
from isomatch_lab.baselines.pyfm import pyfm_zoomout
from isomatch_lab.baselines.spectral_gmds import SpectralGmdsConfig, spectral_gmds
from isomatch_lab.baselines.spectral_gradient_fields import GradientFieldsConfig, spectral_gradient_fields
from isomatch_lab.baselines.task import AT_FULL_RESOLUTION
from isomatch_lab.baselines.zoomout import ZoomOutConfig, zoomout


@dataclass(frozen=True)
class Baseline:
    """Another method, as benchmarks run it.

    Parameters
    ----------
    function : callable
        It has the signature of `match`; or, if ``preparation`` is None, it maps two meshes to a `Correspondence`.
    config : Settings, optional
        Its settings; None if it takes none.
    needs_prior : bool
        Whether it needs landmarks, an initial map or descriptors.
    preparation : Config, optional
        Settings of the prepared shapes it is given; None if it takes meshes.
    """

    function: Callable[..., MatchResult | Correspondence]
    config: Settings | None = None
    needs_prior: bool = False
    preparation: Config | None = field(default_factory=lambda: AT_FULL_RESOLUTION)


AS_PUBLISHED = replace(AT_FULL_RESOLUTION, weights="uniform")  # settings of the paper
BASELINES = {
    "gdd": Baseline(gdd, AS_PUBLISHED, needs_prior=True, preparation=AS_PUBLISHED),
    "gdd_post": Baseline(gdd_post, AS_PUBLISHED, needs_prior=True, preparation=AS_PUBLISHED),
    "phi": Baseline(laplace_nearest_neighbours, LaplaceConfig(), needs_prior=True),
    "functional_maps": Baseline(functional_maps, FunctionalMapsConfig()),
    "zoomout": Baseline(zoomout, ZoomOutConfig()),
    "gmds": Baseline(gmds, GmdsConfig()),
    "gw": Baseline(gromov_wasserstein, GromovWassersteinConfig()),
    "sgmds": Baseline(spectral_gmds, SpectralGmdsConfig()),
    "sgf": Baseline(spectral_gradient_fields, GradientFieldsConfig()),
    "pyfm": Baseline(pyfm_zoomout, preparation=None),
}
"""The registry: every baseline by its name. To add a baseline, add an entry."""
