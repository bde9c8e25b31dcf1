"""Every setting of a match, in one frozen object."""

from __future__ import annotations

import tomllib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, Protocol

from isomatch.bases import Weighting
from isomatch.errors import SettingError

Orientation = Literal["preserve", "reverse", "any"]
Refinement = Literal["none", "laplace_icp", "joint", "smooth"]
Hypotheses = Literal["all", "given"]


class Settings(Protocol):
    """What the settings of every method, `match` or a baseline, can tell."""

    @property
    def orientation(self) -> Orientation:
        """Whether the map should keep the side of the surface that looks outward."""

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values."""


@dataclass(frozen=True)
class Config:
    """Settings of `prepare` and `match`; the defaults are what the benchmarks recommend.

    Parameters
    ----------
    n_columns : int
        Distance columns p for each shape.
    rank : int
        Rank k of the distance basis and length of the descriptor.
    n_functions : int
        Laplace–Beltrami functions for each shape.
    weights : {"area", "uniform"}
        Inner product of the distance basis; the paper uses "uniform".
    n_search : int
        Vertices of each shape on which starts are tried and compared.
    n_refine : int
        Source vertices on which the refinement iterates before its last, full step.
    hypotheses : {"all", "given"}
        Choose among automatic starts and those given, or only among those given. Automatic ones are tried in both
        cases, so that the result can tell when one of them fits better.
    refinement : {"none", "laplace_icp", "joint", "smooth"}
        After the alignment of distance descriptors: nothing (the paper's plain method), post-processing like the
        paper's, see `refine.by_laplace_icp`, or spectral upsampling joint with descriptors, coordinates and normals;
        "smooth" is "joint" with more care, and time, for a map that is smooth and nearly one to one.
    orientation : {"preserve", "reverse", "any"}
        Whether the map should keep the side of the surface that looks outward, turn it inside out (mirror), or
        whichever fits better.
    """

    n_columns: int = 100
    rank: int = 50
    n_functions: int = 200
    weights: Weighting = "area"
    n_search: int = 400
    n_refine: int = 1000
    hypotheses: Hypotheses = "all"
    refinement: Refinement = "joint"
    orientation: Orientation = "preserve"

    def __post_init__(self) -> None:
        for name, allowed in _CHOICES.items():
            if getattr(self, name) not in allowed:
                raise SettingError(
                    f"{name} = {getattr(self, name)!r} is not one of {', '.join(map(repr, allowed))}"
                )
        for name, least in _LEAST.items():
            value = getattr(self, name)
            if not isinstance(value, int) or value < least:
                raise SettingError(f"{name} = {value!r} is not an integer of at least {least}")
        if self.n_refine < 2 * self.n_functions:
            raise SettingError(
                f"n_refine = {self.n_refine} is below 2 n_functions = {2 * self.n_functions}: too few for the fit"
            )
        if self.rank > self.n_columns:
            raise SettingError(f"rank = {self.rank} exceeds n_columns = {self.n_columns}")

    @classmethod
    def from_file(cls, path: str | Path) -> Config:
        """Read settings from a TOML file; an unknown key is a `SettingError` that lists the known ones."""
        with Path(path).open("rb") as file:
            values = tomllib.load(file)
        known = [field.name for field in fields(cls)]
        unknown = sorted(set(values) - set(known))
        if unknown:
            raise SettingError(f"{path}: unknown setting {', '.join(unknown)}; known are {', '.join(known)}")
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values."""
        return asdict(self)


_CHOICES = {
    "weights": ("area", "uniform"),
    "hypotheses": ("all", "given"),
    "refinement": ("none", "laplace_icp", "joint", "smooth"),
    "orientation": ("preserve", "reverse", "any"),
}
_LEAST = {"n_columns": 8, "rank": 4, "n_functions": 20, "n_search": 100, "n_refine": 100}
