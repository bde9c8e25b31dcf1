"""A hash of what a surface is made of."""

from __future__ import annotations

from hashlib import blake2b

import numpy as np

from isomatch._arrays import AnyArray


def hash_of(kind: str, *arrays: AnyArray) -> str:
    """32 hexadecimal digits, the same on every machine, for a kind of surface and its arrays of float64 or int64."""
    found = blake2b(kind.encode(), digest_size=16)
    for array in arrays:
        found.update(str(array.shape).encode())
        found.update(np.ascontiguousarray(array, array.dtype.newbyteorder("<")).data)
    return found.hexdigest()
