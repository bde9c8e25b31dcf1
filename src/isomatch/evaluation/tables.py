"""Tables and curves of benchmark runs."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.evaluation.benchmark import read_rows
from isomatch.evaluation.page import write_page
from isomatch.evaluation.princeton import LIMIT, THRESHOLDS
from isomatch.evaluation.published_curves import PublishedCurve

FAILURE = 10.0  # mean error × 100 above which a pair counts as failed
COLUMNS = (
    "set", "pair", "method", "n_source", "n_target", "error", "median", "p95", "direct", "mirrored",
    "either", "unmatched", "auc", "within_05", "within_10", "within_25", "distortion_l2", "distortion_l2_truth",
    "coverage", "smoothness", "seconds", "outcome", "problem",
)  # fmt: skip
AVERAGED = ("either", *COLUMNS[COLUMNS.index("auc") : COLUMNS.index("outcome")])


def write_tables(out: str | Path, published: Sequence[PublishedCurve] = ()) -> list[dict[str, Any]]:
    """Write what a run has found so far.

    Parameters
    ----------
    out : path_like
        Folder of the run. ``pairs.csv``, ``summary.csv``, ``curves.png``, ``curves.svg`` and ``index.html``, one page
        that needs no other file, are written into it.
    published : sequence of PublishedCurve
        Curves to draw beside, those of the sets that were run.

    Returns
    -------
    list of dict
        The summary, see `summaries`.
    """
    out = Path(out)
    rows = sorted(read_rows(out), key=lambda row: (row["set"], row["method"], row["pair"]))
    table = summaries(rows)
    _write_csv(out / "pairs.csv", rows, COLUMNS)
    if table:
        _write_csv(out / "summary.csv", table, tuple(table[0]))
        _draw_curves(rows, published, out)
        write_page(out / "index.html", table, rows, (out / "curves.svg").read_bytes())
    return table


def summaries(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean, median, worst, failures and means of the other measures for each set and method, in order of appearance."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["set"], row["method"]), []).append(row)
    table = []
    for (name, method), members in groups.items():
        good = [row for row in members if "problem" not in row]
        errors = np.array([row["error"] for row in good])
        table.append(
            {
                "set": name,
                "method": method,
                "pairs": len(members),
                "mean": float(errors.mean()) if len(good) else None,
                "median": float(np.median(errors)) if len(good) else None,
                "max": float(errors.max()) if len(good) else None,
                "failures": int((errors > FAILURE).sum()),
                "problems": len(members) - len(good),
                **{key: _mean([row.get(key) for row in good]) for key in AVERAGED},
            }
        )
    return table


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _write_csv(path: Path, rows: list[dict[str, Any]], columns: tuple[str, ...]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(
            {key: float(f"{value:.5g}") if isinstance(value, float) else value for key, value in row.items()}
            for row in rows
        )


def _draw_curves(rows: list[dict[str, Any]], published: Sequence[PublishedCurve], out: Path) -> None:
    from matplotlib.figure import Figure

    curves: dict[str, list[list[float]]] = {}
    for row in rows:
        if "curve" in row:
            curves.setdefault(f"{row['set']}, {row['method']}", []).append(row["curve"])
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot(
        xlabel="geodesic error / √(target area)", ylabel="correspondences, %", xlim=(0, LIMIT), ylim=(0, 101)
    )
    for (label, members), style in zip(curves.items(), ("-", "--", "-.", ":") * len(curves)):
        axes.plot(
            THRESHOLDS, 100 * np.mean(members, axis=0), style, lw=2, label=f"{label} ({len(members)} pairs)"
        )
    beside = [curve for curve in published if curve.set_name in {row["set"] for row in rows}]
    for i, curve in enumerate(beside):
        colour, dashes = f"C{i % 9 + 1}", ("-", "--", ":")[i // 9 % 3]
        label = f"{curve.set_name}, {curve.method} (published)"
        axes.plot(curve.errors, 100 * curve.shares, dashes, color=colour, lw=0.8, label=label)
    axes.grid(alpha=0.3)
    if beside:
        axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize="x-small")
        figure.set_size_inches(9.5, 4.5)
    elif curves:
        axes.legend(loc="lower right")
    for suffix in ("png", "svg"):
        figure.savefig(out / f"curves.{suffix}", dpi=150)
