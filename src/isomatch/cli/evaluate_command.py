"""``isomatch evaluate``: the geodesic errors of any tool's map against a truth; without one, whether it is right."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch import correspondence, evaluation, visualization
from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, InputError, NotConvergedError
from isomatch._core.settings import require_one_of
from isomatch.cli.inputs import Force, OptionalOutput, Seed, split_words
from isomatch.cli.outputs import claimed_files, say_notes
from isomatch.cli.terminal import TALK, Talk, Tell, part, say, say_rows, say_table

MEASURES = (  # Each row has a field of `Verification`, the format of its value, and its meaning.
    ("support", ".1%", "of the area has a counterpart"),
    ("descriptor_distance", ".2f", "how differently surfaces look around points and their images"),
    ("bending", ".1e", "stretch × distance from the target, in √area"),
    ("bending_back", ".1e", "the same of the target onto the source"),
    ("cost", ".1e", "all in one; compares maps of these two shapes, lower is better"),
)
VERDICT_COLOURS = {"right": "green", "doubtful": "yellow", "wrong": "red"}  # colours in the terminal
# √(target area); for each threshold, the table has the share of points with at most this error; chosen
ERROR_THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.25)


def evaluate(
    map_file: Annotated[Path, Parameter(name="MAP")],
    truth: Annotated[Path, Parameter(name="[TRUTH]", required=False)],
    source: Path,
    target: Path | None = None,
    /,
    *,
    target_marks: Path | None = None,
    counts_from: Literal[0, 1] | None = None,
    truth_counts_from: Literal[0, 1] | None = None,
    variable: str | None = None,
    points: int | None = None,
    reference: Path | None = None,
    output: OptionalOutput = None,
    fail_on: str | None = None,
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Say whether a map of any tool is right; with a truth, measure its errors.

    ``isomatch evaluate MAP SOURCE TARGET`` matches the shapes and calls the map right, doubtful or wrong: it says where
    the map differs from isomatch's own, and how much more it costs. ``isomatch evaluate MAP TRUTH SOURCE TARGET``
    measures geodesic errors on the target, in √(target area), as the Princeton benchmark does.

    Args:
        map_file: The map: a text file with the target vertex of each source vertex, one a line (-1: unmatched), an .npy
            or .npz file with such an array, or a .mat file with such a variable.
        truth: The truth, if there is one: another map; or two columns of vertices that correspond (source, target); or
            four, a triangle of the target and three barycentric weights for each source vertex; or, with --target-marks,
            the marks of the source.
        source: Mesh that the map leads from.
        target: Mesh that the map leads to.
        target_marks: Marks of the target, such as a .vts file: the vertex on each line, counted from 1, corresponds to
            the vertex on the same line of TRUTH.
        counts_from: What MAP counts from, 0 or 1. By default from 1 if its largest index is the
            number of target vertices and no index is 0, which a note says, and otherwise from 0. A
            .mat file that may count from either needs this option.
        truth_counts_from: The same of TRUTH.
        variable: Name of the map in a .mat or .npz file that holds several arrays of its length.
        points: Number of truth points to judge, drawn without replacement; all by default.
        reference: Without a truth, a map that is taken to be right, in place of isomatch's own.
        output: Without a truth, a page (.html) to write, with both maps and the regions in which they differ.
        fail_on: Without a truth, verdicts that make the exit code 4: wrong, doubtful; both with a comma.
    """
    reading: dict[str, Any] = {"counts_from": counts_from, "variable": variable}
    if target is None:
        failing_verdicts = split_words(fail_on, "--fail-on")
        for verdict in failing_verdicts:
            require_one_of("--fail-on", verdict, ("wrong", "doubtful"))
        maps = [map_file, *filter(None, [reference])]
        with talk.progress() as tell, claimed_files(output, force=force):
            judgement, judged = _judge(maps, (truth, source), reading, output, seed, tell)
        talk.result(judged, lambda: _say_judgement(judgement, judged), is_answer=True)
        if judgement.verdict in failing_verdicts:
            raise NotConvergedError(str(judgement))
        return
    if reference or output or fail_on:
        raise InputError("--reference, --output and --fail-on need a map without a truth: MAP SOURCE TARGET")
    with talk.progress() as tell:
        tell("reading", 0.0)
        shapes = isomatch.read_mesh(source), isomatch.read_mesh(target)
        sizes = shapes[0].n_vertices, shapes[1].n_vertices
        loaded = correspondence.read_map(map_file, *sizes[::-1], **reading)
        notes = [loaded.note]
        loaded.map.check_fits(*shapes)
        precise = None
        if target_marks is None:
            table = evaluation.read_truth(truth, *shapes, truth_counts_from)
            pairs, precise = table.rows, table.points
            notes.append(table.base.note)
            if truth.suffix.lower() == ".mat" and not table.base.is_likely:
                raise FormatError(f"{truth}: can count from 0 or from 1; say which by --truth-counts-from")
        else:
            pairs = _read_marks(truth, target_marks)
            _require_within(truth, pairs, sizes)
        tell("geodesic distances", 0.1)
        n_points = None if points is None else min(points, len(pairs))
        errors = evaluation.geodesic_errors(shapes[1], loaded.map, pairs, n_points, seed, points=precise)
        coverage = evaluation.coverage(shapes[1], loaded.map)
        tell("done", 1.0)
    bounded_errors = evaluation.counted(errors)
    shares_within = evaluation.cumulative_curve(errors, ERROR_THRESHOLDS)
    record: dict[str, Any] = {
        "map": str(map_file),
        "truth": str(truth),
        "points": len(errors),
        "unmatched": float(np.isinf(errors).mean()),
        "mean": float(bounded_errors.mean()),
        "median": float(np.median(bounded_errors)),
        "p95": float(np.quantile(bounded_errors, 0.95)),
        "max": float(bounded_errors.max()),
        "auc": evaluation.area_under_curve(bounded_errors),
        "within": dict(zip(map(str, ERROR_THRESHOLDS), shares_within.tolist())),
        "coverage": coverage,
        "notes": [note for note in notes if note],
    }

    def summary() -> None:
        say_table(_table_rows(record))
        say_notes(record["notes"])

    talk.result(record, summary, is_answer=True)


def _judge(
    maps: list[Path],
    ends: tuple[Path, Path],
    reading: dict[str, Any],
    page: Path | None,
    seed: int,
    tell: Tell,
) -> tuple[isomatch.Judgement, dict[str, Any]]:
    """Say whether the first map is right, without a truth, perhaps by a second one, which is the reference."""
    if page and (maps[1:] or page.suffix.lower() != ".html"):
        raise InputError("--output is an .html file, with isomatch's own map; leave --reference out")
    tell("reading", 0.0)
    shapes = isomatch.read_mesh(ends[0]), isomatch.read_mesh(ends[1])
    sizes = shapes[1].n_vertices, shapes[0].n_vertices
    loaded = [correspondence.read_map(path, *sizes, **reading) for path in maps]
    reference = loaded[1].map if maps[1:] else None
    judgement = isomatch.judge(*shapes, loaded[0].map, reference, seed=seed, progress=part(tell, 0.1, 0.8))
    tell("writing", 0.9)
    if page:
        visualization.write_judgement(page, *shapes, judgement, names=(ends[0].name, ends[1].name))
    tell("done", 1.0)
    return judgement, {
        "map": str(maps[0]),
        "verdict": judgement.verdict,
        "sentence": judgement.sentence,
        "ratio": judgement.ratio,
        "elsewhere": judgement.elsewhere,
        "regions": [region.to_dict() for region in judgement.regions],
        "given": {**asdict(judgement.given), "cost": judgement.given.cost},
        "reference": {**asdict(judgement.reference), "cost": judgement.reference.cost},
        "page": page and str(page),
        "notes": [file.note for file in loaded if file.note],
    }


def _say_judgement(judgement: isomatch.Judgement, record: dict[str, Any]) -> None:
    say(str(judgement), VERDICT_COLOURS[judgement.verdict])
    say_rows(("region", str(region)) for region in judgement.regions)
    rows: list[tuple[str, ...]] = [("", "this map", "isomatch's" if judgement.result else "reference", "")]
    for field, form, meaning in MEASURES:
        values = (f"{getattr(fit, field):{form}}" for fit in (judgement.given, judgement.reference))
        rows.append((field.replace("_", " "), *values, meaning))
    say_table(rows)
    say_notes(record["notes"])
    say_rows([("page", record["page"] or "")])


def _read_marks(source_file: Path, target_file: Path) -> IntArray:
    marks = [evaluation.read_indices(path) for path in (source_file, target_file)]
    if len(marks[0]) != len(marks[1]):
        raise FormatError(
            f"{source_file}: {len(marks[0])} marks, but {target_file} has {len(marks[1])}; "
            "give files whose lines correspond"
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


def _table_rows(record: dict[str, Any]) -> list[tuple[str, ...]]:
    of_area, within = "of √(target area)", record["within"].items()
    return [
        ("error, mean", f"{record['mean']:.2%}", of_area + "; a point without an image counts 100 %"),
        ("error, median", f"{record['median']:.2%}", of_area),
        ("error, 95th percentile", f"{record['p95']:.2%}", of_area),
        ("error, largest", f"{record['max']:.2%}", of_area),
        *((f"error at most {float(at):.0%}", f"{share:.1%}", "of the points") for at, share in within),
        ("area under the curve", f"{record['auc']:.3f}", f"to {evaluation.CURVE_LIMIT:.0%}; 1 is perfect"),
        ("unmatched", f"{record['unmatched']:.1%}", f"of {record['points']} points"),
        ("coverage", f"{record['coverage']:.1%}", "of the target area is near an image"),
    ]
