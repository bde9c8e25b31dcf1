"""Assets: surface files with all that they carry, and the one mesh of each that is matched."""

from isomatch._first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
