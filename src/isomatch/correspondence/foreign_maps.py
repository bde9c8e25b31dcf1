"""Maps of other programs: which array of a file is the map, and whether its indices count from 0 or from 1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from isomatch.errors import FormatError, SettingError
from isomatch.values.arrays import AnyArray, IntArray

_MOST_NAMED = 8  # arrays that a message lists


class IndexBase(NamedTuple):
    """What indices count from, and how that was found.

    Parameters
    ----------
    counts_from : int
        0 or 1.
    is_certain : bool
        Whether the file says so or was said to, or no other reading fits.
    is_likely : bool
        Whether the other reading, if one fits, is unlikely.
    note : str
        What was decided; empty if nothing had to be.

    Examples
    --------
    >>> IndexBase(1)
    IndexBase(counts_from=1, is_certain=True, is_likely=True, note='')
    """

    counts_from: int
    is_certain: bool = True
    is_likely: bool = True
    note: str = ""


class Counted(NamedTuple):
    """The indices of a map, counted from 0, and how that was found.

    Parameters
    ----------
    image : (n_source,) array of int
        Target vertex of each source vertex; −1 if unmatched.
    base : IndexBase
        What the file counts from.
    """

    image: IntArray
    base: IndexBase


def the_vector(
    path: Path, arrays: Mapping[str, Any], n_source: int | None, variable: str | None = None
) -> AnyArray:
    """Choose the array that is a map, one number for each source vertex, by its shape or its name.

    Raises
    ------
    FormatError
        If there is none, or several and none is named.
    """
    found = {name: np.squeeze(value) for name, value in arrays.items() if isinstance(value, np.ndarray)}
    held = ", ".join(f"{name} {value.shape}" for name, value in [*found.items()][:_MOST_NAMED]) or "no array"
    if variable is not None:
        if variable not in arrays:
            raise FormatError(f"{path}: has no variable {variable!r}; it holds {held}")
        found = {name: value for name, value in found.items() if name == variable}
    fitting = {
        name: value
        for name, value in found.items()
        if value.ndim == 1 and value.dtype.kind in "iuf" and n_source in (None, len(value))
    }
    vertices = "vertices" if n_source is None else f"{n_source} vertices"
    if not fitting:
        raise FormatError(
            f"{path}: not a map (no array has one number for each of the source's {vertices}); it holds {held}; give the "
            "map of these two shapes in this direction"
        )
    if len(fitting) > 1:
        names = ", ".join(fitting)
        raise FormatError(
            f"{path}: {names} could each be the map of the source's {vertices}; name one of them as variable, or save it "
            "alone"
        )
    return next(iter(fitting.values()))


def counted_from_zero(path: Path, given: AnyArray, n_target: int | None, counts_from: int | None) -> Counted:
    """Read indices that count from 0 or from 1, see `index_base`; −1 and nan, and 0 if they count from 1, mean unmatched.

    Raises
    ------
    FormatError
        If entries are no such indices, or fit neither reading.
    SettingError
        If ``counts_from`` is neither 0 nor 1.
    """
    if counts_from not in (None, 0, 1):
        raise SettingError(f"counts_from = {counts_from!r} is neither 0 nor 1")
    if given.dtype.kind == "f":
        numbers = np.where(np.isnan(given), -1, given)
        if (numbers != np.rint(numbers)).any() or (np.abs(numbers) > 2**53).any():
            raise FormatError(f"{path}: not a map (fractions are no vertices); give whole numbers")
        given = numbers
    image = given.astype(np.int64)
    base = index_base(path, image, n_target) if counts_from is None else IndexBase(counts_from)
    if base.counts_from == 1:
        image = np.where(image > 0, image - 1, np.where(image == 0, -1, image))
    return Counted(image, base)


def index_base(path: Path, indices: AnyArray, n: int | None, what: str = "target vertices") -> IndexBase:
    """Find whether indices count from 0 or from 1, where 0 may mean unmatched.

    - The largest is ``n``, and none is 0: from 1, for certain.
    - There are 0 and −1, which then means unmatched, or each index from 0 to the largest once: from 0, for certain.
    - There are 0 and no −1: likely from 0; but not if there are several 0, more than of any other index, as where 0 means
      unmatched.
    - Otherwise from 0, which is not likely.

    Parameters
    ----------
    path : Path
        File, for messages.
    indices : (m,) array
        Whole numbers; −1 means unmatched.
    n : int or None
        Number of what they are indices of, if it is known.
    what : str
        What they are indices of.

    Raises
    ------
    FormatError
        If there are both 0 and ``n``.

    Examples
    --------
    >>> index_base(Path("map.txt"), np.array([2, 4, 1]), 4).note
    'map.txt: counts from 1, as its largest index, 4, is the number of target vertices'
    >>> index_base(Path("map.txt"), np.array([2, 0, 1, 2]), 4)[:3]  # likely from 0
    (0, False, True)
    >>> index_base(Path("map.txt"), np.array([2, 0, -1, 2]), 4)[:3]
    (0, True, True)
    """
    held = indices[indices >= 0].astype(np.int64)
    if not len(held):
        return IndexBase(0)
    least, most = int(held.min()), int(held.max())
    if most == n and least == 0:
        raise FormatError(
            f"{path}: has both 0 and {n}, the number of {what}; if it counts from 1, and 0 means unmatched, say that it "
            "counts from 1, or else give the map of these two shapes"
        )
    if most == n:
        note = f"{path.name}: counts from 1, as its largest index, {most}, is the number of {what}"
        return IndexBase(1, note=note)
    if least > 0:
        note = "" if n is None else f"{path.name}: taken to count from 0; it has neither 0 nor {n}"
        return IndexBase(0, False, False, note)
    _, times = np.unique(held, return_counts=True)
    if len(held) < len(indices) or len(held) == len(times) == most + 1:
        return IndexBase(0)
    if times[0] > max(1, times[1:].max(initial=0)):
        note = f"{path.name}: taken to count from 0; it has {times[0]} of it, which mean unmatched if it counts from 1"
        return IndexBase(0, False, False, note)
    return IndexBase(0, False)
