"""The figures and the table of Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, reproduced."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
