"""Other methods behind one signature, for comparison."""

from isomatch.baselines.pyfm import pyfm_zoomout

__all__ = ["pyfm_zoomout"]
