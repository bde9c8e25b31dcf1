"""What the commands write and tell of new shapes that an old shape model describes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import isomatch
from isomatch import cohort
from isomatch.cli.statistics_files import StatisticsFolder
from isomatch.cli.terminal import say, say_rows
from isomatch.cohort.shape_statistics import ScoredShape, ShapeModel, leave_one_out

LAST = "scored.json"  # of the files about new shapes
LABEL = 16  # columns of a label


def new_shapes(files: Sequence[Path]) -> tuple[cohort.Entry, ...]:
    """List new shapes, from files or from one folder or list; their names are those of the files."""
    alone = len(files) == 1 and (files[0].is_dir() or files[0].suffix.lower() == ".csv")
    return cohort.entries_of(files[0] if alone else files)


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
        "isomatch": isomatch.__version__,
        "model": str(file),
        "n_left_out": len(usual.errors),
        "n_modes": model.n_modes,
        "usual": {name: _median(getattr(usual, name)) for name in ("mahalanobis", "errors")},
        **(about or {}),
        "shapes": [{**line, **dict(zip(("scores", "deviations"), numbers[line["name"]]))} for line in lines],
    }
    into.finish(record)
    return {**record, "files": into.written}


def _median(values: np.ndarray[Any, Any]) -> float | None:
    return float(np.median(values)) if len(values) else None


def say_scored(record: Mapping[str, Any], folder: Path) -> None:
    """Print how unusual new shapes are."""
    usual, m, k = record["usual"], record["n_left_out"], record["n_modes"]
    for line in record["shapes"]:
        say(line["name"], "bold")
        far = f"{line['mahalanobis']:.3g} standard deviations from the mean, p = {line['p_value']:.2g} (χ², {k} modes)"
        off = f"{line['error']:.4g} from what the modes describe (root mean square)"
        where = f"at most {line['farthest_error']:.4g}, at vertex {line['farthest_vertex']}"
        if m:
            far += f"; {line['as_far']} of {m} shapes, each left out, are as far, their median is "
            far += f"{usual['mahalanobis']:.3g}"
            off += f"; {line['as_badly_described']} of {m} are as badly described, their median is {usual['errors']:.4g}"
        if line.get("landmark"):
            where += f", nearest to the landmark {line['landmark']}"
        say_rows([("in the model", far), ("off the model", off), ("where", where)], LABEL)
        if line["measured"] < 1:
            say_rows(
                [("measured", f"{line['measured']:.0%} of its vertices; the others tell nothing")], LABEL
            )
    say(f"the table is {folder / 'scored.csv'}; where: {folder / 'scored'}, residual of each vertex")
