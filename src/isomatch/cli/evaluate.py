"""``isomatch evaluate``: the geodesic errors of any tool's map against a truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch import correspondence
from isomatch.cli.inputs import read_pairs
from isomatch.cli.terminal import TALK, Talk, say_table
from isomatch.errors import FormatError
from isomatch.lab import evaluation, sets
from isomatch.storage.files import text_lines
from isomatch.values.arrays import IntArray

CURVE = (0.01, 0.02, 0.05, 0.1, 0.25)  # √(target area)


def evaluate(
    map_file: Annotated[Path, Parameter(name="MAP")],
    truth: Path,
    source: Path,
    target: Path,
    /,
    *,
    target_marks: Path | None = None,
    points: int | None = None,
    seed: int = 0,
    talk: Talk = TALK,
) -> None:
    """Score a map of any tool: geodesic errors on the target, in √(target area), as in the Princeton benchmark.

    Parameters
    ----------
    map_file : Path
        The map: a text file with the 0-based target vertex of each source vertex, one a line (-1: unmatched), or an
        .npz file with such an array, named vertices.
    truth : Path
        The truth: another map; or a text file with two columns of 0-based vertex indices (source, target); or, with
        --target-marks, the marks of the source.
    source : Path
        Mesh that the map leads from.
    target : Path
        Mesh that the map leads to.
    target_marks : Path
        Marks of the target, such as a .vts file: the vertex on each line, counted from 1, corresponds to that on the
        same line of TRUTH.
    points : int
        Number of truth points to judge, drawn without replacement; all by default.
    seed : int
        Seed of the draw.
    talk : Talk
        What is told.
    """
    with talk.progress() as tell:
        tell("reading", 0.0)
        shapes = isomatch.read_mesh(source), isomatch.read_mesh(target)
        sizes = shapes[0].n_vertices, shapes[1].n_vertices
        judged = isomatch.Correspondence.load(map_file, sizes[1])
        if judged.shape != sizes:
            raise FormatError(
                f"{map_file}: maps {len(judged.vertices)} vertices, but {source} has {sizes[0]}; give the map of these "
                "two shapes in this direction"
            )
        judged.check_fits(*shapes)
        pairs = _truth(truth, sizes[1]) if target_marks is None else _of_marks(truth, target_marks)
        _require_within(truth, pairs, sizes)
        tell("geodesic distances", 0.1)
        errors = evaluation.geodesic_errors(
            shapes[1], judged, pairs, None if points is None else min(points, len(pairs)), seed
        )
        coverage = evaluation.coverage(shapes[1], judged)
        tell("done", 1.0)
    counted = evaluation.counted(errors)
    record: dict[str, Any] = {
        "map": str(map_file),
        "truth": str(truth),
        "points": len(errors),
        "unmatched": float(np.isinf(errors).mean()),
        "mean": float(counted.mean()),
        "median": float(np.median(counted)),
        "p95": float(np.quantile(counted, 0.95)),
        "max": float(counted.max()),
        "auc": evaluation.area_under_curve(counted),
        "within": {
            str(at): float(share) for at, share in zip(CURVE, evaluation.cumulative_curve(errors, CURVE))
        },
        "coverage": coverage,
    }
    talk.result(record, lambda: say_table(_rows(record)), is_answer=True)


def _truth(path: Path, n_target: int) -> IntArray:
    """Read a truth, (m, 2): pairs, or a map without its unmatched vertices."""
    if path.suffix != ".npz":
        _, first = next(text_lines(path), (0, ""))
        if len(first.replace(",", " ").split()) == 2:
            return read_pairs(path, "a pair", "of the source and of the target")
    image = isomatch.Correspondence.load(path, n_target).vertices
    mapped = np.flatnonzero(image != correspondence.UNMATCHED)
    return np.column_stack([mapped, image[mapped]])


def _of_marks(of_source: Path, of_target: Path) -> IntArray:
    marks = [sets.read_indices(path) for path in (of_source, of_target)]
    if len(marks[0]) != len(marks[1]):
        raise FormatError(
            f"{of_source}: {len(marks[0])} marks, but {of_target} has {len(marks[1])}; give files whose lines correspond"
        )
    return np.column_stack(marks)


def _require_within(path: Path, pairs: IntArray, sizes: tuple[int, int]) -> None:
    if not len(pairs):
        raise FormatError(f"{path}: no point has a known image; give a truth with at least one")
    for side, column, n in zip(("source", "target"), pairs.T, sizes):
        if column.min() < 0 or column.max() >= n:
            raise FormatError(
                f"{path}: names {side} vertices {column.min()}…{column.max()}, outside 0…{n - 1}; give the truth of "
                "these two shapes in this direction"
            )


def _rows(record: dict[str, Any]) -> list[tuple[str, ...]]:
    of_area = "of √(target area)"
    return [
        ("error, mean", f"{record['mean']:.2%}", of_area + "; a point without an image counts 100 %"),
        ("error, median", f"{record['median']:.2%}", of_area),
        ("error, 95th percentile", f"{record['p95']:.2%}", of_area),
        ("error, largest", f"{record['max']:.2%}", of_area),
        *(
            (f"error at most {float(at):.0%}", f"{share:.1%}", "of the points")
            for at, share in record["within"].items()
        ),
        ("area under the curve", f"{record['auc']:.3f}", f"to {evaluation.LIMIT:.0%}; 1 is perfect"),
        ("unmatched", f"{record['unmatched']:.1%}", f"of {record['points']} points"),
        ("coverage", f"{record['coverage']:.1%}", "of the target area is near an image"),
    ]
