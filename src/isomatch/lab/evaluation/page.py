"""The page of a benchmark run: one file that needs no other."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from isomatch.storage.files import write_text

MOST_PAIRS = 20  # worst pairs shown
WORDS = ("set", "damage", "group", "pair", "method", "outcome", "judged_at", "version")  # columns of text
TOLD = ("notes", "problem")  # of sentences
MEANINGS = {
    "damage": "what was done to the target, or to the shape named after @, and how much; errors and distortions are "
    "measured on the whole shapes, at the points that remain",
    "mean, median, max": "of the pairs' mean errors",
    "failures": "pairs with a mean error above 10",
    "problems": "pairs that could not be matched or measured; they are left out of the means",
    "auc": "area under the cumulative curve of errors up to 0.25, best 1",
    "within_05, within_10, within_25": "share of correspondences with an error up to 0.05, 0.10, 0.25 √(target area)",
    "direct, mirrored": "error against the truth, and against the truth after a left–right flip, where that is known; "
    "the error is the smaller of both for shapes that are truly symmetric, otherwise the direct one",
    "either": "the smaller of direct and mirrored, with one decision for each pair",
    "unmatched": "share of the points with a true image that the map leaves without one; "
    "each of these counts as an error of 100",
    "error_matched": "mean error of the others, where the truth tells which have a counterpart",
    "iou": "area of the vertices that are matched and have a counterpart, over that of those that are or have",
    "precision, recall": "shares of the matched vertices that have a counterpart, and of the latter that are matched",
    "group": "the group of the pair in its set",
    "notes": "what was decided when truth and maps were read",
    "distortion_l2, distortion_l2_truth": "mean squared change of geodesic distances, each shape's divided by its √area, "
    "by the map and by the truth; 100 × 1000 random points",
    "distortion_table, distortion_table_truth": "the same as in the paper's table: over the distances within one set of "
    "random points",
    "cycle": "mean distance on the source, × 100 / √(source area), between a vertex and its image under the map and the "
    "same method's map back",
    "image_area": "share of the target's area whose vertices are images",
    "smoothness": "Dirichlet energy of the map / target area: 1 for an isometry, more for a map that stretches or is "
    "discontinuous",
    "name+isomatch, name+gdd, name+gdd_post": "isomatch, gdd or gdd_post started from the map of that method; the table "
    "compares both on the same pairs: before, after, and the share of pairs for which the value became smaller",
    "seconds": "time of the match, preparation included; of both methods, if one starts from the map of the other; every "
    "row counts the preparation once, though a pair is prepared once for all rows",
    "judged_at": "truth: errors at random points of the dense truth; landmarks: errors at hand-picked landmarks",
    "version": "version of isomatch",
}
SUMMARY = (
    "set", "damage", "method", "judged_at", "version", "pairs", "mean", "median", "max", "either", "failures", "problems",
    "unmatched", "error_matched", "iou", "precision", "recall",
    "auc", "within_05", "within_10", "within_25", "distortion_l2", "distortion_l2_truth", "distortion_table",
    "distortion_table_truth", "cycle", "image_area", "smoothness", "seconds",
)  # fmt: skip
WORST = (
    "set", "damage", "group", "pair", "method", "error", "median", "p95", "direct", "mirrored", "unmatched",
    "error_matched", "iou", "distortion_l2", "cycle", "image_area", "smoothness", "seconds", "outcome", "notes",
    "problem",
)  # fmt: skip
GAINS = '<h2>Started from the map of another method</h2>\n<div class="wide">{}</div>'


def write_page(
    path: Path,
    summary: list[dict[str, Any]],
    gains: list[dict[str, Any]],
    rows: list[dict[str, Any]],
    curves: bytes,
    left_out: int = 0,
) -> None:
    """Write the page of a run.

    Parameters
    ----------
    path : Path
        HTML file to write; an existing one is replaced.
    summary, gains, rows : list of dict
        One for each set and method, one for each set and method started from another map, and one for each pair.
    curves : bytes
        Picture of the curves, SVG.
    left_out : int
        Number of rows in the folder that are not shown because they cannot be compared with the others.
    """
    worst = sorted(rows, key=lambda row: -row.get("error", float("inf")))[:MOST_PAIRS]
    sets = ", ".join(dict.fromkeys(row["set"] for row in rows))
    page = Template((files("isomatch.lab.evaluation") / "page.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"isomatch bench: {sets}"),
        summary=_table(SUMMARY, summary),
        gains=GAINS.format(_table(tuple(gains[0]), gains)) if gains else "",
        curves="data:image/svg+xml;base64," + b64encode(curves).decode("ascii"),
        note=f"Rows of other versions, settings, points, seeds or truth in rows.jsonl, not shown: {left_out}."
        if left_out
        else "",
        count=f"{len(worst)} of {len(rows)}; those with a problem first.",
        worst=_table(WORST, worst),
        columns="".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in MEANINGS.items()),
    )
    write_text(path, page)


def _table(columns: Iterable[str], rows: list[dict[str, Any]]) -> str:
    """HTML table of the columns that some row fills."""
    shown = [column for column in columns if any(row.get(column) not in (None, "") for row in rows)]
    kind = (
        dict.fromkeys(shown, "") | dict.fromkeys(WORDS, " class=words") | dict.fromkeys(TOLD, " class=told")
    )
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
