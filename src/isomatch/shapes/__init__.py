"""Shapes made ready to be matched: what one surface alone tells."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
