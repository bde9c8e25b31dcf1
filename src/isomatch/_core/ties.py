"""Choices among equal values by a rule, as rounding differs from machine to machine."""

from __future__ import annotations

import numpy as np

from isomatch._core.arrays import FloatArray

# Values that differ by less than this share of the largest value count as equal, so that rounding does not decide
# which side of a symmetric shape comes first: in a horse, the error of matching a part rose from 2.8 to 10.4 % of
# √area. The share is far above the changes from rounding coordinates to 1e-9 of their extent. Different values are
# rarely so close: one pair among 1000 values, in one shape of ten.
TIE_RATIO = 1e-7


def first_largest(values: FloatArray) -> int:
    """Return the index of the first value (n,) that equals the largest."""
    most = values.max()
    ties = values >= most - TIE_RATIO * abs(most) if np.isfinite(most) else values
    return int(ties.argmax())


def first_of_rank(values: FloatArray, rank: int) -> int:
    """Return the index of the first value (n,) that equals the one of a rank; rank 0 is the smallest."""
    value = np.partition(values, rank)[rank]
    return int((np.abs(values - value) <= TIE_RATIO * np.abs(values).max()).argmax())
