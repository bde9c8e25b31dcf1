"""Shapes that an old model describes: new ones, how unusual they are; and a part, completed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.files import claimed, write_text
from isomatch._core.stage_timer import Progress
from isomatch._core.texts import json_text
from isomatch.cohort import shape_statistics
from isomatch.cohort.plan import Entry, entries_of
from isomatch.cohort.shape_statistics import ScoredShape, ShapeModel, leave_one_out
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.cohort.workers import Listener
from isomatch.io import Asset, Attribute, write_asset
from isomatch.settings import Config

LAST = "scored.json"  # of the files about new shapes


def project(
    model: str | Path,
    shapes: Sequence[str | Path],
    output: str | Path,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Results:
    """Score new shapes in an old model: how far each is from the mean, how well the modes describe it, and where not.

    ``record["shapes"]`` has a line for each shape.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`, which stays as it is.
    shapes : sequence of path_like
        Meshes in its topology, or one folder or list of them.
    output : path_like
        Folder for ``scored.csv``, ``scored.json``, and ``scored/NAME.ply``.
    force, progress
        As for `statistics`.
    """
    into, listener = StatisticsFolder(Path(output), last=LAST), Listener.of(progress, None)
    with into.claimed(force) as new:
        listener.tell("reading", 0.0)
        prior = ShapeModel.load(model)
        scored = {entry.name: prior.score_file(entry.path) for entry in new_shapes(shapes)}
        record = write_scored(new, Path(model), prior, scored)
    return Results(into.folder, into.written, record)


def new_shapes(files: Sequence[str | Path]) -> tuple[Entry, ...]:
    """List new shapes, from files or from one folder or list; their names are those of the files."""
    first = Path(files[0]) if len(files) == 1 else None
    alone = first and (first.is_dir() or first.suffix.lower() == ".csv")
    return entries_of(first if first and alone else files)


def write_scored(
    into: StatisticsFolder,
    file: Path,
    model: ShapeModel,
    scored: Mapping[str, ScoredShape],
    own: Mapping[str, Mapping[str, Any]] | None = None,
    about: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write the table, the fields and the record of new shapes; ``own`` values go into lines, others into the record."""
    usual = leave_one_out(model)
    lines = []
    for name, each in scored.items():
        farthest = int(np.nanargmax(each.vertex_errors))
        line = {
            "name": name,
            "mahalanobis": each.mahalanobis,
            "p_value": each.p_value,
            "as_far": int((usual.mahalanobis >= each.mahalanobis).sum()),
            "error": each.error,
            "as_badly_described": int((usual.errors >= each.error).sum()),
            "farthest_vertex": farthest,
            "farthest_error": float(each.vertex_errors[farthest]),
            "measured": 1.0 if each.measured is None else float(each.measured.mean()),
        }
        lines.append({**line, **(own or {}).get(name, {})})
    into.scored(model, scored, lines)
    numbers = {name: (each.scores.tolist(), each.deviations.tolist()) for name, each in scored.items()}
    record = {
        "isomatch": VERSION,
        "model": str(file),
        "n_left_out": len(usual.errors),
        "n_modes": model.n_modes,
        "usual": {name: _median(getattr(usual, name)) for name in ("mahalanobis", "errors")},
        **(about or {}),
        "shapes": [{**line, **dict(zip(("scores", "deviations"), numbers[line["name"]]))} for line in lines],
    }
    into.finish(record)
    return record


def _median(values: np.ndarray[Any, Any]) -> float | None:
    return float(np.median(values)) if len(values) else None


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

    Returns the values of NAME.json, which is beside the shape: scores, errors, pose, and notes.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`.
    shape : path_like
        What is known, see `read_observations`.
    output : path_like
        Surface file for the completed shape; of subjects, a folder for a file of each structure.
    landmarks, noise, pose, config, seed, force
        As the options of ``isomatch statistics complete``.
    progress
        As for `statistics`.
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
