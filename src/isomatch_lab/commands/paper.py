"""``isomatch paper``: the figures and the table of the paper, reproduced."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from isomatch.cli import TALK, Talk, say


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
    force: bool = False,
    talk: Talk = TALK,
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
    force : bool
        Replace earlier files.
    talk : Talk
        What is told.
    """
    from isomatch_lab.paper import ITEMS, Setting, reproduce  # matplotlib is slow to import

    names = list(ITEMS) if name == "all" else [name]
    records: list[dict[str, Any]] = []
    with talk.progress() as tell:
        setting = Setting(
            data,
            runs or output / "runs",
            quick,
            pairs,
            points,
            seed,
            jobs,
            lambda stage: tell(stage, len(records) / len(names)),
        )
        for record in reproduce(names, setting, output, force):
            records.append(record)
            if not (talk.json or talk.json_lines or talk.quiet):
                _say_record(record)
        tell("done", 1.0)
    talk.result({"folder": str(output), "items": records}, lambda: None)


def _say_record(record: dict[str, Any]) -> None:
    say(f"{record['item']} ({record['origin']}): {record['title']}", "bold")
    for verdict in record["verdicts"]:
        holds = verdict["holds"]
        say(f"  {'holds' if holds else 'does not hold'}: {verdict['claim']}", "green" if holds else "red")
        say(f"    {verdict['measured']}")
