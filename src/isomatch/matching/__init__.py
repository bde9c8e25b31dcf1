"""From two surfaces to a map: strategies, models, and the choice between maps."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
