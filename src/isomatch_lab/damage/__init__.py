"""Damage: a mesh made from a whole one, where each of its vertices was before, and the truth that remains."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
