"""Pictures and reports of maps: both shapes side by side, corresponding points in the same colour."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
