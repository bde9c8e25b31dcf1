"""The contests of the field, by their own rules: all pairs of people, fused limbs, parts, species, two parts.

    python benchmarks/contests.py --data DIR -o OUT [NAME ...]

runs `isomatch` without hints over every pair of each set of ``DIR``, with the target relabelled and rotated. Sets that
share triangulations with their targets are run once more with the target decimated. For FAUST, shapes are written with
their ``.vts`` into ``OUT/shapes``, a folder as it is published, and all ordered pairs are matched. It writes
``contests.csv``, one row for each pair, ``contests_table.csv`` and ``contests.png``. Rows that are there stay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from isomatch import Mesh, write_mesh
from isomatch.lab.evaluation import benchmark
from studies import SURE, asked_for, write_rows, write_table

POINTS = 1000  # of the truth of each pair
WRONG = 10.0  # × √area / 100
COLUMNS = ("contest", "pair", "group", "error", "iou", "outcome", "seconds")
DECIMATED = "decimate:0.5"


@dataclass(frozen=True)
class Contest:
    """A set, damage to its targets, and which of its groups count; all by default."""

    of: str
    people: range = range(0)
    damage: str | None = None
    groups: Callable[[str], bool] = lambda group: True


def same(group: str) -> bool:
    """Tell whether source and target of a group such as "cow>dog" are of one species."""
    return len(set(group.split(">"))) == 1


def other(group: str) -> bool:
    """Tell whether they are of two species."""
    return not same(group)


CONTESTS = {
    "people_000": Contest("faust_r", range(20)),
    "people_030": Contest("faust_r", range(30, 50)),
    "topkids": Contest("topkids"),
    "topkids_remeshed": Contest("topkids", damage=DECIMATED),
    "cuts": Contest("shrec16_cuts"),
    "cuts_remeshed": Contest("shrec16_cuts", damage=DECIMATED),
    "holes": Contest("shrec16_holes"),
    "holes_remeshed": Contest("shrec16_holes", damage=DECIMATED),
    "parts": Contest("shrec16_parts"),
    "species_same": Contest("smal", groups=same),
    "species_other": Contest("smal", groups=other),
    "two_parts": Contest("psmal"),
}


def people(data: Path, folder: Path, numbers: range) -> Path:
    """Write shapes of FAUST remeshed as they are published: a mesh and a ``.vts``, which counts from 1."""
    (folder / "shapes").mkdir(parents=True, exist_ok=True)
    for name in (f"tr_reg_{number:03d}" for number in numbers):
        path = folder / "shapes" / f"{name}.ply"
        if not path.exists():
            with np.load(data / "faust_r" / f"{name}.npz") as arrays:
                np.savetxt(path.with_suffix(".vts"), arrays["vts"] + 1, fmt="%d")
                write_mesh(path, Mesh(arrays["vertices"], arrays["faces"]))
    return folder


def rows_of(name: str, data: Path, output: Path) -> list[dict[str, Any]]:
    """Match the pairs of a contest."""
    contest = CONTESTS[name]
    folder = people(data, output / "shapes" / name, contest.people) if contest.people else data / contest.of
    out = (
        output / f"{contest.of}_{contest.damage or name if contest.people else contest.damage or 'as_it_is'}"
    )
    found = benchmark(folder, "isomatch", out, n_points=POINTS, distortion=False, damage=contest.damage)
    print(name, found, sep="\n", flush=True)
    return [row for row in found.rows if contest.groups(row.get("group") or "")]


def line(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Sum a contest up."""
    good = [row for row in rows if "problem" not in row]
    errors = np.array([row["error"] for row in good])
    overlaps = [row["iou"] for row in good if row.get("iou") is not None]
    sure = [row["error"] for row in good if row["outcome"] in SURE]
    return {
        "contest": name,
        "pairs": len(rows),
        "mean": f"{errors.mean():.2f}",
        "median": f"{np.median(errors):.2f}",
        "worst": f"{errors.max():.1f}",
        "wrong (> 10)": int((errors > WRONG).sum()) + len(rows) - len(good),
        "IoU, %": f"{100 * np.mean(overlaps):.0f}" if overlaps else "",
        "called right, of these wrong": f"{len(sure)}, {sum(error > WRONG for error in sure)}",
        "seconds": f"{np.median([row['seconds'] for row in good]):.1f}",
    }


def drawn(lines: dict[str, list[dict[str, Any]]], path: Path) -> None:
    """Draw which share of the pairs has which mean error."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    for name, rows in lines.items():
        errors = np.sort([row["error"] for row in rows if "problem" not in row])
        axes.step(errors, 100 * np.arange(1, len(errors) + 1) / len(rows), where="post", label=name)
    axes.set(xscale="log", xlim=(0.1, 60), ylim=(0, 100))
    axes.set(xlabel="mean error of a pair × 100 / √area", ylabel="pairs with a smaller error, %")
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    asked = asked_for(__doc__, "contests.csv", CONTESTS)
    found = {name: rows_of(name, Path(asked.data), asked.output) for name in asked.kinds or CONTESTS}
    each = [{"contest": name, **row} for name, rows in found.items() for row in rows]
    write_rows(asked.output / "contests.csv", COLUMNS, each)
    write_table(asked.output / "contests_table.csv", [line(name, rows) for name, rows in found.items()])
    drawn(found, asked.output / "contests.png")
