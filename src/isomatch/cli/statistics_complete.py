"""``isomatch statistics complete``: a shape of which a part or landmarks are known, completed by a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from isomatch import cohort
from isomatch.cli.inputs import ConfigFile, Force, Output, Seed, read_config
from isomatch.cli.outputs import require_writable, say_left_out
from isomatch.cli.terminal import INDENT, TALK, Talk, say, say_rows


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
    """Complete a shape: the likeliest one of a model, given a part or landmarks, and how uncertain each vertex is.

    Writes the completed mesh, where the part is, and next to it NAME.json with its scores and what was left out.

    Args:
        model: model.npz of isomatch statistics.
        shape: A mesh in the topology of the model, of which vertices are missing (not finite, or measured = 0); any other
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
    how: dict[str, Any] = {
        "landmarks": landmarks,
        "noise": noise,
        "pose": pose,
        "config": read_config(config),
    }
    with talk.progress() as tell:
        record = cohort.complete_file(model, shape, output, **how, seed=seed, force=force, progress=tell)
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
