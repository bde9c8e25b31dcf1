"""Options that several commands of ``isomatch collect`` have."""

from __future__ import annotations

import re
from os.path import isfile
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from isomatch._core.errors import InputError
from isomatch._core.texts import text_lines
from isomatch.cli.inputs import split_words
from isomatch.cohort import Semilandmarks

# options of the commands, by the types of their parameters
Reports = Annotated[
    int | Literal["doubtful", "all", "none"],
    Parameter(
        help="Which pairs get a report: this many of the worst, all, none, or doubtful (default): those on the page that "
        "did not converge, and three others."
    ),
]
Jobs = Annotated[int | None, Parameter(help="Pairs at a time; by default one for each processor.")]
Executor = Annotated[
    str,
    Parameter(
        help="local (default), or dask:ADDRESS, the scheduler of a Dask cluster whose workers see the same files."
    ),
]
TimeLimit = Annotated[float | None, Parameter(help="Seconds after which nothing new is begun.")]
SemilandmarkOptions = Annotated[Semilandmarks | None, Parameter(name="*")]  # an option for each field


def names_of(reflect: str | None) -> str | list[str] | None:
    """Read what ``--reflect`` says."""
    if reflect is None or reflect == "auto":
        return reflect
    if reflect == "none":
        return []
    is_file = isfile(reflect)
    return [line for _, line in text_lines(Path(reflect))] if is_file else split_words(reflect, "--reflect")


def units_of(units: str | None) -> dict[str, str] | None:
    """Read what ``--units`` says."""
    if units is None or units == "none":
        return None if units is None else {}
    pairs = [pair.strip().rpartition("=") for pair in units.split(",")]
    return {name.strip() or "*": unit.strip() for name, _, unit in pairs}


def shard_of(shard: str) -> tuple[int, int]:
    """Read what ``--shard`` says: the index of a shard, from 0, and their number."""
    place = re.fullmatch(r"([1-9]\d{0,5})/([1-9]\d{0,5})", shard)
    if not place or int(place[1]) > int(place[2]):
        raise InputError(f"--shard {shard}: is not i/n with 1 ≤ i ≤ n, such as 2/8")
    return int(place[1]) - 1, int(place[2])
