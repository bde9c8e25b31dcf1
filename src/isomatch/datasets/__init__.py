"""Shapes with known correspondence: procedural creatures, the shipped pair, published sets on disk; and damage."""

from isomatch.loading.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
