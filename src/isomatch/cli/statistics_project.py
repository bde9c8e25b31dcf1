"""``isomatch statistics project``: how unusual new shapes are in an old model."""

from __future__ import annotations

from pathlib import Path

from isomatch import cohort
from isomatch.cli.cohort_words import say_scored
from isomatch.cli.inputs import Force, Output
from isomatch.cli.terminal import TALK, Talk


def project(
    model: Path,
    /,
    *shapes: Path,
    output: Output,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Score new shapes in an old model: how far each is from the mean, how well the modes describe it, and where not.

    The model stays as it is. Shapes in another topology are brought into that of the model by isomatch collect add.

    Args:
        model: model.npz of isomatch statistics.
        shapes: Meshes in the topology of the model.
        output: Folder for scored.csv, scored.json, and scored/NAME.ply: each shape moved onto the mean, with residual,
            how far each vertex is from what the modes describe, and distance_from_mean.
    """
    with talk.progress() as tell:
        found = cohort.project(model, shapes, output, force=force, progress=tell)
    record = {**found.record, "files": found.files, "output": str(output)}
    talk.result(record, lambda: say_scored(found.record, output))
