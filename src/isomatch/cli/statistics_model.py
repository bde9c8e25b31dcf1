"""``isomatch statistics project`` and ``complete``: new shapes, or parts, in an old model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from isomatch import cohort
from isomatch.cli.inputs import ConfigFile, Force, Output, Seed, read_config
from isomatch.cli.outputs import require_writable, say_left_out
from isomatch.cli.terminal import INDENT, TALK, Talk, say, say_rows

LABEL_WIDTH = 16  # columns of the terminal for a label; chosen to hold the longest one


def project(model: Path, /, *shapes: Path, output: Output, force: Force = False, talk: Talk = TALK) -> None:
    """Score new shapes in a model: how far from the mean, how well the modes describe each.

    The model stays as it is. Shapes in another topology are brought into its topology by isomatch collect add.

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


def complete(
    model: Path,
    shape: Annotated[Path, Parameter(name="PART")],
    /,
    *,
    output: Output,
    landmarks: Path | None = None,
    noise: float | None = None,
    pose: Literal["fitted", "given"] = "fitted",
    config: ConfigFile = None,
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Complete a shape: the likeliest one of a model, given a part or landmarks, with errors.

    Writes the completed mesh, where the part is, and next to it NAME.json with its scores and what was left out.

    Args:
        model: model.npz of isomatch statistics.
        shape: A mesh in the topology of the model with missing vertices (not finite, or measured = 0); any other
            mesh, which is matched to the mean of the model; or landmarks: .mrk.json or .fcsv of 3D Slicer, .pp of
            MeshLab, or a table name,x,y,z. Of subjects, a folder of the structures that are known, named as in the model.
        output: Surface file for the completed shape, with the scalars standard_deviation and expected_error at its
            vertices; of subjects, a folder for a file of each structure.
        landmarks: Landmarks of mean.ply with the same names, if landmarks are given.
        noise: How far a given point may be from what the modes describe, in the units of PART; by default the error of
            the model for a shape that is left out.
        pose: fitted (default): PART may be anywhere. given: it is aligned with the model.
        config: TOML file with settings of the match.
    """
    if not shape.is_dir():
        require_writable(output)
    how: dict[str, Any] = {"landmarks": landmarks, "noise": noise, "pose": pose, "seed": seed, "force": force}
    with talk.progress() as tell:
        record = cohort.complete_file(model, shape, output, config=read_config(config), **how, progress=tell)
    talk.result(record, lambda: _say_completed(record, output.with_suffix(".json")))


def _say_completed(record: dict[str, Any], about: Path) -> None:
    say(f"The shape is completed from {record['n_points']:,} points.", "bold")
    sure = (
        f"it passes the points at {record['error']:.4g} (root mean square); elsewhere its standard deviation is "
        f"{record['mean_standard_deviation']:.4g} on average, {record['largest_standard_deviation']:.4g} at most; "
        f"{record['residual']:.4g} is what the modes do not describe"
    )
    say_rows([("how sure", sure), *(("note", note) for note in record["notes"])])
    say(f"{'  wrote':<{INDENT}}{record['file']}, {about}")
    say_left_out(record["left_out"], record["file"])


def say_scored(record: Mapping[str, Any], folder: Path) -> None:
    """Print how unusual new shapes are."""
    usual, m, k = record["usual"], record["n_left_out"], record["n_modes"]
    for line in record["shapes"]:
        say(line["name"], "bold")
        far = f"{line['mahalanobis']:.3g} standard deviations from the mean, p = {line['p_value']:.2g} (χ², {k} modes)"
        off = f"{line['error']:.4g} from what the modes describe (root mean square)"
        where = f"at most {line['farthest_error']:.4g}, at vertex {line['farthest_vertex']}"
        if m:
            median = usual["mahalanobis"]
            far += (
                f"; {line['as_far']} of {m} shapes, each left out, are as far, their median is {median:.3g}"
            )
            off += f"; {line['as_badly_described']} of {m} are as badly described, their median is {usual['errors']:.4g}"
        if line.get("landmark"):
            where += f", nearest to the landmark {line['landmark']}"
        rows = [("in the model", far), ("off the model", off), ("where", where)]
        if line["measured"] < 1:
            rows.append(("measured", f"{line['measured']:.0%} of its vertices; the others tell nothing"))
        say_rows(rows, LABEL_WIDTH)
    say(f"the table is {folder / 'scored.csv'}; where: {folder / 'scored'}, residual of each vertex")
