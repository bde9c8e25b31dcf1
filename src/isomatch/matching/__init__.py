"""From two surfaces to a map: each relation that fits them is solved, and the evidence for its map is verified."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
