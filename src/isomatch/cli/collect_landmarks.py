"""``isomatch collect landmarks``: landmarks of some shapes of a collection, carried to all others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from isomatch import cohort
from isomatch.cli.cohort_words import say_landmarks
from isomatch.cli.collect_options import Marked
from isomatch.cli.inputs import Force
from isomatch.cli.terminal import TALK, Talk


def landmarks(
    folder: Path,
    marks: Path,
    to: Path,
    /,
    *,
    format: str = "mrk.json",
    semilandmarks: Marked = None,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Carry the landmarks of some shapes to all others: the median of what each of them gives.

    Args:
        folder: The folder of a collection.
        marks: Folder of the landmarks of some of its shapes, named like them, or one such file: .mrk.json or .fcsv of 3D
            Slicer, .pp of MeshLab, or a table name,x,y,z. A file of another name is that of the template.
        to: Folder for a file of each shape, and for R's geomorph landmarks.csv, with a row for each, and landmarks.tps:
            in the unit of the collection, and reflected, x → −x, where a shape was matched as its mirror image.
            landmarks_errors.csv has the expected error of each, and that of the marked shapes, carried from the others;
            landmarks_slid.csv how far points slid, and bending energies.
        format: Suffix of the files: mrk.json (default), fcsv, pp or csv. They have the spread over templates, but those
            of pp.
    """
    how: dict[str, Any] = {"semilandmarks": semilandmarks, "format": format, "force": force}
    with talk.progress() as tell:
        found = cohort.write_landmark_tables(folder, marks, to, **how, progress=tell)
    talk.result(found.to_json(), lambda: say_landmarks(found))
