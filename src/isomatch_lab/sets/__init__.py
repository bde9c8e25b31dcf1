"""Published sets of shapes on disk, and benchmark sets made of them."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
