"""What every figure and table of the paper is made from, and what it has to give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from isomatch import Mesh, SettingError
from isomatch._settings import require_least
from isomatch.datasets import example_pair, tosca

RIVALS = {  # given landmarks: label, colour
    "sgf_5pt": ("Spectral-GF", "#CC79A7"),
    "sgmds_5pt": ("SGMDS", "#009E73"),
    "functional_maps_5pt": ("functional maps", "#0072B2"),
}


def _silent(stage: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Setting:
    """What is given to an item.

    Parameters
    ----------
    data : Path, optional
        Folder of the benchmark sets, as for `benchmark_set`; not needed if quick.
    runs : Path
        Folder of the benchmark run whose rows are used and added to.
    quick : bool
        Use the shipped pair of creatures, coarser.
    n_pairs, n_points, seed, jobs
        As for `BenchmarkRun`.
    progress : callable
        Told the name of each stage.
    """

    data: Path | None
    runs: Path
    quick: bool = False
    n_pairs: int = 12
    n_points: int = 1000
    seed: int = 0
    jobs: int | None = None
    progress: Callable[[str], None] = field(default=_silent, repr=False)

    def __post_init__(self) -> None:
        if self.data is None and not self.quick:
            raise SettingError(
                "no folder of meshes was given: the paper's shapes are those of TOSCA and SCAPE, which are not "
                "shipped; pass --data DIR (docs/benchmarks.md tells its layout), or --quick for the shipped creatures"
            )
        require_least(self, n_pairs=1, n_points=100, seed=0, jobs=1)

    @property
    def folder(self) -> str | None:
        """The folder of sets, as `benchmark_set` takes it."""
        return None if self.data is None else str(self.data)

    def shape(self, name: str) -> tuple[str, Mesh]:
        """Read a shape of TOSCA, or take the shipped creature; its name and mesh."""
        if self.quick or self.data is None:
            return "creature", example_pair()[0].mesh
        return name, tosca(self.data / "tosca").mesh(name)


@dataclass(frozen=True)
class Verdict:
    """A claim of the paper, held against numbers.

    Parameters
    ----------
    claim : str
        What the paper says.
    measured : str
        What was found here.
    holds : bool
        Whether the one bears out the other.
    """

    claim: str
    measured: str
    holds: bool


@dataclass(frozen=True, eq=False)
class Reproduction:
    """What an item gives.

    Parameters
    ----------
    figure : Figure
        The picture.
    rows : list of dict
        The numbers, a row for each line of the CSV; equal keys.
    verdicts : list of Verdict
        At least one.
    facts : dict
        Shapes, pairs and settings that the numbers belong to, plain values.
    """

    figure: Figure
    rows: list[dict[str, Any]]
    verdicts: list[Verdict]
    facts: dict[str, Any]


@dataclass(frozen=True)
class Item:
    """A figure or table of the paper.

    Parameters
    ----------
    origin : str
        Where it is in the paper.
    title : str
        What it shows.
    make : callable
        Makes it.
    """

    origin: str
    title: str
    make: Callable[[Setting], Reproduction]
