"""New shapes that an old shape model describes: how unusual they are, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isomatch._core.stage_timer import Progress
from isomatch.cohort.entries import Entry, entries_of
from isomatch.cohort.listener import Listener
from isomatch.cohort.shape_statistics import ScoredShape, ShapeModel, leave_one_out
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder

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

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`, which stays as it is.
    shapes : sequence of path_like
        Meshes in its topology, or one folder or list of them.
    output : path_like
        Folder for ``scored.csv``, ``scored.json``, and ``scored/NAME.ply``.
    force : bool
        Whether to replace an earlier result.
    progress : callable, optional
        Called with each step, and the share that is done.

    Returns
    -------
    Results
        A line for each shape in ``record["shapes"]``.

    Raises
    ------
    FormatError, MeshError
        If a file cannot be read, or has another topology.
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
