"""What numba makes of a loop: kept between runs where it can write its cache, and compiled in every run elsewhere."""

from __future__ import annotations

import gc
import logging
import math
import os
import pickle
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, update_wrapper, wraps
from multiprocessing import current_process
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import FunctionCache
from numba.core.errors import TypingError

from isomatch.errors import UnwritableFileError
from isomatch.loading.listed import MATCH, listed_loops
from isomatch.loading.second_process import ask_for_help
from isomatch.runtime.locks import Turn

UNREADABLE = (OSError, EOFError, pickle.UnpicklingError)
PATIENCE = 30.0  # seconds to wait for another process that compiles a loop; the longest takes 1 s
SECONDS = 0.3  # to compile a loop of a first match, the mean: docs/performance.md; slower processors take twice as long
HELPED = 0.65  # of the time that it takes alone, with a second process
COMPILING = (
    "isomatch: compiling {count} loops or more, once, which takes {least} to {most} s; "
    "later runs find them in the cache"
)
COMPILING_FEW = "isomatch: compiling loops of a step that is new here; later runs find them in the cache"
UNCACHED = (
    "isomatch: compiled loops cannot be cached here, so each run compiles them again, which takes 6 to 12 s for a match; "
    "set NUMBA_CACHE_DIR to a folder of your own that can be written"
)
logger = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., Any])


def dispatcher_of(function: FunctionType, scope: dict[str, Any], options: dict[str, Any]) -> Any:
    """Make the dispatcher of a function with other globals and with options of `numba.njit`."""
    code, defaults, closure = function.__code__, function.__defaults__, function.__closure__
    inside = FunctionType(code, scope, function.__name__, defaults, closure)
    options = {"nogil": True, "no_cfunc_wrapper": True, **options}  # C does not call loops
    dispatcher: Any = numba.njit(**options)(update_wrapper(inside, function))
    if hasattr(dispatcher, "compile"):
        dispatcher.compile = _uncollected(dispatcher.compile)
    try:
        dispatcher._cache = kept = _Cache(function)
        if hasattr(dispatcher, "compile"):
            dispatcher.compile = _with_its_turn(dispatcher.compile, kept)
    except RuntimeError:  # there is no folder that numba can write to
        _tell(UNCACHED)
    return dispatcher


def _uncollected(function: F) -> F:
    """Make a function run without Python's garbage collector, which takes an eighth of the time of numba."""

    @wraps(function)
    def changed(*arguments: Any) -> Any:
        enabled = gc.isenabled()
        gc.disable()
        try:
            return function(*arguments)
        finally:
            if enabled:
                gc.enable()

    return cast(F, changed)


def _with_its_turn(function: F, kept: _Cache) -> F:
    """Let others compile a loop that this process failed to compile."""

    @wraps(function)
    def changed(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except BaseException:
            kept.turn.end()
            raise

    return cast(F, changed)


def compile_for(dispatcher: Any, types: Sequence[str], must_be_kept: bool = False) -> bool:
    """Compile a loop for types of arguments as in `ListedLoop`, and tell whether that was necessary.

    Raises
    ------
    UnwritableFileError
        If it must be kept and the cache cannot be written.
    """
    if not hasattr(dispatcher, "stats"):  # numba is told to compile nothing
        return False
    before = sum(dispatcher.stats.cache_misses.values())
    with suppress(TypingError):  # the loop takes other arguments since the list was recorded
        dispatcher.compile(tuple(map(_type_of, types)))
    if must_be_kept:
        _require_kept(dispatcher._cache)
    return bool(sum(dispatcher.stats.cache_misses.values()) > before)


def _require_kept(kept: Any) -> None:
    wanted = os.environ.get("NUMBA_CACHE_DIR")  # numba takes another folder if it cannot write there
    is_there = isinstance(kept, _Cache) and kept.works
    if not is_there or (wanted and not Path(kept.cache_path).is_relative_to(wanted)):
        where = wanted or getattr(kept, "cache_path", "__pycache__ beside the package")
        raise UnwritableFileError(
            f"{where}: compiled loops cannot be written; set NUMBA_CACHE_DIR to a folder that can be written"
        )


def is_being_compiled(dispatcher: Any) -> bool:
    """Whether another process compiles a loop now."""
    kept: Any = dispatcher._cache
    free = not isinstance(kept, _Cache) or kept.turn.take()
    if isinstance(kept, _Cache):
        kept.turn.end()
    return not free


def _type_of(word: str) -> Any:
    types: Any = numba.types
    if "x" in word:
        kind, _, count = word.partition("x")
        return types.UniTuple(_type_of(kind), int(count))
    kind, _, array = word.partition(":")
    scalar = getattr(types, kind)
    return types.Array(scalar, int(array[0]), array[1], readonly=array[2:] == "r") if array else scalar


class _Cache(FunctionCache):
    """A cache that the loops can do without: what cannot be read or written is compiled for this process.

    Of several processes that lack a loop, one compiles it, and the others wait and find it in the cache.
    """

    def __init__(self, function: FunctionType):
        super().__init__(function)
        self.turn = Turn(Path(self._cache_file._index_path).with_suffix(".lock"))
        self.works = True

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._found(sig, target_context)
        if found is None:
            self.turn.take(PATIENCE)
            found = self._found(sig, target_context)
            if found is None:
                _begin_compiling()
            else:
                self.turn.end()
        return found

    def _found(self, sig: Any, target_context: Any) -> Any:
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
            self.works = False
            _tell(UNCACHED)
        finally:
            self.turn.end()

    @property
    def is_empty(self) -> bool:
        return not Path(self._cache_file._index_path).exists()


@cache  # once
def _begin_compiling() -> None:
    caches = [_Cache(loop.py_func) for loop in {one.loop: 0 for one in listed_loops(MATCH)} if loop]
    count = sum(one.is_empty for one in caches)
    if count <= 1:
        _tell(COMPILING_FEW)
        return
    least = math.ceil(SECONDS * count * (HELPED if ask_for_help(caches[0].cache_path) else 1.0))
    _tell(COMPILING.format(count=count, least=least, most=2 * least))


@cache  # so that it is told once
def _tell(message: str) -> None:
    """Log it: Python shows that on standard error, and unlike a warning it never becomes an exception."""
    if current_process().name == "MainProcess":  # the workers of a benchmark need not repeat it
        logger.warning(message)
