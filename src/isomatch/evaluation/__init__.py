"""Errors of a map against a truth, and files of truth."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
