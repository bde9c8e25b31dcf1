"""Other methods for comparison, with the signature and the result of `match` wherever that is possible."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
