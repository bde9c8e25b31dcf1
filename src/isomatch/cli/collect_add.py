"""``isomatch collect add``: new subjects of a finished collection, and how unusual they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from isomatch import cohort
from isomatch.cli.cohort_words import say_scored
from isomatch.cli.collect_options import Executor, Jobs, Reports, names_of, units_of
from isomatch.cli.terminal import TALK, Talk, complain, say


def add(
    folder: Path,
    /,
    *new: Path,
    model: Path | None = None,
    reflect: str | None = None,
    units: str | None = None,
    jobs: Jobs = None,
    executor: Executor = "local",
    reports: Reports = "doubtful",
    talk: Talk = TALK,
) -> None:
    """Match new subjects with the template of a finished collection, and tell how unusual each is to its shape model.

    All files that are there stay as they are: new ones are in the folder added, and nothing is fitted again. Run it again
    to continue, or to add more.

    Args:
        folder: The folder of a collection.
        new: Meshes, or a folder of them, or a list.csv with a column path and perhaps name. Their names, those of the
            files, are new ones.
        model: model.npz of isomatch statistics, made of this collection; by default FOLDER/statistics/model.npz.
        reflect: New subjects to match as their mirror images: auto, none, or their names. By default auto if that was
            asked for of the collection.
        units: Units of new subjects, such as scan7=mm. Where that of the collection is not known, it comes first:
            m,scan7=mm. A size whose unit is given is not questioned.
    """
    how: dict[str, Any] = {"reflect": names_of(reflect), "units": units_of(units), "reports": reports}
    with talk.progress() as tell:
        found = cohort.add(
            folder, new, model=model, **how, executor=executor, jobs=jobs, progress=tell, warn=complain
        )

    def summary() -> None:
        say_scored(found.record, found.folder)
        say(f"the maps: {found.folder / 'index.html'}; {folder} is as it was, but for {found.folder.name}")

    talk.result({**found.record, "files": found.files}, summary)
