"""From two surfaces to a map: prepare → starts → search → select → refine → result."""

from isomatch.loading.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
