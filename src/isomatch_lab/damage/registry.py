"""The registry of damages, and the choice of one by name, level and side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self
from zlib import crc32

from isomatch._core.errors import SettingError
from isomatch_lab.damage.damaged import (
    SHARE_RANGE,
    Damaged,
    DamagedPair,
    damaged_pair,
    require_between,
    undamaged,
)
from isomatch_lab.damage.disturbed import (
    DENSITY_RATIO_RANGE,
    DISTANCE_RANGE,
    GAP_RANGE,
    decimate,
    merge,
    noise,
    resample,
    weld,
)
from isomatch_lab.damage.missing import VIEW_COUNT_RANGE, cut, holes, limb_removed, view
from isomatch_lab.sets import BenchmarkPair

SIDES = ("source", "target", "both")  # shapes that may be damaged


@dataclass(frozen=True)
class Damage:
    """A kind of damage, as benchmarks run it.

    Parameters
    ----------
    function : callable
        Takes a mesh and a level, and ``seed``; returns a `Damaged`.
    level : str
        What the level is.
    levels : tuple of float
        Levels of a curve, from mild to severe.
    default : float
        The level where none is named; the default of the function.
    bounds : (float, float)
        Between these lies every level that is allowed.
    """

    function: Callable[..., Damaged]
    level: str
    levels: tuple[float, ...]
    default: float
    bounds: tuple[float, float]


DAMAGES = {
    "cut": Damage(cut, "share of the area removed", (0.15, 0.3, 0.5), 0.3, SHARE_RANGE),
    "holes": Damage(holes, "share of the area removed", (0.1, 0.25, 0.4), 0.25, SHARE_RANGE),
    "limb_removed": Damage(limb_removed, "share of the area removed", (0.05, 0.09, 0.18), 0.09, SHARE_RANGE),
    "view": Damage(view, "number of cameras", (4, 2, 1), 1, VIEW_COUNT_RANGE),
    "weld": Damage(weld, "gap / √area", (0.01, 0.02, 0.04), 0.02, GAP_RANGE),
    "merge": Damage(merge, "distance / mean edge length", (0.7, 1.0, 1.5, 2.0), 1.5, DISTANCE_RANGE),
    "noise": Damage(noise, "standard deviation / mean edge length", (0.1, 0.3, 0.6), 0.3, DISTANCE_RANGE),
    "decimate": Damage(decimate, "share of the vertices kept", (0.5, 0.25, 0.1), 0.25, SHARE_RANGE),
    "resample": Damage(resample, "ratio of densities from end to end", (4, 16, 64), 16, DENSITY_RATIO_RANGE),
}
"""The registry: every damage by its name. To add a damage, add an entry."""


@dataclass(frozen=True)
class DamageChoice:
    """A damage of the registry at one level, and the shapes of a pair that suffer it.

    Its text is ``NAME:LEVEL``, followed by ``@source`` or ``@both`` unless the target suffers it.

    Parameters
    ----------
    name : str
        Key of ``DAMAGES``.
    level : float, optional
        See `Damage`; by default the default of the damage.
    side : {"source", "target", "both"}
        Which shape suffers it.

    Raises
    ------
    SettingError
        If the name or side is unknown, or the level is out of bounds.

    Examples
    --------
    >>> DamageChoice.parse("cut"), str(DamageChoice.parse("noise:0.6@both"))
    (DamageChoice(name='cut', level=0.3, side='target'), 'noise:0.6@both')
    """

    name: str
    level: float | None = None
    side: str = "target"

    def __post_init__(self) -> None:
        if self.name not in DAMAGES:
            raise SettingError(f"unknown damage {self.name!r}; choose from {', '.join(DAMAGES)}")
        if self.side not in SIDES:
            raise SettingError(f"side {self.side!r} of damage {self.name!r} is not one of {', '.join(SIDES)}")
        damage = DAMAGES[self.name]
        level = damage.default if self.level is None else self.level
        require_between(f"level of {self.name}", level, damage.bounds)
        object.__setattr__(self, "level", level)

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``NAME``, ``NAME:LEVEL``, ``NAME@SIDE`` or ``NAME:LEVEL@SIDE``.

        Raises
        ------
        SettingError
            If the name or side is unknown, or the level is no number within its bounds.
        """
        kind, _, side = text.partition("@")
        name, _, level = kind.partition(":")
        try:
            number = float(level) if level else None
        except ValueError:
            message = f"damage {text!r} has {level!r} in the place of a number; write NAME:LEVEL"
            raise SettingError(message) from None
        return cls(name, number, side or "target")

    def __call__(self, pair: BenchmarkPair, seed: int = 0) -> DamagedPair:
        """Damage a pair; the seed and the names of the shapes determine what is drawn."""
        function = DAMAGES[self.name].function
        source, target = (
            function(mesh, self.level, seed=crc32(f"{pair.name} {side} {seed}".encode()))
            if self.side in (side, "both")
            else undamaged(mesh)
            for side, mesh in (("source", pair.source), ("target", pair.target))
        )
        return damaged_pair(pair, source, target)

    def __str__(self) -> str:
        return f"{self.name}:{self.level:.12g}" + f"@{self.side}" * (self.side != "target")
