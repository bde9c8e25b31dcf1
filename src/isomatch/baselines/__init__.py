"""Other methods behind one signature, for comparison."""

from isomatch.baselines.functional_maps import FunctionalMapsConfig, functional_maps
from isomatch.baselines.gdd import gdd, gdd_post
from isomatch.baselines.laplace_nearest_neighbours import LaplaceConfig, laplace_nearest_neighbours
from isomatch.baselines.pyfm import pyfm_zoomout
from isomatch.baselines.zoomout import ZoomOutConfig, zoomout

__all__ = [
    "FunctionalMapsConfig",
    "LaplaceConfig",
    "ZoomOutConfig",
    "functional_maps",
    "gdd",
    "gdd_post",
    "laplace_nearest_neighbours",
    "pyfm_zoomout",
    "zoomout",
]
