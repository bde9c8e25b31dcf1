"""Choices among equals: by rule, not by rounding, which differs from machine to machine."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import FloatArray

# Share of the largest value; values that differ by less are equal. Rounding of coordinates by 1e-9 of the size changes
# distances by less; of a thousand samples, two that differ are equal by this in one shape of ten. Where rounding chose
# between the sides of a symmetric shape, a part of a horse was mapped with errors from 2.8 to 10.4.
TIE = 1e-7


def first_largest(values: FloatArray) -> int:
    """Index of the first of those values (n,) that equal the largest."""
    most = values.max()
    return int((values >= most - TIE * abs(most)).argmax()) if np.isfinite(most) else int(values.argmax())


def first_of_rank(values: FloatArray, rank: int) -> int:
    """Index of the first of those values (n,) that equal the one of a rank; rank 0 is the least."""
    value = np.partition(values, rank)[rank]
    return int((np.abs(values - value) <= TIE * np.abs(values).max()).argmax())
