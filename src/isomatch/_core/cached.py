"""Values that are computed once for each object and kept with it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

S = TypeVar("S")
P = ParamSpec("P")
R = TypeVar("R")

if TYPE_CHECKING or sys.version_info >= (3, 12):
    from functools import cached_property
else:

    class cached_property:
        """`cached_property` of Python 3.12, without the lock that all objects shared before."""

        def __init__(self, func: Any) -> None:
            self.func = func
            self.__doc__ = func.__doc__

        def __set_name__(self, owner: type, name: str) -> None:
            self.name = name

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            """Compute the value, unless it is known."""
            if instance is None:
                return self
            value = instance.__dict__[self.name] = self.func(instance)
            return value


def cached_method(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """Decorate a method: its results are kept with the object, by the arguments as written."""
    # A cache around the bound method would refer to its object. This cycle would delay freeing the arrays.
    name = f"results of {method.__qualname__}"

    @wraps(method)
    def remembered(self: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
        results = self.__dict__.setdefault(name, {})
        key = (args, *kwargs.items())
        if key not in results:
            results[key] = method(self, *args, **kwargs)
        result: R = results[key]
        return result

    return remembered


__all__ = ["cached_method", "cached_property"]
