"""Compiled loops: by numba, kept between runs where numba can write its cache, and compiled in every run elsewhere."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from multiprocessing import current_process
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache

F = TypeVar("F", bound=Callable[..., Any])
UNREADABLE = (OSError, EOFError, pickle.UnpicklingError)
logger = logging.getLogger(__name__)


def compiled(**options: Any) -> Callable[[F], F]:
    """Decorate a loop to be compiled at its first call; it runs without the interpreter lock.

    Parameters
    ----------
    **options
        Those of `numba.njit`, such as ``fastmath``.
    """

    def decorate(function: F) -> F:
        loop = numba.njit(nogil=True, **options)(function)
        try:
            loop._cache = _Cache(function)
        except RuntimeError:  # there is no folder that numba can write to
            _tell_uncached()
        return loop  # type: ignore[no-any-return]

    return decorate


class _Cache(FunctionCache):
    """A cache that the loops can do without: what cannot be read or written is compiled for this process."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except UNREADABLE:
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError:
            _tell_uncached()


@cache  # so that it is told once
def _tell_uncached() -> None:
    """Log it: Python shows that on standard error, and unlike a warning it never becomes an exception of an import."""
    if current_process().name == "MainProcess":  # the workers of a benchmark need not repeat it
        logger.warning(
            "isomatch: compiled loops cannot be cached here, so each run compiles them again (about 10 s); "
            "set NUMBA_CACHE_DIR to a folder of your own that can be written"
        )
