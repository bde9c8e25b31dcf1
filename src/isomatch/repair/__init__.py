"""Defects of meshes: how to find and repair them, close holes and separate sheets."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
