"""Values that are computed once for each object, on any number of threads, and kept with it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from threading import Lock, RLock
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

S = TypeVar("S")
P = ParamSpec("P")
R = TypeVar("R")


@dataclass
class _Computation:
    """A value that is being computed."""

    lock: RLock = field(default_factory=RLock)
    threads: int = 0  # number of threads that compute the value or wait for it


_GUARD = Lock()  # held while the next mapping changes
_COMPUTATIONS: dict[tuple[int, Hashable], _Computation] = {}  # under way, by id of object and name of value


@contextmanager
def _one_thread(owner: object, name: Hashable) -> Iterator[None]:
    """Let one thread at a time compute a value of an object; other values are not affected."""
    # Objects keep no locks, to remain picklable. No value needs itself, so threads never wait in a circle.
    key = id(owner), name
    with _GUARD:
        computation = _COMPUTATIONS.setdefault(key, _Computation())
        computation.threads += 1
    try:
        with computation.lock:
            yield
    finally:
        with _GUARD:
            computation.threads -= 1
            if not computation.threads:
                del _COMPUTATIONS[key]


if TYPE_CHECKING:
    from functools import cached_property
else:

    class cached_property:
        """`functools.cached_property`, computed by one thread while others wait."""

        def __init__(self, func: Any) -> None:
            self.func = func
            self.__doc__ = func.__doc__

        def __set_name__(self, owner: type, name: str) -> None:
            self.name = name

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            """Compute the value, unless it is known."""
            if instance is None:
                return self
            with _one_thread(instance, self.name):
                if self.name not in instance.__dict__:
                    instance.__dict__[self.name] = self.func(instance)
            return instance.__dict__[self.name]


def cached_method(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """Decorate a method: its results are kept with the object, by the arguments as written."""
    # A cache around the bound method would refer to its object. This cycle would delay freeing the arrays.
    name = f"results of {method.__qualname__}"

    @wraps(method)
    def remembered(self: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
        results = self.__dict__.setdefault(name, {})
        key = (args, *kwargs.items())
        if key not in results:
            with _one_thread(self, (name, key)):
                if key not in results:
                    results[key] = method(self, *args, **kwargs)
        result: R = results[key]
        return result

    return remembered


__all__ = ["cached_method", "cached_property"]
