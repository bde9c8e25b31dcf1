"""The tables of a folder of benchmark runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isomatch._core.files import staged
from isomatch._core.texts import write_csv
from isomatch_lab.evaluation.curves import PublishedCurve, curve_panels, draw_curves
from isomatch_lab.evaluation.ledger import Row, identity_of, read_rows
from isomatch_lab.evaluation.page import write_page

FAILURE_ERROR = 10.0  # 100 × mean error; a pair with a larger one counts as failed; chosen
COLUMNS = (
    "set", "damage", "group", "pair", "method", "points", "seed", "judged_at", "version", "settings", "data", "n_source",
    "n_target", "error", "median", "p95", "direct", "mirrored", "either", "unmatched", "error_matched", "precision",
    "recall", "iou", "auc", "within_05", "within_10", "within_25",
    "distortion_l2", "distortion_l2_truth", "distortion_table", "distortion_table_truth", "cycle",
    "image_area", "smoothness", "seconds", "outcome", "notes", "problem",
)  # fmt: skip
AVERAGED = ("either", *COLUMNS[COLUMNS.index("unmatched") : COLUMNS.index("outcome")])


def write_tables(out: str | Path, published: Sequence[PublishedCurve] = ()) -> list[dict[str, Any]]:
    """Write tables, curves and a page of the rows in a folder.

    Of each set, damage and method, only the rows that agree with the last one in points, seed, version and settings are
    shown, and of each set only rows with the kind of truth of its last row, because a mean over others would mislead.
    The page says how many rows are left out.

    Parameters
    ----------
    out : path_like
        Folder of the runs. ``pairs.csv``, ``summary.csv``, ``improvements.csv`` (see `improvements`), ``curves.png``,
        ``curves.svg`` and ``index.html``, a page that needs no other file, are written into it.
    published : sequence of PublishedCurve
        Published curves to draw for comparison; curves of other sets are ignored.

    Returns
    -------
    list of dict
        The summary, see `summaries`.
    """
    out = Path(out)
    every = read_rows(out)
    rows = sorted(_comparable(every), key=lambda row: (*_group(row), row["pair"]))
    table = summaries(rows)
    gains = improvements(rows)
    # an interrupted run leaves all of the earlier files, or all new ones
    with staged(out, "index.html" if table else "pairs.csv") as new:
        _write_csv(new / "pairs.csv", rows, COLUMNS)
        if table:
            _write_csv(new / "summary.csv", table, tuple(table[0]))
            if gains:
                _write_csv(new / "improvements.csv", gains, tuple(gains[0]))
            panels = curve_panels(rows, published)
            draw_curves(panels, new)
            write_page(new / "index.html", table, gains, rows, panels, len(every) - len(rows))
    return table


def _comparable(rows: list[Row]) -> list[Row]:
    """Keep the rows that differ from the last of their group in the pair alone; one kind of truth a set."""

    def kind(row: Row) -> tuple[Any, ...]:
        return identity_of(row | {"pair": ""})

    truth = {row["set"]: row.get("judged_at") for row in rows}
    rows = [row for row in rows if row.get("judged_at") == truth[row["set"]]]
    last = {_group(row): kind(row) for row in rows}
    return [row for row in rows if kind(row) == last[_group(row)]]


def _group(row: Row) -> tuple[str, str, str]:
    """Set, damage ("" without) and method of a row: means are taken over rows in which these agree."""
    return row["set"], row.get("damage") or "", row["method"]


def summaries(rows: list[Row]) -> list[dict[str, Any]]:
    """Mean, median and largest error, failures, and means of the other measures, for each set, damage and method."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault(_group(row), []).append(row)
    table = []
    for (name, damage, method), members in groups.items():
        good = [row for row in members if "problem" not in row]
        errors = np.array([row["error"] for row in good])
        table.append(
            {
                "set": name,
                "damage": damage,
                "method": method,
                "judged_at": members[-1].get("judged_at"),
                "version": members[-1].get("version"),
                "pairs": len(members),
                "mean": float(errors.mean()) if len(good) else None,
                "median": float(np.median(errors)) if len(good) else None,
                "max": float(errors.max()) if len(good) else None,
                "failures": int((errors > FAILURE_ERROR).sum()),
                "problems": len(members) - len(good),
                **{key: _mean([row.get(key) for row in good]) for key in AVERAGED},
            }
        )
    return table


def improvements(rows: list[Row]) -> list[dict[str, Any]]:
    """Compare maps that were started from another method's map with that map, on the pairs for which both exist.

    For each set, damage and such method: mean error and distortion before and after, and the share of pairs for which
    each became smaller. The distortion of a map that tears is infinite: it counts for that share, but not for the means,
    and "distortion_pairs" is the number of the other pairs.
    """
    good = {(*_group(row), row["pair"]): row for row in rows if "problem" not in row}
    groups: dict[tuple[str, str, str], list[tuple[Row, Row]]] = {}
    for (name, damage, method, pair), row in good.items():
        before = good.get((name, damage, method.partition("+")[0], pair))
        if "+" in method and before:
            groups.setdefault((name, damage, method), []).append((before, row))
    table = []
    for (name, damage, method), members in groups.items():
        line: dict[str, Any] = {"set": name, "damage": damage, "method": method, "pairs": len(members)}
        for key in ("error", "distortion_l2"):
            measured = [[row[key] for row in both] for both in members if all(key in row for row in both)]
            values = np.array(measured, dtype=np.float64).reshape(-1, 2)  # the None of torn maps becomes nan
            before, after = np.where(np.isnan(values), np.inf, values).T
            finite = np.isfinite(before) & np.isfinite(after)
            line[f"{key}_before"], line[f"{key}_after"] = (_mean(x[finite].tolist()) for x in (before, after))
            line[f"{key}_smaller"] = float((after < before).mean()) if measured else None
        line["distortion_pairs"] = int(finite.sum())
        line["distortion_l2_truth"] = _mean([row.get("distortion_l2_truth") for _, row in members])
        table.append(line)
    return table


def _mean(values: list[float | None]) -> float | None:
    finite = [value for value in values if value is not None]
    return float(np.mean(finite)) if finite else None


def _write_csv(path: Path, rows: list[dict[str, Any]], columns: tuple[str, ...]) -> None:
    rounded = (
        {key: float(f"{value:.5g}") if isinstance(value, float) else value for key, value in row.items()}
        for row in rows
    )
    write_csv(path, rounded, columns)
