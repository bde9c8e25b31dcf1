"""Transfer: what one surface file carries, written onto another by the map between them."""

from isomatch.loading.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
