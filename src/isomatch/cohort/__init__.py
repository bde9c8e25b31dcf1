"""Cohorts: many shapes matched in pairs, and the statistics of shapes in correspondence."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
