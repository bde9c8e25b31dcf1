"""The loops that a first match compiles, and all others, with the types of arguments that isomatch gives them.

The list is beside this file. ``python tests/test_ahead.py`` records it.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import get_data
from typing import Any, NamedTuple

MATCH, FILES, OTHERS = SECTIONS = ("match", "files", "others")
"""What `isomatch.match` compiles for two complete meshes, what ``isomatch match`` compiles besides, and the rest."""


class ListedLoop(NamedTuple):
    """A loop for some types of arguments.

    Parameters
    ----------
    section : str
        One of `SECTIONS`.
    module, name : str
        Where the loop is.
    types : tuple of str
        ``float64`` for a number, ``float64x7`` for a tuple of seven, ``float64:2C`` for an array of two dimensions in
        C order, ``float64:2Cr`` for one that is read only.
    """

    section: str
    module: str
    name: str
    types: tuple[str, ...]

    @property
    def loop(self) -> Any:
        """The loop itself; None where the module has changed since the list was recorded."""
        try:
            found = getattr(import_module(self.module), self.name, None)
        except ModuleNotFoundError:
            return None
        return found if hasattr(found, "py_func") else None


def listed_loops(*sections: str) -> list[ListedLoop]:
    """List the loops of some sections in the order in which they are first called."""
    return [one for one in _all_listed() if one.section in sections]


@cache
def _all_listed() -> list[ListedLoop]:
    text = (get_data(__package__, "loops.txt") or b"").decode()
    lines = (line.split() for line in text.splitlines() if line and line[0] != "#")
    return [ListedLoop(section, module, name, tuple(types)) for section, module, name, *types in lines]
