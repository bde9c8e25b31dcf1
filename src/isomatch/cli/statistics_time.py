"""``isomatch statistics time``: how a series of shapes in one topology moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from isomatch import cohort
from isomatch.cli.inputs import Force, Output
from isomatch.cli.terminal import TALK, Talk, complain, say, say_rows


def over_time(
    folder: Path,
    /,
    *,
    output: Output,
    regions: Path | None = None,
    reference: str | None = None,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Tell how a series of shapes in one topology moves: area, volume, thickness and strain over time, by region.

    Args:
        folder: Folder of meshes with the same faces, frame2 before frame10; or folder of isomatch collect.
        output: Folder for time.csv, time.png, and strain/NAME.vtp, each shape with the measures of its faces.
        regions: Labels of the vertices: a table, .npy, .annot, .label.gii, or the template's file, if it has one label.
        reference: Name of the shape that is not strained; by default the first one.
    """
    how: dict[str, Any] = {"regions": regions, "reference": reference, "force": force}
    with talk.progress() as tell:
        found = cohort.series(folder, output, **how, progress=tell, warn=complain)

    def summary() -> None:
        say(found.told[0], "bold")
        say_rows([("note", note) for note in found.record["notes"]])
        say(f"open first: {output / 'time.png'}; the table is time.csv")

    talk.result(found.to_json(), summary)
