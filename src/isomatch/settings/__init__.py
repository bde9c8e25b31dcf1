"""The settings of a match: the everyday settings, and one file for each stage."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
