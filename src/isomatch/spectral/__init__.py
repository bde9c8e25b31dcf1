"""Bases of functions on a surface: low-rank forms of its distances, and eigenfunctions of its Laplacian."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
