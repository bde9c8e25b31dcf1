"""The contests of the field, by their own rules: all pairs of people, fused limbs, parts, species, two parts.

    python -m isomatch_lab.studies.contests --data DIR -o OUT [NAME ...]

runs `isomatch` without priors over every pair of each set of ``DIR``, with the target relabelled and rotated. Sets that
share triangulations with their targets are run once more with the target decimated. For FAUST, shapes are written with
their ``.vts`` into ``OUT/shapes``, a folder as it is published, and all ordered pairs are matched. Rows that are there
stay. It writes ``contests.csv``, one row for each pair; ``contests_table.csv``; and the cumulative curves of errors,
``curves.csv`` and ``curves.png``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from isomatch import Mesh, write_mesh
from isomatch.evaluation import THRESHOLDS
from isomatch_lab.evaluation import benchmark
from isomatch_lab.studies.shared import UNFLAGGED_OUTCOMES, parse_arguments, write_rows, write_table

POINTS = 1000  # largest number of points of the truth that are measured for each pair; chosen
WRONG_ERROR = 10.0  # 100 × mean error / √area; a pair with a larger one is wrong; chosen
NO_MAP_ERROR = 100.0  # 100 × error / √area of a pair without a map; chosen
COLUMNS = ("contest", "pair", "group", "error", "error_matched", "iou", "outcome", "seconds")
DECIMATED = "decimate:0.5"  # damage that halves the vertices


@dataclass(frozen=True)
class Contest:
    """A set, damage to its targets, and which of its groups count; all by default."""

    title: str
    of: str
    people: range = range(0)
    damage: str | None = None
    groups: Callable[[str], bool] = lambda group: True
    overlap: bool = False  # whether both shapes are parts, whose common part is to be found


def of_one_species(group: str) -> bool:
    """Tell whether source and target of a group such as "cow>dog" are of one species."""
    return len(set(group.split(">"))) == 1


def of_two_species(group: str) -> bool:
    """Tell whether they are of two species."""
    return not of_one_species(group)


CONTESTS = {  # contests by name
    "people_000": Contest("FAUST remeshed, 000–019", "faust_r", range(20)),
    "people_030": Contest("FAUST remeshed, 030–049", "faust_r", range(30, 50)),
    "topkids": Contest("TOPKIDS", "topkids"),
    "topkids_remeshed": Contest("TOPKIDS, target remeshed", "topkids", damage=DECIMATED),
    "cuts": Contest("SHREC'16 cuts", "shrec16_cuts"),
    "cuts_remeshed": Contest("SHREC'16 cuts, whole remeshed", "shrec16_cuts", damage=DECIMATED),
    "holes": Contest("SHREC'16 holes", "shrec16_holes"),
    "holes_remeshed": Contest("SHREC'16 holes, whole remeshed", "shrec16_holes", damage=DECIMATED),
    "species_same": Contest("SMAL, one species", "smal", groups=of_one_species),
    "species_other": Contest("SMAL, two species", "smal", groups=of_two_species),
    "parts": Contest("two cuts of SHREC'16", "shrec16_parts", overlap=True),
    "two_parts": Contest("PARTIALSMAL", "psmal", overlap=True),
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
    kind = name if contest.people else (contest.damage or "as_it_is").replace(":", "_")
    out = output / f"{contest.of}_{kind}"
    result = benchmark(folder, "isomatch", out, n_points=POINTS, distortion=False, damage=contest.damage)
    print(name, result, sep="\n", flush=True)
    return [row for row in result.rows if contest.groups(row.get("group") or "")]


def line(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Sum a contest up."""
    good = [row for row in rows if "problem" not in row]
    errors = np.array([row.get("error", NO_MAP_ERROR) for row in rows])
    matched = [row["error_matched"] for row in good if "error_matched" in row] or errors
    sure = [row["error"] for row in good if row["outcome"] in UNFLAGGED_OUTCOMES]
    return {
        "contest": CONTESTS[name].title,
        "pairs": len(rows),
        "mean": f"{errors.mean():.2f}",
        "median": f"{np.median(errors):.2f}",
        "worst": f"{errors.max():.1f}",
        "wrong (> 10)": int((errors > WRONG_ERROR).sum()),
        "called right": len(sure),
        "of these wrong": sum(error > WRONG_ERROR for error in sure),
        "mean where matched": f"{np.mean(matched):.2f}" if any(row.get("unmatched") for row in good) else "",
        "IoU, %": overlap_of(name, rows),
        "seconds, one thread": f"{np.median([row['seconds'] for row in good]):.1f}",
    }


def overlap_of(name: str, rows: list[dict[str, Any]]) -> str:
    """Mean overlap of found and true common regions, in per cent; of a pair without a map, 0."""
    return f"{100 * np.mean([row.get('iou') or 0.0 for row in rows]):.1f}" if CONTESTS[name].overlap else ""


def curves(rows_by_contest: dict[str, list[dict[str, Any]]], output: Path) -> None:
    """Write and draw which share of the correspondences of a contest has which error, each pair counting alike."""
    shares = {
        CONTESTS[name].title: sum(np.array(row["curve"]) for row in rows if "problem" not in row) / len(rows)
        for name, rows in rows_by_contest.items()
    }
    table = np.column_stack([THRESHOLDS, *shares.values()])
    np.savetxt(
        output / "curves.csv", table, "%.4f", ",", header=",".join(["error / √area", *shares]), comments=""
    )
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots()
    colours: dict[str, str] = {}  # a remeshed set has the colour of its set
    for title, share in shares.items():
        remeshed = title.endswith(" remeshed") and "," in title
        colour = colours.setdefault(title.split(",")[0] if remeshed else title, f"C{len(colours)}")
        axes.plot(100 * THRESHOLDS, 100 * share, "--" if remeshed else "-", color=colour, label=title)
    axes.set(xlim=(0, 100 * THRESHOLDS[-1]), ylim=(0, 100))
    axes.set(xlabel="geodesic error × 100 / √area", ylabel="correspondences with a smaller error, %")
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    figure.savefig(output / "curves.png", dpi=150)


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "contests.csv", CONTESTS)
    rows_by_contest = {
        name: rows_of(name, Path(asked.data), asked.output) for name in asked.kinds or CONTESTS
    }
    measured_pairs = [{"contest": name, **row} for name, rows in rows_by_contest.items() for row in rows]
    write_rows(asked.output / "contests.csv", COLUMNS, measured_pairs)
    write_table(
        asked.output / "contests_table.csv", [line(name, rows) for name, rows in rows_by_contest.items()]
    )
    curves(rows_by_contest, asked.output)
