"""Array types in signatures, with shapes and index spaces, and arrays of user input.

``Int[SearchRows, "m_s"]`` is an array of integers of shape (m_s,) that are search rows, ``Float[FloatArray, "n 3"]`` one
of floating-point numbers. A letter is one length within a signature, ``_`` any. mypy tells the index spaces apart; tests
check the shapes by jaxtyping, which reads the same annotations.
"""

from typing import Annotated as Bool
from typing import Annotated as Float
from typing import Annotated as Int
from typing import Any, NewType

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.floating[Any]]  # double precision unless a docstring says otherwise
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
AnyArray = NDArray[Any]

# These types tell what integers number. Indexing such an array, or adding to it, gives an `IntArray`.
UserVertices = NewType("UserVertices", IntArray)
"""Vertices of a surface, in the numbers that the user or the file gave them."""
BodyVertices = NewType("BodyVertices", IntArray)
"""Vertices of a body, the part of a surface that is matched, or of a variant of it."""
PartVertices = NewType("PartVertices", IntArray)
"""Vertices of a shape that is matched as a part of another one, whose vertices are those of a body."""
SearchRows = NewType("SearchRows", IntArray)
"""Numbers of search vertices, the first samples of a body: ``pair.target_vertices[rows]`` are its vertices."""
SampleRows = NewType("SampleRows", IntArray)
"""Numbers of other samples: refinement vertices, anchors, samples of two parts."""
SoughtRows = NewType("SoughtRows", IntArray)
"""Numbers of the vertices among which an elastic fit seeks images."""


def array_of(values: ArrayLike, name: str, error: type[Exception]) -> AnyArray:
    """Make an array of user input; raise ``error`` if its rows have different lengths."""
    try:
        array: AnyArray = np.asarray(values)
        return array
    except ValueError:
        raise error(f"{name} have rows of different lengths; give as many numbers in each row") from None


def read_only(array: AnyArray) -> AnyArray:
    """Return a read-only view; loops are compiled separately for such arrays."""
    view = array.view()
    view.flags.writeable = False
    return view


def numbers_of(values: ArrayLike, name: str, error: type[Exception]) -> FloatArray:
    """Make a new float64 array of user input; raise ``error`` if it is not of real numbers."""
    array = array_of(values, name, error)
    if array.size and array.dtype.kind not in "fiub":
        raise error(f"{name} have type {array.dtype}, expected real numbers")
    return np.array(array, dtype=np.float64, order="C")


def single(values: FloatArray) -> Float32Array:
    """Round to single precision, which is twice as fast in products and searches."""
    return np.asarray(values, dtype=np.float32)


__all__ = [
    "AnyArray",
    "BodyVertices",
    "Bool",
    "BoolArray",
    "Float",
    "Float32Array",
    "FloatArray",
    "Int",
    "IntArray",
    "PartVertices",
    "SampleRows",
    "SearchRows",
    "SoughtRows",
    "UserVertices",
    "array_of",
    "numbers_of",
    "read_only",
    "single",
]
