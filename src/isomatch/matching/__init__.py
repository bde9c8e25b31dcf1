"""From two surfaces to a map: strategies are tried, each under its model, and the map that verifies best is taken."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
