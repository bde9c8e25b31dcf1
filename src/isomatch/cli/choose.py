"""``isomatch choose``: continue with an alternative of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isomatch import matching, view
from isomatch.cli.earlier import Earlier
from isomatch.cli.inputs import naming_files
from isomatch.cli.outputs import BACK_REMOVED, say_files, say_result
from isomatch.cli.terminal import TALK, Talk, part, say_rows


def choose(
    folder: Path,
    number: int,
    /,
    *,
    details: Annotated[bool, Parameter(negative=())] = False,
    talk: Talk = TALK,
) -> None:
    """Make an alternative the map: refine and measure it, and replace the files of the result.

    The former map becomes alternative 1, and the other alternatives follow. A map of the other direction is removed;
    the file of --as-mesh stays what it was.

    Parameters
    ----------
    folder : Path
        Folder that isomatch match wrote. The two meshes are read from where they were then.
    number : int
        Number of the alternative in the report, from 1.
    details : bool
        Print every measure too, with its bound, and the seconds of each stage.
    talk : Talk
        What is told.
    """
    earlier = Earlier.read(folder)
    source, target, landmarks = earlier.source, earlier.target, earlier.landmarks or None
    with talk.progress() as tell, earlier.folder.claimed(force=True):
        tell("reading", 0.0)
        shapes = earlier.surfaces()
        with naming_files(source=source, target=target):
            result = matching.continue_with(
                earlier.result(*shapes), number, *shapes, landmarks, part(tell, 0.05, 0.85)
            )
        tell("writing", 0.85)
        had_back = earlier.folder.has_back
        record = earlier.folder.write(
            view.drawable(shapes[0]),
            view.drawable(shapes[1]),
            result,
            names=(source.name, target.name),
            titles=(f"source: {source.name}", f"target: {target.name}"),
            facts={"source": str(source), "target": str(target), "chosen": result.notes[0]},
            more={name: earlier.record[name] for name in ("source", "target", "match_again", "landmarks")},
            landmarks=landmarks,
            command=earlier.record["match_again"],
        )

    def summary() -> None:
        say_result(result, details)
        say_rows(("note", note) for note in [*([BACK_REMOVED] if had_back else []), *earlier.mesh_left])
        say_files(record)

    talk.result(record, summary)
