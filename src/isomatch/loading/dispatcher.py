"""What numba makes of a loop: kept between runs where it can write its cache, and compiled in every run elsewhere."""

from __future__ import annotations

import logging
import pickle
from contextlib import suppress
from functools import cache, update_wrapper
from multiprocessing import current_process
from types import FunctionType
from typing import Any

import numba
from numba.core.caching import FunctionCache

UNREADABLE = (OSError, EOFError, pickle.UnpicklingError)
COMPILING = "isomatch: compiling loops, which later runs find in the cache; all of them take about 4 s"
UNCACHED = (
    "isomatch: compiled loops cannot be cached here, so each run compiles them again (about 4 s); "
    "set NUMBA_CACHE_DIR to a folder of your own that can be written"
)
logger = logging.getLogger(__name__)


def dispatcher_of(function: FunctionType, scope: dict[str, Any], options: dict[str, Any]) -> Any:
    """Make the dispatcher of a function with other globals and with options of `numba.njit`."""
    code, defaults, closure = function.__code__, function.__defaults__, function.__closure__
    inside = FunctionType(code, scope, function.__name__, defaults, closure)
    dispatcher = numba.njit(nogil=True, **options)(update_wrapper(inside, function))
    try:
        dispatcher._cache = _Cache(function)
    except RuntimeError:  # there is no folder that numba can write to
        _tell(UNCACHED)
    return dispatcher


class _Cache(FunctionCache):
    """A cache that the loops can do without: what cannot be read or written is compiled for this process."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = None
        try:
            found = super().load_overload(sig, target_context)
        except UNREADABLE:
            with suppress(OSError):
                self.flush()
        if found is None:
            _tell(COMPILING)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError:
            _tell(UNCACHED)


@cache  # so that it is told once
def _tell(message: str) -> None:
    """Log it: Python shows that on standard error, and unlike a warning it never becomes an exception."""
    if current_process().name == "MainProcess":  # the workers of a benchmark need not repeat it
        logger.warning(message)
