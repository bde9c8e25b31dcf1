"""Names of the array types in signatures, whose shapes the docstrings give; arrays of what a user gave."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.floating[Any]]  # double precision unless a docstring says otherwise
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
AnyArray = NDArray[Any]


def array_of(values: ArrayLike, name: str, error: type[Exception]) -> AnyArray:
    """Make an array of what a user gave; the given kind of error if its rows have different lengths."""
    try:
        array: AnyArray = np.asarray(values)
        return array
    except ValueError:
        raise error(f"{name} have rows of different lengths; give as many numbers in each row") from None


def read_only(array: AnyArray) -> AnyArray:
    """View an array that cannot be written to; loops are compiled for such arrays and for others separately."""
    view = array.view()
    view.flags.writeable = False
    return view


def numbers_of(values: ArrayLike, name: str, error: type[Exception]) -> FloatArray:
    """Make a new float64 array of what a user gave; the given kind of error if it does not hold real numbers."""
    array = array_of(values, name, error)
    if array.size and array.dtype.kind not in "fiub":
        raise error(f"{name} have type {array.dtype}, expected real numbers")
    return np.array(array, dtype=np.float64, order="C")


def single(values: FloatArray) -> Float32Array:
    """Round to single precision: twice as fast in products and searches, where six digits are enough."""
    return np.asarray(values, dtype=np.float32)
