"""Surfaces: meshes, point clouds and graphs; points on them, and what a camera sees."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
