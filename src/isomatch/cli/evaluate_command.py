"""``isomatch evaluate``: the geodesic errors of any tool's map against a truth; without one, what speaks for it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch import correspondence, evaluation
from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError
from isomatch.cli.inputs import Seed
from isomatch.cli.outputs import say_notes
from isomatch.cli.terminal import TALK, Talk, say_table

USUAL = "standard deviations; right maps have 0.2 to 0.5, wrong ones mostly more"
CURVE = (0.01, 0.02, 0.05, 0.1, 0.25)  # √(target area)


def evaluate(
    map_file: Annotated[Path, Parameter(name="MAP")],
    truth: Path,
    source: Path,
    target: Path | None = None,
    /,
    *,
    target_marks: Path | None = None,
    counts_from: Literal[0, 1] | None = None,
    truth_counts_from: Literal[0, 1] | None = None,
    variable: str | None = None,
    points: int | None = None,
    seed: Seed = 0,
    talk: Talk = TALK,
) -> None:
    """Score a map of any tool: geodesic errors on the target, in √(target area), as in the Princeton benchmark.

    Without a truth, ``isomatch evaluate MAP SOURCE TARGET`` tells what speaks for the map: how differently the surfaces
    look around points and their images, and how much they bend to lie on each other. Of two maps of the same shapes, that
    of lower cost is nearly always the better one.

    Args:
        map_file: The map: a text file with the target vertex of each source vertex, one a line (-1: unmatched), an .npy
            or .npz file with such an array, or a .mat file with such a variable.
        truth: The truth, if there is one: another map; or two columns of vertices that correspond (source, target); or
            four, a triangle of the target and three barycentric weights for each source vertex; or, with --target-marks,
            the marks of the source.
        source: Mesh that the map leads from.
        target: Mesh that the map leads to.
        target_marks: Marks of the target, such as a .vts file: the vertex on each line, counted from 1, corresponds to
            that on the same line of TRUTH.
        counts_from: What MAP counts from, 0 or 1. By default from 1 where its largest index is the number of target
            vertices and none is 0, which a note tells, and otherwise from 0; of a .mat file that may well count from
            either, it has to be said.
        truth_counts_from: The same of TRUTH.
        variable: Name of the map in a .mat or .npz file that holds several arrays of its length.
        points: Number of truth points to judge, drawn without replacement; all by default.
    """
    if target is None:
        _verify(map_file, truth, source, counts_from, variable, seed, talk)
        return
    with talk.progress() as tell:
        tell("reading", 0.0)
        shapes = isomatch.read_mesh(source), isomatch.read_mesh(target)
        sizes = shapes[0].n_vertices, shapes[1].n_vertices
        read = correspondence.read_map(map_file, *sizes[::-1], counts_from=counts_from, variable=variable)
        judged, notes = read.map, [read.note]
        judged.check_fits(*shapes)
        points_there = None
        if target_marks is None:
            table = evaluation.read_truth(truth, *shapes, truth_counts_from)
            pairs, points_there = table.rows, table.points
            notes.append(table.base.note)
            if truth.suffix.lower() == ".mat" and not table.base.is_likely:
                raise FormatError(f"{truth}: can count from 0 or from 1; say which by --truth-counts-from")
        else:
            pairs = _of_marks(truth, target_marks)
            _require_within(truth, pairs, sizes)
        tell("geodesic distances", 0.1)
        most = None if points is None else min(points, len(pairs))
        errors = evaluation.geodesic_errors(shapes[1], judged, pairs, most, seed, points=points_there)
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
        "within": dict(zip(map(str, CURVE), map(float, evaluation.cumulative_curve(errors, CURVE)))),
        "coverage": coverage,
        "notes": [note for note in notes if note],
    }

    def summary() -> None:
        say_table(_rows(record))
        say_notes(record["notes"])

    talk.result(record, summary, is_answer=True)


def _verify(
    map_file: Path,
    source: Path,
    target: Path,
    counts_from: Literal[0, 1] | None,
    variable: str | None,
    seed: int,
    talk: Talk,
) -> None:
    """Tell what speaks for a map without a truth."""
    with talk.progress() as tell:
        tell("reading", 0.0)
        shapes = isomatch.read_mesh(source), isomatch.read_mesh(target)
        sizes = shapes[1].n_vertices, shapes[0].n_vertices
        read = correspondence.read_map(map_file, *sizes, counts_from=counts_from, variable=variable)
        tell("verification", 0.1)
        found = isomatch.verify(*shapes, read.map, seed=seed)
        tell("done", 1.0)
    values = {**asdict(found), "cost": found.cost}
    record: dict[str, Any] = {
        "map": str(map_file),
        **{name: value if np.isfinite(value) else None for name, value in values.items()},
        "notes": [read.note] if read.note else [],
    }

    def summary() -> None:
        rows = [
            ("support", f"{found.support:.1%}", "of the area has a counterpart"),
            ("descriptor distance", f"{found.descriptor_distance:.2f}", USUAL),
            ("bending", f"{found.bending:.1e}", "stretch × distance from the target, in √area"),
            ("bending back", f"{found.bending_back:.1e}", "the same of the target onto the source"),
            ("cost", f"{found.cost:.1e}", "compares maps of these two shapes; lower is better"),
        ]
        say_table(rows)
        say_notes(record["notes"])

    talk.result(record, summary, is_answer=True)


def _of_marks(of_source: Path, of_target: Path) -> IntArray:
    marks = [evaluation.read_indices(path) for path in (of_source, of_target)]
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
    of_area, within = "of √(target area)", record["within"].items()
    return [
        ("error, mean", f"{record['mean']:.2%}", of_area + "; a point without an image counts 100 %"),
        ("error, median", f"{record['median']:.2%}", of_area),
        ("error, 95th percentile", f"{record['p95']:.2%}", of_area),
        ("error, largest", f"{record['max']:.2%}", of_area),
        *((f"error at most {float(at):.0%}", f"{share:.1%}", "of the points") for at, share in within),
        ("area under the curve", f"{record['auc']:.3f}", f"to {evaluation.LIMIT:.0%}; 1 is perfect"),
        ("unmatched", f"{record['unmatched']:.1%}", f"of {record['points']} points"),
        ("coverage", f"{record['coverage']:.1%}", "of the target area is near an image"),
    ]
