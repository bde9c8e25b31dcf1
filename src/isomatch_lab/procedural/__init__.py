"""Procedural animals and organs, at any resolution and in any pose, with exact truth."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
