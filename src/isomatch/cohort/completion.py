"""A shape of which a part or landmarks are known, completed by a model, in a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.files import claimed, write_text
from isomatch._core.stage_timer import Progress
from isomatch._core.texts import json_text
from isomatch.cohort import shape_statistics
from isomatch.cohort.listener import Listener
from isomatch.cohort.shape_statistics import ShapeModel
from isomatch.cohort.statistics_folder import VERSION
from isomatch.io import Asset, Attribute, write_asset
from isomatch.settings import Config


def complete_file(
    model: str | Path,
    shape: str | Path,
    output: str | Path,
    *,
    landmarks: Path | None = None,
    noise: float | None = None,
    pose: Literal["fitted", "given"] = "fitted",
    config: Config | None = None,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write the likeliest shape of a model, given a part or landmarks, with how uncertain each vertex is.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`.
    shape : path_like
        What is known, see `read_observations`.
    output : path_like
        Surface file for the completed shape; of subjects, a folder for a file of each structure. NAME.json is beside it.
    landmarks, noise, pose, config, seed, force
        As the options of ``isomatch statistics complete``.
    progress : callable, optional
        Called with each step, and the share that is done.

    Returns
    -------
    dict of str to Any
        The values of NAME.json: scores, errors, pose, and notes.

    Raises
    ------
    FormatError, MeshError, LandmarkError
        If a file cannot be read, or has nothing that the model knows.
    """
    shape, output, to = Path(shape), Path(output), Listener.of(progress, None)
    about = output.with_suffix(".json")
    with claimed(output, [] if force else [output]), claimed(about, [] if force else [about]):
        to.tell("reading", 0.0)
        prior = ShapeModel.load(model)
        how: dict[str, Any] = {"noise": noise, "config": config, "seed": seed}
        told = to.part(0.1, 0.8).tell
        observed = shape_statistics.read_observations(shape, prior, landmarks, **how, progress=told)
        to.tell("completing", 0.8)
        completed = shape_statistics.complete(prior, observed, pose=pose)
        values = {name: getattr(completed, name) for name in ("standard_deviation", "expected_error")}
        scalars = [Attribute(name, "point", "scalar", np.asarray(each)) for name, each in values.items()]
        left: tuple[Attribute, ...] = ()
        for name, own in shape_statistics.slices_of(prior.structures).items() if shape.is_dir() else ():
            output.mkdir(parents=True, exist_ok=True)
            mesh = shape_statistics.structure_of(completed.mesh, own)
            scalars_of = [replace(each, values=each.values[own]) for each in scalars]
            write_asset(output / f"{name}.ply", Asset.of_mesh(mesh, scalars_of))
        if not shape.is_dir():
            left = write_asset(output, Asset.of_mesh(completed.mesh, scalars))
        record = {
            "isomatch": VERSION,
            "model": str(model),
            "part": str(shape),
            "file": str(output),
            "n_points": completed.n_points,
            "error": completed.error,
            "residual": completed.residual,
            "mean_standard_deviation": float(completed.standard_deviation @ prior.weights),
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
        to.tell("done", 1.0)
    return record
