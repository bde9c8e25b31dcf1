"""How are parts matched to wholes, and to other parts? At least 20 pairs of each kind of damage.

    python -m isomatch_lab.studies.real_shapes --data DIR -o OUT [KIND ...]

matches without priors and with five true landmarks, and writes ``real_shapes.csv``, one row for each map, and
``real_shapes_table.csv``. Rows that are already in ``OUT/rows`` are not computed again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from isomatch_lab.evaluation import BenchmarkRun, read_rows, run_benchmark
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import in_parallel, parse_arguments, write_rows, write_table

METHODS = ("isomatch", "isomatch_5pt")  # methods that are measured
LEVELS = {  # levels of damage; pairs take them in turn, once for the target and once for the source
    "holes": (0.15, 0.25, 0.4),
    "cut": (0.15, 0.3, 0.5),
    "limb_removed": (0.05, 0.09, 0.18),
    "view": (1,),
    "two views": (2,),
}
BOTH = {"cut": 0.25, "holes": 0.2, "view": 1}  # level of each damage to both shapes; chosen
REAL = {"faust_r": 6, "tosca_iso_r": 6, "scape": 3}  # pairs that are drawn from each real set; chosen
CREATURES = 5  # number of pairs of creatures; chosen
COLUMNS = [
    "kind",
    "damage",
    "set",
    "pair",
    "method",
    "error",
    "median",
    "precision",
    "recall",
    "unmatched",
    "outcome",
    "seconds",
    "n_source",
    "problem",
]
Job = tuple[Path, str, str, str, str, tuple[str, str], int]  # output, data, kind, damage, set, pair, seed


def pairs(data: str, seed: int) -> list[tuple[str, tuple[str, str]]]:
    """Draw 20 pairs of complete shapes."""
    made = [
        (f"{kind}_asymmetric_{i}_{2 * i + seed}_3000", f"{kind}_asymmetric_{i}_{2 * i + seed + 1}_4000")
        for i, kind in zip(range(CREATURES), 3 * ("quadruped", "biped"))
    ]
    return [
        *(
            (name, pair)
            for name, n in REAL.items()
            for pair in benchmark_set(name, data).chosen(n, seed).pairs
        ),
        *(("creatures", pair) for pair in made),
    ]


def jobs(output: Path, data: str) -> list[Job]:
    """List every pair with each kind of damage to one shape, and with some to both."""
    jobs: list[Job] = []
    for number, (kind, levels) in enumerate(LEVELS.items()):
        name = kind.replace("two views", "view")
        for i, (set_name, pair) in enumerate(pairs(data, number)):
            side = "@source" * (i % 2)
            damage = f"{name}:{levels[(i // 2) % len(levels)]}{side}"
            jobs.append((output, data, kind, damage, set_name, pair, i))
    for kind, level in BOTH.items():
        for i, (set_name, pair) in enumerate(pairs(data, len(LEVELS))):
            jobs.append((output, data, f"{kind}, both", f"{kind}:{level}@both", set_name, pair, i))
    return jobs


def measure_job(job: Job) -> list[dict[str, Any]]:
    """Match one pair without and with landmarks."""
    output, data, kind, damage, set_name, pair, seed = job
    folder = output / "rows" / "-".join([damage.replace(":", "_"), *pair])
    run = BenchmarkRun(set_name, METHODS, data, n_points=400, jobs=1, seed=seed, pairs=(pair,), damage=damage)
    list(run_benchmark(run, folder))
    return [row | {"kind": kind} for row in read_rows(folder)]


def table(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each kind and method: errors, wrong maps, those called right, and right maps not called right."""
    lines = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        for method in METHODS:
            members = [row for row in rows if (row["kind"], row["method"]) == (kind, method)]
            errors = np.array([100.0 if row.get("error") is None else row["error"] for row in members])
            called = np.array([row.get("outcome") in ("CONVERGED", "PARTIAL") for row in members])
            measured = [row for row in members if row.get("recall") is not None]
            precision, recall = (
                np.mean([row[name] for row in measured]) if measured else np.nan
                for name in ("precision", "recall")
            )
            wrong = errors > 10
            seconds = np.nanmean([row.get("seconds") or np.nan for row in members])
            lines.append(
                {
                    "kind": kind,
                    "method": f"`{method}`",
                    "pairs": len(members),
                    "mean": f"{errors.mean():.1f}",
                    "median": f"{np.median(errors):.1f}",
                    "wrong": wrong.sum(),
                    "of them called right": (called & wrong).sum(),
                    "right, flagged": (~called & ~wrong).sum(),
                    "precision": f"{precision:.2f}",
                    "recall": f"{recall:.2f}",
                    "seconds": f"{seconds:.1f}",
                }
            )
    return lines


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "real_shapes.csv", [*LEVELS, *(f"{kind}, both" for kind in BOTH)])
    wanted = [job for job in jobs(asked.output, asked.data) if not asked.kinds or job[2] in asked.kinds]
    rows = [row for rows in in_parallel(measure_job, wanted) for row in rows]
    write_rows(asked.output / "real_shapes.csv", COLUMNS, rows)
    write_table(asked.output / "real_shapes_table.csv", table(rows))
