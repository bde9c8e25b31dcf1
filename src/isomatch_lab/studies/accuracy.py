"""Errors of the maps of whole sets, without any prior.

    python -m isomatch_lab.studies.accuracy --data DIR -o OUT [SET ...]

matches every two shapes that a whole set pairs once; where it has both directions, one is drawn. It writes what
``isomatch bench`` writes, and two tables: ``accuracy_table.csv`` has a row for each set and method,
``classes_table.csv`` a row for each kind of shapes. Rows that are already in OUT are not computed again.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from isomatch_lab.evaluation import BenchmarkRun, read_rows, run_benchmark, write_tables
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import parse_arguments, write_table

POINTS = 700  # number of points of the truth that are measured for each pair; chosen
SETS = ("faust_r", "tosca_iso_r", "scape", "tosca", "creatures")  # sets that are measured by default
SETS_WITH_LANDMARKS = {"organs": ("isomatch", "isomatch_5pt"), "cross": ("isomatch", "isomatch_5pt")}
"""Sets that are measured only if they are named, with their methods."""
Row = dict[str, Any]


def run_of(name: str, data: str) -> BenchmarkRun:
    """Describe what is run on a set; sets of unlike shapes keep both directions."""
    pairs = benchmark_set(name, data).pairs
    if name not in SETS_WITH_LANDMARKS:
        drawn = np.random.default_rng(0).permutation(len(pairs))
        pairs = tuple({frozenset(pairs[i]): pairs[i] for i in drawn}.values())
    methods = SETS_WITH_LANDMARKS.get(name, ("isomatch",))
    return BenchmarkRun(name, methods, data, n_points=POINTS, distortion=False, pairs=pairs)


def accuracy(summary: list[Row]) -> Iterator[Row]:
    """Errors over each set, failures, and shares of correspondences within three bounds."""
    for row in sorted(summary, key=lambda row: (*SETS, *SETS_WITH_LANDMARKS).index(row["set"])):
        within = " / ".join(f"{100 * row[key]:.1f}" for key in ("within_05", "within_10", "within_25"))
        yield {
            "set": f"`{row['set']}`",
            "method": f"`{row['method']}`",
            "pairs": row["pairs"],
            "mean": f"{row['mean']:.2f}",
            "median": f"{row['median']:.2f}",
            "worst": f"{row['max']:.1f}",
            "failures (> 10)": row["failures"] + row["problems"],
            "within 0.05 / 0.10 / 0.25, %": within,
        }


def classes(rows: list[Row]) -> Iterator[Row]:
    """Errors of the pairs of each two classes of shapes, and how many maps are called right, for each method."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        ends = (re.sub(r"[_\d]+$", "", end) for end in row["pair"].split("-"))
        groups.setdefault(" → ".join(dict.fromkeys(ends)), []).append(row)
    for kind, members in groups.items():
        line: Row = {"shapes": kind, "pairs": len({row["pair"] for row in members})}
        for method in dict.fromkeys(row["method"] for row in rows):
            of_method = [row for row in members if row["method"] == method]
            errors = [row["error"] for row in of_method if row.get("error") is not None]
            right = sum(row.get("outcome") == "CONVERGED" for row in of_method)
            line[f"{method}: mean, worst"] = f"{np.mean(errors):.2f}, {max(errors):.1f}" if errors else "–"
            line[f"{method}: called right"] = right
        yield line


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "rows, tables and curves", [*SETS, *SETS_WITH_LANDMARKS])
    for name in asked.kinds or SETS:
        for row in run_benchmark(run_of(name, asked.data), asked.output):
            print(name, row["pair"], row["method"], row.get("error"), row.get("outcome"), flush=True)
    write_table(asked.output / "accuracy_table.csv", list(accuracy(write_tables(asked.output))))
    write_table(asked.output / "classes_table.csv", list(classes(read_rows(asked.output))))
