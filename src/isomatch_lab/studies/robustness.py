"""How do maps fare as the target is damaged more and more? Every damage at every level, isomatch and pyFM.

    python -m isomatch_lab.studies.robustness --data DIR -o OUT

writes ``robustness.csv``, one row for each map, ``robustness_table.csv`` and ``robustness.svg``. Rows that are
already in ``OUT/rows`` are not computed again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from isomatch_lab.damage import DAMAGES
from isomatch_lab.evaluation import BenchmarkRun, read_rows, run_benchmark
from isomatch_lab.studies.shared import (
    UNFLAGGED_OUTCOMES,
    in_parallel,
    parse_arguments,
    write_rows,
    write_table,
)

METHODS = ("isomatch", "pyfm")  # methods that are measured
POINTS = 400  # number of points of the truth that are measured for each pair; chosen
PAIRS = (  # sets and two shapes
    ("creatures", "quadruped_asymmetric_0_1_3000", "quadruped_asymmetric_0_2_3000"),
    ("faust_r", "tr_reg_000", "tr_reg_011"),
    ("creatures", "biped_asymmetric_1_3_3000", "biped_asymmetric_1_4_3000"),
    ("tosca_iso_r", "horse0", "horse5"),
)
TOUCHING = (  # pairs in which limbs of the target touch
    ("faust_r", "tr_reg_010", "tr_reg_016"),
    ("tosca_iso_r", "victoria0", "victoria7"),
    ("tosca_iso_r", "victoria1", "victoria25"),
)
COLUMNS = ("damage", "level", "set", "pair", "method", "error", "outcome", "seconds", "problem")
COLOURS = {"isomatch": "black", "pyfm": "#3f90da"}
Job = tuple[Path, str, str | None, float | None, tuple[str, str, str]]  # output, data, damage, level, pair


def jobs(output: Path, data: str) -> list[Job]:
    """List every pair undamaged, and with each damage at each level."""
    jobs: list[Job] = []
    for pair in (*TOUCHING, *PAIRS):
        jobs.append((output, data, None, None, pair))
        for name, damage in DAMAGES.items():
            if (name == "weld") == (pair in TOUCHING):
                jobs += [(output, data, name, level, pair) for level in damage.levels]
    return jobs


def measure(job: Job) -> list[dict[str, Any]]:
    """Match one pair by each method."""
    output, data, damage, level, (name, *pair) = job
    text = None if damage is None else f"{damage}:{level}"
    folder = output / "rows" / "-".join([str(text).replace(":", "_"), *pair])
    chosen_pair = (pair[0], pair[1])
    run = BenchmarkRun(name, METHODS, data, n_points=POINTS, jobs=1, pairs=(chosen_pair,), damage=text)
    list(run_benchmark(run, folder))
    return [row | {"damage": damage or "none", "level": level} for row in read_rows(folder)]


def chosen(rows: list[dict[str, Any]], damage: str, level: float | None, method: str) -> list[dict[str, Any]]:
    """Rows of one damage at one level; undamaged pairs are those that the damage is done to."""
    wanted = {"-".join(pair[1:]) for pair in (TOUCHING if damage == "weld" else PAIRS)}
    kind = "none" if level is None else damage
    return [
        row
        for row in rows
        if (row["damage"], row["level"], row["method"]) == (kind, level, method) and row["pair"] in wanted
    ]


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the error of each map, and means over the pairs, against the level; maps not called right are hollow."""
    figure = Figure((14, 7), layout="constrained")
    for (name, damage), axes in zip(DAMAGES.items(), figure.subplots(2, 4, sharey=True).ravel()):
        levels = (None, *damage.levels)
        for side, method in zip((-0.1, 0.1), METHODS):
            means = []
            for place, level in enumerate(levels):
                members = [row for row in chosen(rows, name, level, method) if row.get("error") is not None]
                means.append(np.mean([row["error"] for row in members]) if members else np.nan)
                for row in members:
                    right = row["outcome"] in (*UNFLAGGED_OUTCOMES, "")
                    colour = COLOURS[method]
                    axes.plot(
                        place + side, row["error"], "o", ms=4, mec=colour, mfc=colour if right else "none"
                    )
            axes.plot(np.arange(len(levels)) + side, means, color=COLOURS[method], label=method)
        axes.axhline(10, color="grey", linewidth=0.7, linestyle=":")
        axes.set_xticks(range(len(levels)), ["none", *map("{:g}".format, damage.levels)])
        axes.set(title=name, xlabel=damage.level, yscale="symlog", ylim=(0, 110))
        axes.set_yticks([0, 1, 3, 10, 30, 100], ["0", "1", "3", "10", "30", "100"])
        axes.grid(alpha=0.3)
    figure.axes[0].legend()
    figure.supylabel("mean geodesic error × 100 / √(area of the whole target)")
    figure.savefig(path)


def table(rows: list[dict[str, Any]]) -> list[dict[str, str]]:
    """For each damage and level: mean and largest error, wrong maps, and wrong maps that are called right."""
    lines = []
    for name, damage in DAMAGES.items():
        for level in (None, *damage.levels):
            line = {"damage": f"`{name}`", "level": "none" if level is None else f"{level:g}"}
            for method in METHODS:
                members = chosen(rows, name, level, method)
                errors = np.array([row["error"] for row in members if row.get("error") is not None])
                called = [row["error"] > 10 for row in members if row.get("outcome") in UNFLAGGED_OUTCOMES]
                line[f"{method}: mean, worst"] = f"{errors.mean():.1f}, {errors.max():.1f}"
                line[f"{method}: wrong"] = f"{(errors > 10).sum()} of {len(errors)}"
                if method == "isomatch":
                    line["called right, of them wrong"] = f"{len(called)}, {sum(called)}"
            lines.append(line)
    return lines


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "tables and curves")
    rows = [row for rows in in_parallel(measure, jobs(asked.output, asked.data)) for row in rows]
    write_rows(asked.output / "robustness.csv", COLUMNS, rows)
    draw(rows, asked.output / "robustness.svg")
    write_table(asked.output / "robustness_table.csv", table(rows))
