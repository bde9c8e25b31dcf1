"""Settings of the search for symmetries."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class SymmetrySettings(Settings):
    """Settings of the search for symmetries of one shape.

    Parameters
    ----------
    most : int
        Most assignments that are followed up; 0 searches for no symmetries.
    largest_residual : float
        Misfit of the distance descriptors, in units of √(average distance / number of search vertices), up to which a
        map is a symmetry: their spacing alone makes about 2.4.
    """

    most: int = setting(24, "docs/lab/benchmarks.md, symmetry", least=0)
    largest_residual: float = setting(3.2, "docs/lab/benchmarks.md, symmetry", least=0)
