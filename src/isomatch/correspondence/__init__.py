"""Correspondence on plain arrays: nearest neighbours, alignment, functional maps, precise maps, registration."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
