"""Defects of meshes: found, repaired, closed and cut apart."""

from isomatch.loading.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
