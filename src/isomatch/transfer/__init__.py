"""Transfer: the attributes of one surface file carried to another by the map between them."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
