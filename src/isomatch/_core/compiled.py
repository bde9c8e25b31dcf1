"""Compiled loops: functions that numba compiles at their first call and keeps between runs.

They copy arrays element by element, because assigning an array to a slice takes 2 s to compile.
Constants of other modules are arguments, because the cache does not see that they change.
"""

from __future__ import annotations

import gc
import logging
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

import numba
from numba.core import event

F = TypeVar("F", bound=Callable[..., Any])
# warning if numba can write no compiled loop to a folder
UNCACHED = (
    "isomatch: compiled loops cannot be cached here; each run compiles them again, 10 to 20 s for a match; "
    "set NUMBA_CACHE_DIR to a folder of your own that can be written"
)


def compiled(**options: Any) -> Callable[[F], F]:
    """Decorate a loop: `numba.njit` compiles it at its first call, to run without the interpreter lock."""
    # the loops are never called from C, and compile faster without a wrapper for C
    options = {"nogil": True, "no_cfunc_wrapper": True, **options}

    def decorate(function: F) -> F:
        try:
            return cast(F, numba.njit(cache=True, **options)(function))
        except RuntimeError:  # there is no folder that numba can write to
            _warn_once()
            return cast(F, numba.njit(**options)(function))

    return decorate


class CollectorPause(event.Listener):  # type: ignore[misc]  # numba has no types
    """Pause Python's cycle collector while numba compiles, which then takes a fifth less time (measured)."""

    # Number of compilations under way, which are nested if a loop calls another one (numba's lock lets only
    # one thread compile), and whether the collector was at work before the first of them.
    depth, resume = 0, False

    def on_start(self, event: event.Event) -> None:
        """Stop the collector at the outermost compilation."""
        self.depth += 1
        if self.depth == 1:
            self.resume = gc.isenabled()
            gc.disable()

    def on_end(self, event: event.Event) -> None:
        """Let the collector work again, if it did before."""
        self.depth -= 1
        if self.depth == 0 and self.resume:
            gc.enable()


event.register("numba:compile", CollectorPause())


@cache
def _warn_once() -> None:
    logging.getLogger(__name__).warning(UNCACHED)
