"""Units of the shapes of a collection: what each is multiplied by, so that all are in those of the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np

from isomatch.collections.ledger import Rows
from isomatch.errors import InputError
from isomatch.statistics import METRES

FARTHEST = 2.0  # factor between sizes of one kind that a unit leaves unexplained

OTHERS = "*"
"""Stands for all shapes whose units are not given."""


def checked_units(units: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    """Return the units of shapes by name; `InputError` if a name or a unit is not known."""
    if strangers := sorted(set(units) - {OTHERS, *names}):
        raise InputError(f"{', '.join(strangers)}: units of no shape of this collection; give their names")
    if unknown := sorted({*units.values()} - set(METRES)):
        raise InputError(f"{', '.join(unknown)}: unknown units; known are {', '.join(METRES)}")
    return dict(units)


def common_unit(units: Mapping[str, str], rows: Rows) -> str | None:
    """Return the unit of the shapes whose units are not given, in which all are brought together.

    If that is not given, it is the one in which the sizes of the given shapes are nearest to those of the others; None if
    it is farther than a factor of two from them.
    """
    named = {name: unit for name, unit in units.items() if name != OTHERS}
    if OTHERS in units or not named:
        return units.get(OTHERS)
    sizes = {name: row["area"] ** 0.5 for name, row in rows.shapes.items() if row.get("area")}
    others = [size for name, size in sizes.items() if name not in named]
    known = [sizes[name] * METRES[unit] for name, unit in named.items() if name in sizes]
    if not others:
        return Counter(named.values()).most_common(1)[0][0]
    if not known:
        return None
    ratio = float(np.median(known)) / float(np.median(others))  # metres in the unit of the others
    nearest = min(METRES, key=lambda unit: abs(np.log(ratio / METRES[unit])))
    return nearest if abs(np.log(ratio / METRES[nearest])) < np.log(FARTHEST) else None


def scales_of(units: Mapping[str, str], rows: Rows) -> dict[str, float]:
    """Return what the positions of a shape are multiplied by, for those for which it is not 1."""
    common = common_unit(units, rows)
    if common is None:
        return {}
    return {
        name: METRES[unit] / METRES[common]
        for name, unit in units.items()
        if name != OTHERS and unit != common
    }
