"""The settings of a match: the everyday ones, and one file for those of each stage."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
