"""Shapes with known correspondence: procedural creatures and organs, and the shipped pair."""

from isomatch.loading.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
