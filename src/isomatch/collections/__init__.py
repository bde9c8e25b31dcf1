"""Collections: many shapes prepared once, matched in pairs, on one machine or a cluster."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
