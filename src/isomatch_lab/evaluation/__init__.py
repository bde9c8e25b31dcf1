"""Maps against the truth: errors, curves, and runs over benchmark sets."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
