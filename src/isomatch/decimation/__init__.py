"""Two resolutions of a surface: decimation, and points carried between the two."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
