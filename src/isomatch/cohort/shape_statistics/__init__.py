"""Statistics of shapes in correspondence: alignment, modes of variation, groups and distances."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
