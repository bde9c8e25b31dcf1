"""``isomatch statistics``: mean, modes, groups and distances of shapes in one topology."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from cyclopts import App, Parameter

from isomatch import cohort
from isomatch._core.errors import SettingError
from isomatch.cli.cohort_words import say_statistics
from isomatch.cli.inputs import Force, Output, Seed
from isomatch.cli.statistics_complete import complete
from isomatch.cli.statistics_project import project
from isomatch.cli.statistics_time import over_time
from isomatch.cli.terminal import TALK, Talk, complain

statistics = App(name="statistics", default_parameter=Parameter(negative=()))
statistics.command(project)
statistics.command(over_time, name="time")
statistics.command(complete)


@statistics.default
def run(
    folder: Path,
    /,
    *,
    output: Output,
    scale: Literal["keep", "remove"] = "keep",
    weights: Literal["area", "uniform"] = "area",
    modes: int = 3,
    groups: Path | None = None,
    test: Literal["permutation", "parametric"] = "permutation",
    mirror: str | None = None,
    align: Literal["subject", "structure"] = "subject",
    hide: str | None = None,
    pictures: Literal["png", "pdf", "svg"] = "png",
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Compute the mean, the modes of variation and the distances of shapes in one topology.

    Args:
        folder: Folder of meshes with the same faces, or folder written by isomatch collect. Meshes with other faces or
            with unmatched vertices are left out.
        output: Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for other tools.
        scale: keep: size is part of the shape. remove: all shapes are brought to one size.
        weights: area: a vertex counts by its share of the area. uniform: all vertices count alike.
        modes: Number of modes that are drawn and written as meshes. The model has all.
        groups: Table with the columns name and group, or these two without a header: test at every vertex where two
            groups differ. Commas, semicolons or tabs separate its cells; a shape without a group is left out of the test.
        test: permutation: p-values from exchanged labels. parametric: from Hotelling's distribution.
        mirror: Add the mirror image of every shape: auto, or a file with the vertex on the other side of each vertex, as
            a map.
        align: Of subjects of several surfaces. subject (default): the poses of structures among each other are part of
            the shape. structure: each is aligned by itself. Poses are in poses.csv.
        hide: Structures, separated by commas, to hide in each subject in turn and complete by a model of the others:
            hidden.csv has the errors, beside those of the mean.
        pictures: png (default): with 300 dots per inch. pdf or svg: charts as lines.
    """
    if modes < 0:
        raise SettingError(f"--modes {modes} is not a number of modes; give 0 or more")
    how: dict[str, Any] = {
        "scale": scale,
        "weights": weights,
        "modes": modes,
        "groups": groups,
        "test": test,
        "mirror": mirror,
    }
    how |= {"align": align, "hide": hide, "pictures": pictures, "seed": seed, "force": force}
    with talk.progress() as tell:
        found = cohort.statistics(folder, output, **how, progress=tell, warn=complain)
    talk.result(found.to_json(), lambda: say_statistics(found))
