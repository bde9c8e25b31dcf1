from isomatch_lab.baselines.functional_maps import FunctionalMapsConfig, functional_maps
from isomatch_lab.baselines.gdd import gdd, gdd_post
from isomatch_lab.baselines.gmds import GmdsConfig, gmds
from isomatch_lab.baselines.gromov_wasserstein import GromovWassersteinConfig, gromov_wasserstein
from isomatch_lab.baselines.laplace_nearest_neighbours import LaplaceConfig, laplace_nearest_neighbours
from isomatch_lab.baselines.pyfm import pyfm_zoomout
from isomatch_lab.baselines.registry import BASELINES, Baseline
from isomatch_lab.baselines.spectral_gmds import SpectralGmdsConfig, spectral_gmds
from isomatch_lab.baselines.spectral_gradient_fields import GradientFieldsConfig, spectral_gradient_fields
from isomatch_lab.baselines.zoomout import ZoomOutConfig, zoomout

__all__ = [
    "BASELINES",
    "Baseline",
    "FunctionalMapsConfig",
    "GmdsConfig",
    "GradientFieldsConfig",
    "GromovWassersteinConfig",
    "LaplaceConfig",
    "SpectralGmdsConfig",
    "ZoomOutConfig",
    "functional_maps",
    "gdd",
    "gdd_post",
    "gmds",
    "gromov_wasserstein",
    "laplace_nearest_neighbours",
    "pyfm_zoomout",
    "spectral_gmds",
    "spectral_gradient_fields",
    "zoomout",
]
