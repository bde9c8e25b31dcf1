"""Old names keep working for one more version, with a warning that gives the new name."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pkgutil import resolve_name
from types import ModuleType
from typing import Any
from warnings import warn

REMOVED_IN = "0.3"

RENAMED = {"isomatch.maps": "isomatch.correspondence"}
"""New full name of every old one: a module, or a name in a module."""


def old_attributes(**renamed: str) -> Callable[[Any, str], Any]:
    """Make the ``__getattr__`` of a class of which some attributes were renamed: old name = new name."""

    def current(self: Any, name: str) -> Any:
        if name not in renamed:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        _warn(f"{type(self).__name__}.{name}", renamed[name])
        return getattr(self, renamed[name])

    return current


def _warn(old: str, new: str) -> None:
    """Warn whoever used an old name: two frames up."""
    message = f"{old} is now {new}; the old name will be removed in isomatch {REMOVED_IN}"
    warn(message, DeprecationWarning, stacklevel=3)


def old_names(module: str) -> Callable[[str], Any]:
    """Make the ``__getattr__`` of a module or package of which a part was renamed.

    Parameters
    ----------
    module : str
        Full name of the module. Call this at its end: what the old names stand for must exist.

    Returns
    -------
    callable
        Gives what an old name stands for, with a `DeprecationWarning`; `AttributeError` for any other name.
    """
    for old, new in RENAMED.items():
        if old.rpartition(".")[0] == module and find_spec(new) is not None:
            # So that ``from isomatch.old import name`` works too. The stand-in passes every name on.
            stand_in = sys.modules[old] = ModuleType(old, f"The old name of `{new}`.")
            vars(stand_in)["__getattr__"] = old_names(old)

    def current(name: str) -> Any:
        old = f"{module}.{name}"
        new = RENAMED.get(old)
        # Python asks every module for names such as __path__; those are not ours.
        if new is None and module in RENAMED and not name.startswith("__"):
            new = f"{RENAMED[module]}.{name}"
        if new is None:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        found = resolve_name(new)
        _warn(old, new)
        return found

    return current
