"""Point-to-point correspondence between near-isometric surfaces.

From geodesic distance descriptors, spectra, curvature and smoothed positions; no training, no landmarks needed.
"""

from isomatch._core.first_use import names_at_first_use

__version__ = "0.1.0"

__all__ = names_at_first_use(__name__)
