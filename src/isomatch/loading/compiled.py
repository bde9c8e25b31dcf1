"""Compiled loops: functions that numba compiles at their first call, and is imported only then."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import update_wrapper
from threading import RLock
from types import CodeType, FunctionType
from typing import Any, TypeVar, cast

from isomatch.runtime.interruption import stop_if_abandoned

F = TypeVar("F", bound=Callable[..., Any])


def compiled(**options: Any) -> Callable[[F], F]:
    """Decorate a loop to be compiled at its first call; it runs without the interpreter lock.

    It may call other loops by their global names, but not itself.

    Parameters
    ----------
    **options
        Those of `numba.njit`, such as ``fastmath``.
    """

    def decorate(function: F) -> F:
        return cast(F, Loop(cast(FunctionType, function), options))

    return decorate


class Loop:
    """A loop that waits for its first call; ``py_func`` is the function as it was written."""

    _building = RLock()

    def __init__(self, function: FunctionType, options: dict[str, Any]):
        self.py_func = function
        self.options = options
        self._dispatcher: Callable[..., Any] | None = None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop, unless nobody waits for its result any more."""
        stop_if_abandoned()
        return (self._dispatcher or self.dispatcher)(*arguments)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    @property
    def dispatcher(self) -> Any:
        """What numba makes of the loop; it sees the dispatchers of the loops that it calls, in a copy of its globals."""
        with self._building:
            if self._dispatcher is None:
                from isomatch.loading.dispatcher import dispatcher_of  # imports numba, which is slow

                scope = dict(self.py_func.__globals__)
                for name in _names(self.py_func.__code__):
                    if isinstance(called := scope.get(name), Loop):
                        scope[name] = called.dispatcher
                self._dispatcher = dispatcher_of(self.py_func, scope, self.options)
            return self._dispatcher


def _names(code: CodeType) -> Iterator[str]:
    """All global names and attributes that a function uses, also inside comprehensions."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
