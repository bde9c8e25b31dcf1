"""A pair of shapes that comes with the package, and exact truth between triangulations of one surface."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
