"""Tables of benchmark runs."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.evaluation.benchmark import read_rows
from isomatch.evaluation.curves import draw_curves
from isomatch.evaluation.page import write_page
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
        Folder of the run. ``pairs.csv``, ``summary.csv``, ``improvements.csv`` (see `improvements`), ``curves.png``,
        ``curves.svg`` and ``index.html``, one page that needs no other file, are written into it.
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
        gains = improvements(rows)
        if gains:
            _write_csv(out / "improvements.csv", gains, tuple(gains[0]))
        draw_curves(rows, published, out)
        write_page(out / "index.html", table, gains, rows, (out / "curves.svg").read_bytes())
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


def improvements(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Compare what starts from a method's map with the method itself, on the pairs that both mapped.

    For each set and continued method: mean error and distortion before and after, and the share of pairs in which each
    became smaller. Distortion is infinite where a map tears; its means are those of the other pairs, which are counted.
    """
    good = {(row["set"], row["method"], row["pair"]): row for row in rows if "problem" not in row}
    groups: dict[tuple[str, str], list[tuple[dict[str, Any], dict[str, Any]]]] = {}
    for (name, method, pair), row in good.items():
        before = good.get((name, method.partition("+")[0], pair))
        if "+" in method and before:
            groups.setdefault((name, method), []).append((before, row))
    table = []
    for (name, method), members in groups.items():
        line: dict[str, Any] = {"set": name, "method": method, "pairs": len(members)}
        for key in ("error", "distortion_l2"):
            values = [[np.inf if row[key] is None else row[key] for row in both] for both in members]
            before, after = np.array(values).T
            whole = np.isfinite(before) & np.isfinite(after)
            line[f"{key}_before"], line[f"{key}_after"] = (_mean(x[whole].tolist()) for x in (before, after))
            line[f"{key}_smaller"] = float((after < before).mean())
        line["distortion_pairs"] = int(whole.sum())
        line["distortion_l2_truth"] = _mean([row["distortion_l2_truth"] for _, row in members])
        table.append(line)
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
