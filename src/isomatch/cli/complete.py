"""``isomatch statistics complete``: the shape of a model, given a part of it or landmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

import isomatch
import isomatch.statistics as shape_statistics
from isomatch.assets import Asset, Attribute
from isomatch.cli.inputs import read_config
from isomatch.cli.outputs import claimed_files, require_writable, say_left_out
from isomatch.cli.terminal import INDENT, TALK, Talk, json_text, part, say, say_rows
from isomatch.storage.files import write_text


def complete(
    model: Path,
    given: Annotated[Path, Parameter(name="PART")],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    landmarks: Path | None = None,
    noise: float | None = None,
    pose: Literal["fitted", "given"] = "fitted",
    config: Path | None = None,
    seed: int = 0,
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Complete a shape: the likeliest one of a model, given a part or landmarks, and how uncertain each vertex is.

    Writes the completed mesh, where the part is, and next to it NAME.json with its scores and what was left out.

    Parameters
    ----------
    model : Path
        model.npz of isomatch statistics.
    given : Path
        A mesh in the topology of the model, of which vertices are missing (not finite, or measured = 0); any other mesh,
        which is matched to the mean of the model; or landmarks: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab, or a
        table name,x,y,z.
    output : Path
        Surface file for the completed shape, with the scalars standard_deviation and expected_error at its vertices.
    landmarks : Path
        Landmarks of mean.ply with the same names, if landmarks are given.
    noise : float
        How far a given point may be from what the modes describe, in the units of PART; by default the error of the model
        for a shape that is left out.
    pose : str
        fitted (default): PART may be anywhere. given: it is aligned with the model.
    config : Path
        TOML file with settings of the match.
    seed : int
        Seed of the match.
    force : bool
        Replace an existing file.
    talk : Talk
        What is told.
    """
    require_writable(output)
    about = output.with_suffix(".json")
    with talk.progress() as tell, claimed_files(output, about, force=force):
        tell("reading", 0.0)
        known = shape_statistics.ShapeModel.load(model)
        observed = shape_statistics.read_observations(
            given,
            known,
            landmarks,
            noise=noise,
            config=read_config(config),
            seed=seed,
            progress=part(tell, 0.1, 0.8),
        )
        tell("completing", 0.8)
        completed = shape_statistics.complete(known, observed, pose=pose)
        left = isomatch.write_asset(output, _asset(completed))
        record = {
            "isomatch": isomatch.__version__,
            "model": str(model),
            "part": str(given),
            "file": str(output),
            "n_points": completed.n_points,
            "error": completed.error,
            "residual": completed.residual,
            "mean_standard_deviation": float(completed.standard_deviation @ known.weights),
            "largest_standard_deviation": float(completed.standard_deviation.max()),
            "scores": completed.scores.tolist(),
            "score_deviations": completed.score_deviations.tolist(),
            "scale": completed.scale,
            "rotation": completed.rotation.tolist(),
            "translation": completed.translation.tolist(),
            "left_out": [attribute.name for attribute in left],
            "notes": [*observed.notes, *completed.notes],
        }
        write_text(about, json_text(record))
        tell("done", 1.0)
    talk.result(record, lambda: _say(record, about))


def _asset(completed: shape_statistics.Completion) -> Asset:
    values = {
        "standard_deviation": completed.standard_deviation,
        "expected_error": completed.expected_error,
    }
    scalars = [Attribute(name, "point", "scalar", np.asarray(each)) for name, each in values.items()]
    return Asset.of_mesh(completed.mesh, scalars)


def _say(record: dict[str, Any], about: Path) -> None:
    say(f"The shape is completed from {record['n_points']:,} points.", "bold")
    say_rows(
        [
            (
                "how sure",
                f"it passes the points at {record['error']:.4g} (root mean square); elsewhere its standard deviation is "
                f"{record['mean_standard_deviation']:.4g} on average, {record['largest_standard_deviation']:.4g} at "
                f"most; {record['residual']:.4g} is what the modes do not describe",
            ),
            *(("note", note) for note in record["notes"]),
        ]
    )
    say(f"{'  wrote':<{INDENT}}{record['file']}, {about}")
    say_left_out(record["left_out"], record["file"])
