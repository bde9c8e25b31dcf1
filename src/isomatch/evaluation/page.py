"""One page that tells how a benchmark run went, and needs no other file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

MOST_PAIRS = 20  # worst pairs shown
WORDS = ("set", "pair", "method", "outcome", "problem")  # columns of text
MEANINGS = {
    "mean, median, max": "of the pairs' mean errors",
    "failures": "pairs with a mean error above 10",
    "problems": "pairs without a map; they are left out of the means",
    "auc": "area under the cumulative curve of errors up to 0.25, best 1",
    "within_05, within_10, within_25": "share of correspondences with an error up to 0.05, 0.10, 0.25 √(target area)",
    "direct, mirrored": "error against the truth, and against the truth after a left–right flip, where that is known; "
    "error is the smaller one for shapes that are truly symmetric, else the direct",
    "either": "the smaller of direct and mirrored, one decision for each pair",
    "distortion_l2, distortion_l2_truth": "mean squared change of geodesic distances, each shape in its own √area, by "
    "the map and by the truth",
    "coverage": "share of the target's area whose vertices are images",
    "smoothness": "Dirichlet energy of the map / target area: 1 for an isometry, more where it stretches or jumps",
    "name+isomatch, name+gdd, name+gdd_post": "these, started from the map of that method; the table compares both on "
    "the same pairs: before, after, and the share of pairs in which it became smaller",
    "seconds": "of the match, preparation included; of both methods, where one starts from the "
    "other; every row counts the preparation it needs once, though a pair is prepared once for all",
}
SUMMARY = (
    "set", "method", "pairs", "mean", "median", "max", "either", "failures", "problems", "auc", "within_05", "within_10",
    "within_25", "distortion_l2", "distortion_l2_truth", "coverage", "smoothness", "seconds",
)  # fmt: skip
WORST = (
    "set", "pair", "method", "error", "median", "p95", "direct", "mirrored", "distortion_l2", "coverage", "smoothness",
    "seconds", "outcome", "problem",
)  # fmt: skip
GAINS = '<h2>Started from another\'s map</h2>\n<div class="wide">{}</div>'


def write_page(
    path: Path,
    summary: list[dict[str, Any]],
    gains: list[dict[str, Any]],
    rows: list[dict[str, Any]],
    curves: bytes,
) -> None:
    """Write the page of a run.

    Parameters
    ----------
    path : Path
        HTML file to write; an existing one is replaced.
    summary, gains, rows : list of dict
        One for each set and method, one for each set and method that starts from another's map, and one for each pair.
    curves : bytes
        Picture of the curves, SVG.
    """
    worst = sorted(rows, key=lambda row: -row.get("error", float("inf")))[:MOST_PAIRS]
    sets = ", ".join(dict.fromkeys(row["set"] for row in rows))
    page = Template((files("isomatch.evaluation") / "page.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"isomatch bench: {sets}"),
        summary=_table(SUMMARY, summary),
        gains=GAINS.format(_table(tuple(gains[0]), gains)) if gains else "",
        curves="data:image/svg+xml;base64," + b64encode(curves).decode("ascii"),
        told=f"{len(worst)} of {len(rows)}; those without a map first.",
        worst=_table(WORST, worst),
        columns="".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in MEANINGS.items()),
    )
    path.write_text(page, encoding="utf-8")


def _table(columns: Iterable[str], rows: list[dict[str, Any]]) -> str:
    """HTML table of the columns that some row fills."""
    shown = [column for column in columns if any(row.get(column) not in (None, "") for row in rows)]
    kind = {column: " class=words" if column in WORDS else "" for column in shown}
    head = "".join(f"<th scope=col{kind[column]}>{escape(column)}</th>" for column in shown)
    body = "".join(
        f"<tr{' class=bad' if 'problem' in row else ''}>"
        + "".join(f"<td{kind[column]}>{escape(_text(row.get(column)))}</td>" for column in shown)
        + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _text(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
