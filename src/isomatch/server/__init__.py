"""A page on this machine in which two shapes are matched: the session behind it, and who may ask."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
