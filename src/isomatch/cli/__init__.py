"""The command line: one file for each command, and what a command of another package needs."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
