"""``isomatch paper``: the figures and the table of the paper, reproduced."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from isomatch.cli.terminal import progress, say, say_json


def paper(
    name: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    data: Path | None = None,
    quick: bool = False,
    pairs: int = 12,
    points: int = 1000,
    seed: int = 0,
    jobs: int | None = None,
    runs: Path | None = None,
    json: bool = False,
    force: bool = False,
) -> None:
    """Reproduce a figure or the table of the paper: picture, numbers and verdicts.

    Parameters
    ----------
    name : str
        basis-error, basis-vectors, descriptor-distance, descriptor-field, curves-5pt, distortion-table, voronoi,
        curves-initialised, or all.
    output : Path
        Folder for NAME.png, NAME.svg, NAME.csv, NAME.json, and index.md about all items in it.
    data : Path
        Folder of the sets tosca and scape, as for isomatch bench.
    quick : bool
        Use the shipped pair of creatures and coarser computations; needs no data.
    pairs : int
        Number of pairs to draw from each set; the distortion table draws a sixth of it for each class.
    points : int
        Number of truth points to judge for each pair, at least 100.
    seed : int
        Seed of all draws.
    jobs : int
        Number of pairs to run at a time, each on one thread; by default one for each processor.
    runs : Path
        Folder of benchmark runs: rows that are there are used, missing ones are added; by default runs in the output
        folder.
    json : bool
        Print one JSON object and nothing else.
    force : bool
        Replace earlier files.
    """
    from isomatch.paper import ITEMS, Setting, reproduce  # matplotlib is slow to import

    with progress() as stage:
        setting = Setting(data, runs or output / "runs", quick, pairs, points, seed, jobs, stage)
        records = []
        for record in reproduce(list(ITEMS) if name == "all" else [name], setting, output, force):
            records.append(record)
            if not json:
                _say_record(record)
    if json:
        say_json({"folder": str(output), "items": records})


def _say_record(record: dict[str, Any]) -> None:
    say(f"{record['item']} ({record['origin']}): {record['title']}", "bold")
    for verdict in record["verdicts"]:
        holds = verdict["holds"]
        say(f"  {'holds' if holds else 'does not hold'}: {verdict['claim']}", "green" if holds else "red")
        say(f"    {verdict['measured']}")
