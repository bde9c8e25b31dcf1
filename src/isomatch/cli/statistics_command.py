"""``isomatch statistics``: mean, modes, groups and distances of shapes; motion of a series."""

from __future__ import annotations

from itertools import accumulate
from pathlib import Path
from typing import Any, Literal

from cyclopts import App, Parameter

from isomatch import cohort
from isomatch._core.errors import SettingError
from isomatch.cli.inputs import Force, Output, Seed
from isomatch.cli.statistics_model import complete, project
from isomatch.cli.terminal import TALK, Talk, complain, say, say_rows, say_table

statistics = App(name="statistics", default_parameter=Parameter(negative=()))  # with subcommands
statistics.command(project)
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
    model: str | None = None,
    test: Literal["permutation", "parametric"] = "permutation",
    tangent: bool = False,
    slide: Literal["bending", "distance"] | None = None,
    wireframe: Path | None = None,
    mirror: str | None = None,
    align: Literal["subject", "structure"] = "subject",
    hide: str | None = None,
    pictures: Literal["png", "pdf", "svg"] = "png",
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Compute mean, modes of variation and distances of shapes in one topology, or landmarks.

    Args:
        folder: Folder of meshes with the same faces, or folder written by isomatch collect. Meshes with other faces or
            with unmatched vertices are left out. Or landmarks: a .tps, .nts, .dta, morphologika or .csv file, or a folder
            with a .fcsv, .mrk.json, .pts, … of each specimen.
        output: Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for other tools.
        scale: keep: size is part of the shape. remove: all shapes are brought to one size.
        weights: area: a vertex counts by its share of the area. uniform: all vertices count alike.
        modes: Number of modes that are drawn and written as meshes. The model has all.
        groups: Table with the columns name and group, or these two without a header: test whether groups differ and, of
            two, at which vertices; pairs of groups; classification. Commas, semicolons or tabs separate its cells; a
            shape without a group is left out of the test. Other columns are variables of the model.
        model: Terms that may describe shape, tested one after the other, such as "size * group + age": columns of the
            table, or size, the logarithm of the centroid size. a:b is what a and b have together, a * b is a + b + a:b;
            log(a); factor(a) of numbers that name groups, as group always is. With --scale remove, size is not part of
            the shape.
        test: permutation: p-values from exchanged labels. parametric: from Hotelling's distribution.
        tangent: Project shapes on the space tangent to shapes of one size at their mean (with --scale remove).
        slide: Of landmarks, slide points of curves and surfaces, as NAME_sliders.csv and NAME_surfaces.csv beside a file
            tell them, until specimens bend least from the mean, or have the least Procrustes distance.
        wireframe: Of landmarks, table of pairs, by name or by number from 1, that are joined by lines in pictures.
        mirror: Add the mirror image of every shape: auto, or a file with the vertex on the other side of each vertex, as
            a map; of landmarks, a table with pairs of left and right ones.
        align: Of subjects of several surfaces. subject (default): the poses of structures among each other are part of
            the shape. structure: each is aligned by itself. Poses are in poses.csv.
        hide: Structures, separated by commas, to hide in each subject in turn and complete by a model of the others:
            hidden.csv has the errors, beside those of the mean.
        pictures: png (default): with 300 dots per inch. pdf or svg: charts as lines.
    """
    if modes < 0:
        raise SettingError(f"--modes {modes} is not a number of modes; give 0 or more")
    how: dict[str, Any] = {"scale": scale, "weights": weights, "modes": modes, "groups": groups, "test": test}
    how |= {"model": model, "tangent": tangent, "slide": slide, "wireframe": wireframe, "mirror": mirror}
    how |= {"align": align, "hide": hide, "pictures": pictures, "seed": seed, "force": force}
    with talk.progress() as tell:
        found = cohort.statistics(folder, output, **how, progress=tell, warn=complain)
    talk.result(found.to_json(), lambda: say_statistics(found))


@statistics.command(name="time")
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
    """Tell how a series of shapes moves: area, volume, thickness and strain by region.

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
        say(found.findings[0], "bold")
        say_rows([("note", note) for note in found.record["notes"]])
        say(f"open first: {output / 'time.png'}; the table is time.csv")

    talk.result(found.to_json(), summary)


def say_statistics(found: cohort.Results) -> None:
    """Print how shapes vary, and what else was found."""
    model = found.model
    if model is None:
        return
    size = f"{len(model.names)} shapes of {len(model.mean):,} {found.record['of']}"
    say(f"{size} vary in {model.n_modes} mode{'s' * (model.n_modes != 1)}", "bold")
    shares = found.record["shares"][:10]
    modes = enumerate(zip(shares, accumulate(shares), model.deviations.tolist()), 1)
    say_table(
        (f"mode {i}", f"{share:.1%} of the variance, sd {deviation:.4g}", f"{total:.1%} so far")
        for i, (share, total, deviation) in modes
    )
    for line in found.findings:
        say(line)
    say(f"open first: {found.folder / 'index.html'}; {len(found.files)} files are there")
