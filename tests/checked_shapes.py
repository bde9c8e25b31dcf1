"""Shapes in the signatures of `isomatch.matching`, checked at every call by jaxtyping and beartype."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import reduce
from inspect import isclass, unwrap
from operator import or_
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import jaxtyping
import numpy as np
from beartype import beartype

from isomatch._core import compiled
from isomatch._core.arrays import BoolArray, Float32Array, FloatArray

KINDS = {FloatArray: jaxtyping.Float, Float32Array: jaxtyping.Float, BoolArray: jaxtyping.Bool}


def with_shapes(hint: Any) -> Any:
    """Turn ``Int[BodyVertices, "r"]``, an `Annotated`, into the type of jaxtyping; what has no shape may be anything."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return KINDS.get(parts[0], jaxtyping.Int)[np.ndarray, parts[1]]
    inside = tuple(map(with_shapes, parts))
    if origin in (Union, UnionType):
        return reduce(or_, inside)
    if origin in (list, tuple, Sequence):
        return origin[inside]
    return hint if hint in (NoneType, ...) else object


def checked(function: Any) -> Any:
    """Check the arguments and the result of a function that have a shape."""
    if not isclass(function):
        shaped = {name: hint for name, hint in function.__annotations__.items() if "Annotated[" in str(hint)}
        function.__annotations__ = {name: with_shapes(hint) for name, hint in shaped.items()}
    return beartype(function)


@contextmanager
def shapes_checked() -> Iterator[None]:
    """Check the shapes in all functions and dataclasses of `isomatch.matching`, which must be imported inside."""
    compile_loop = compiled.compiled  # numba compiles the loop itself
    compiled.compiled = lambda **options: lambda loop: compile_loop(**options)(unwrap(loop))
    with jaxtyping.install_import_hook("isomatch.matching", "checked_shapes.checked"):
        yield
    compiled.compiled = compile_loop
