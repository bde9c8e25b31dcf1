"""Maps of other programs: which array of a file is the map, and whether its indices count from 0 or from 1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from isomatch.errors import FormatError, SettingError
from isomatch.values.arrays import AnyArray, IntArray

_MOST_NAMED = 8  # arrays that a message lists


class Counted(NamedTuple):
    """The indices of a map, counted from 0, and how that was found.

    Parameters
    ----------
    image : (n_source,) array of int
        Target vertex of each source vertex; −1 if unmatched.
    counts_from : int
        What the file counts from, 0 or 1.
    is_certain : bool
        Whether the file says so or was said to, or no other reading fits.
    note : str
        What was decided; empty if nothing had to be.
    """

    image: IntArray
    counts_from: int
    is_certain: bool
    note: str = ""


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


def counted_from_zero(
    path: Path, given: AnyArray, n_target: int | None, counts_from: int | None, is_matlab: bool = False
) -> Counted:
    """Read indices that count from 0 or from 1, where −1 and nan, and 0 if they count from 1, mean unmatched.

    Unless it is said, they count from 1 where the largest is the number of target vertices and none is 0, as no other
    reading fits. Otherwise they are taken to count from 0, which is certain only where there is a 0; in files of MATLAB,
    where several 0 often mean unmatched, only where there is one or −1 as well.

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
    if counts_from == 1:
        return Counted(np.where(image > 0, image - 1, np.where(image == 0, -1, image)), 1, True)
    held = image[image != -1]
    if counts_from == 0 or not len(held):
        return Counted(image, 0, True)
    least, most = int(held.min()), int(held.max())
    if most == n_target and least == 0:
        raise FormatError(
            f"{path}: has both 0 and {n_target}, the number of target vertices; if it counts from 1, and 0 means "
            "unmatched, say that it counts from 1, or else give the map of these two shapes"
        )
    if most == n_target and least > 0:
        note = f"{path.name}: counts from 1, as its largest index, {most}, is the number of target vertices"
        return Counted(np.where(image > 0, image - 1, -1), 1, True, note)
    if is_matlab and least == 0 and (held == 0).sum() > 1 and len(held) == len(image):
        note = f"{path.name}: has several 0, which may be a vertex or mean unmatched"
        return Counted(image, 0, False, note)
    if least <= 0:
        return Counted(image, 0, True)
    note = "" if n_target is None else f"{path.name}: taken to count from 0; it has neither 0 nor {n_target}"
    return Counted(image, 0, False, note)
