"""Landmarks: marked points of two shapes, and the files that hold them."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
