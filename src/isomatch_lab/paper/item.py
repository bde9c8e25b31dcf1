"""The interface of every figure and table of the paper: its input and its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from isomatch import Mesh, SettingError
from isomatch._core.settings import Settings, setting
from isomatch.datasets import example_pair
from isomatch_lab.sets import tosca

UP_AXIS = 2  # vertical axis of TOSCA and of the creatures
RUNNERS_UP = {  # label and colour of other methods that are given landmarks
    "sgf_5pt": ("Spectral-GF", "#CC79A7"),
    "sgmds_5pt": ("SGMDS", "#009E73"),
    "functional_maps_5pt": ("functional maps", "#0072B2"),
}


def _silent(stage: str) -> None:
    """Report nothing."""


@dataclass(frozen=True)
class Setting(Settings):
    """What an item is made from.

    Parameters
    ----------
    data : Path, optional
        Folder of the benchmark sets, as for `benchmark_set`; not needed if quick.
    runs : Path
        Folder of benchmark runs: rows that are there are used, missing ones are added.
    quick : bool
        Use the shipped pair of creatures, and coarser computations.
    n_pairs, n_points, seed, jobs
        As for `BenchmarkRun`.
    progress : callable
        Called with the name of each stage.

    Raises
    ------
    SettingError
        If a number is out of range, or there is no folder of data though the run is not quick.
    """

    data: Path | None
    runs: Path
    quick: bool = False
    n_pairs: int = setting(12, least=1)
    n_points: int = setting(1000, least=100)
    seed: int = setting(0, least=0)
    jobs: int | None = setting(None, least=1)
    progress: Callable[[str], None] = field(default=_silent, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.data is None and not self.quick:
            raise SettingError(
                "no folder of meshes was given: the paper's shapes are those of TOSCA and SCAPE, which are not shipped; "
                "pass --data DIR (docs/dev/lab/benchmarks.md describes its layout), or --quick for the shipped creatures"
            )

    @property
    def folder(self) -> str | None:
        """Folder of the sets, as for `benchmark_set`."""
        return None if self.data is None else str(self.data)

    def shape(self, name: str) -> tuple[str, Mesh]:
        """Read a shape of TOSCA, or the shipped creature if quick; return its name and mesh."""
        if self.quick or self.data is None:
            return "creature", example_pair()[0].mesh
        return name, tosca(self.data / "tosca").mesh(name)


@dataclass(frozen=True)
class Verdict:
    """A claim of the paper, compared with measurements.

    Parameters
    ----------
    claim : str
        What the paper says.
    measured : str
        What was measured here.
    holds : bool
        Whether the measurement supports the claim.
    """

    claim: str
    measured: str
    holds: bool


@dataclass(frozen=True, eq=False)
class Reproduction:
    """What an item returns.

    Parameters
    ----------
    figure : Figure
        The picture.
    rows : list of dict
        The numbers: one dictionary for each line of the CSV, all with the same keys.
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
        Number of the figure in the paper, or "the table".
    title : str
        What it shows.
    make : callable
        Computes it.
    """

    origin: str
    title: str
    make: Callable[[Setting], Reproduction]
