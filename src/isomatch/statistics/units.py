"""Sizes that differ as much as units do: which shapes of a sample, and the units that explain it."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from isomatch.values.arrays import FloatArray

METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Units of length, in metres."""
SIZE_FACTOR = 2.0  # from the median size: less is not a matter of units, of which 2.54 is the smallest factor
SIZE_GAP = 5.0  # between two sizes that follow each other: no sample of one kind has it
DEVIATIONS = 6.0  # median absolute deviations, scaled to standard ones, from the median: beyond is an outlier
TO_STANDARD = 1.4826  # times the median absolute deviation is the standard deviation of a normal distribution
USUAL = (
    ("mm", "m"),
    ("mm", "cm"),
    ("cm", "m"),
    ("mm", "in"),
)  # of two pairs with one factor, what is tried first


def size_factors(sizes: FloatArray) -> FloatArray:
    """Find sizes so different from the others that it may be a matter of units.

    Parameters
    ----------
    sizes : (m,) array of float
        Sizes of the shapes of a sample, all positive, such as roots of areas.

    Returns
    -------
    (m,) array of float
        How many times as large as the median of the others each is, where it is more than twice or less than half the
        median and farther from it than six standard deviations (robust, of the logarithms), or where sizes fall in two
        groups, one five times as large; 1 for all others.

    Examples
    --------
    >>> size_factors(np.array([1.0, 1.2, 1050.0, 0.9, 1.1])).tolist()
    [1.0, 1.0, 1000.0, 1.0, 1.0]
    """
    if not len(sizes):
        return np.ones(0)
    logarithms = np.log(sizes)
    off = np.abs(logarithms - np.median(logarithms))
    odd = np.asarray(off > max(np.log(SIZE_FACTOR), DEVIATIONS * TO_STANDARD * float(np.median(off))))
    ordered = np.sort(sizes)
    gaps = ordered[1:] / ordered[:-1]
    if not odd.any() and gaps.max(initial=1.0) > SIZE_GAP:
        at = int(gaps.argmax())
        odd = sizes > ordered[at] if 2 * (at + 1) >= len(sizes) else sizes <= ordered[at]
    return np.where(odd, sizes / np.median(sizes[~odd]), 1.0)


def likely_units(factor: float) -> tuple[str, str] | None:
    """Name the units that explain why a shape is so many times as large as the others.

    Returns
    -------
    (str, str) or None
        That of the shape and that of the others, of `METRES`, whose ratio is nearest; None if none is within a factor
        of two.

    Examples
    --------
    >>> likely_units(940), likely_units(1 / 27), likely_units(1.3), likely_units(1e9)
    (('mm', 'm'), ('in', 'mm'), None, None)
    """
    turned = tuple((others, own) for own, others in USUAL)
    pairs = [*USUAL, *turned, *permutations(METRES, 2)]
    apart = [abs(np.log(factor * METRES[own] / METRES[others])) for own, others in pairs]
    best = int(np.round(apart, 9).argmin())
    none = abs(np.log(factor))
    return pairs[best] if apart[best] < min(none, np.log(SIZE_FACTOR)) else None


def told_factor(factor: float) -> str:
    """Say that a shape is so many times as large as the others, and which units would explain it."""
    text = f"is {factor:.4g} times as large as the others"
    units = likely_units(factor)
    return f"{text}: in {units[0]}, if they are in {units[1]}?" if units else text
