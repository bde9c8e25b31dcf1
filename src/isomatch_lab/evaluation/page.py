"""The page of a benchmark run: one file that needs no other."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from isomatch._core.files import write_text
from isomatch_lab.evaluation.curves import CurvePanel
from isomatch_lab.evaluation.ledger import set_label

MAX_PAIRS = 20  # largest number of pairs that are shown, the worst ones; chosen
# columns of words, and of sentences; all others hold numbers
TEXT_COLUMNS = ("set", "damage", "group", "pair", "method", "outcome", "judged_at", "version")
SENTENCE_COLUMNS = ("notes", "problem")
PART_COLUMNS = ("iou", "error_matched", "precision", "recall")
"""Columns that say no more than ``unmatched`` where every vertex has a counterpart."""
MEANINGS = {
    "damage": "what was done to the target, or to the shape named after @, and how much; errors and distortions are "
    "measured on the whole shapes, at the points that remain",
    "mean median max": "of the pairs' mean errors",
    "failures": "pairs with a mean error above 10",
    "problems": "pairs that could not be matched or measured; they are left out of the means",
    "auc": "area under the curve of errors up to 25, best 1",
    "within_05 within_10 within_25": "share of correspondences with an error up to that",
    "direct mirrored": "error against the truth, and against it after a left–right flip, where that is known; the "
    "error is the smaller of both for shapes that are truly symmetric, otherwise the direct one",
    "either": "the smaller of direct and mirrored, with one decision for each pair",
    "unmatched": "share of the points with a true image that the map leaves without one; each of these counts as an "
    "error of 100",
    "error_matched": "mean error of the points that have an image; told where some vertices have no counterpart",
    "iou": "area of the vertices that are matched and have a counterpart, over that of those that are or have; "
    "told where some vertices have no counterpart",
    "precision recall": "shares of the matched vertices that have a counterpart, and of the latter that are matched",
    "group": "the group of the pair in its set",
    "error p95": "mean error of a pair, and the error that 95 % of its points do not exceed; the median beside them is "
    "that of the pair's points, too",
    "outcome": "how sure the method is of its map, in the words of isomatch",
    "notes": "what was decided when truth and maps were read",
    "distortion_l2 distortion_l2_truth": "mean squared change of geodesic distances, each shape's divided by its "
    "√area, by the map and by the truth; 100 × 1000 random points",
    "distortion_table distortion_table_truth": "the same as in the paper's table: over the distances within one set "
    "of random points",
    "cycle": "mean distance on the source, × 100 / √(source area), between a vertex and its image under the map and "
    "the same method's map back",
    "image_area": "share of the target's area whose vertices are images",
    "smoothness": "Dirichlet energy of the map / target area: 1 for an isometry, more for a map that stretches or is "
    "discontinuous",
    "error_before": "isomatch, gdd or gdd_post started from the map of the method before the +; the table compares "
    "both on the same pairs: before, after, and the share of pairs for which the value became smaller",
    "seconds": "time of the match, preparation included; of both methods, if one starts from the map of the other; "
    "every row counts the preparation once, though a pair is prepared once for all rows",
    "judged_at": "truth: errors at random points of the dense truth; landmarks: errors at hand-picked landmarks",
    "version": "version of isomatch",
}
"""What columns mean; those that are told of together share an entry, with blanks between them."""
SUMMARY_COLUMNS = (  # columns of the first table
    "method", "judged_at", "version", "pairs", "mean", "median", "max", "failures", "problems", "iou", "error_matched",
    "auc", "within_05", "seconds",
)  # fmt: skip
FURTHER_COLUMNS = (  # columns of the table of further measures
    "method", "either", "unmatched", "precision", "recall", "within_10", "within_25", "distortion_l2",
    "distortion_l2_truth", "distortion_table", "distortion_table_truth", "cycle", "image_area", "smoothness",
)  # fmt: skip
WORST_COLUMNS = (  # columns of the table of the worst pairs
    "pair", "set", "group", "damage", "method", "error", "median", "p95", "direct", "mirrored", "unmatched", "iou",
    "seconds", "outcome", "notes", "problem",
)  # fmt: skip
GAIN_COLUMNS = (  # columns of the table of maps that started from others
    "method", "pairs", "error_before", "error_after", "error_smaller", "distortion_l2_before", "distortion_l2_after",
    "distortion_l2_smaller", "distortion_pairs", "distortion_l2_truth",
)  # fmt: skip
COMMON_COLUMNS = ("judged_at", "version")  # columns that are above the table if all rows agree
GAINS_HTML = '<h2>Started from the map of another method</h2>\n<div class="wide">{}</div>'
CURVE_HTML = '<img src="data:image/svg+xml;base64,{}" alt="{}">'
FORMATS = {
    "{:.2f}": ("mean", "median", "max", "either", "error", "p95", "direct", "mirrored", "cycle", "smoothness",
               "error_matched", "error_before", "error_after"),
    "{:.1%}": ("iou", "precision", "recall", "unmatched", "within_05", "within_10", "within_25", "image_area",
               "error_smaller", "distortion_l2_smaller"),
    "{:.3f}": ("auc",),
    "{:.1f}": ("seconds",),
}  # fmt: skip
"""How numbers are written, so that those of a column can be compared at a glance; others have three digits."""


def write_page(
    path: Path,
    summary: list[dict[str, Any]],
    gains: list[dict[str, Any]],
    rows: list[dict[str, Any]],
    panels: Sequence[CurvePanel],
    left_out: int = 0,
) -> None:
    """Write the HTML page of a run, which says how many rows are left out as they cannot be compared with the others."""
    summary, rows = told_of_parts(summary), told_of_parts(rows)
    worst = sorted(rows, key=lambda row: -row.get("error", float("inf")))[:MAX_PAIRS]
    sets = ", ".join(dict.fromkeys(row["set"] for row in rows))
    once = {
        name: values.pop()
        for name in COMMON_COLUMNS
        if len(values := {row.get(name) for row in summary}) == 1
    }
    sentences = [f"isomatch {once['version']}."] if once.get("version") else []
    sentences += [f"Judged at: {once['judged_at']}."] if once.get("judged_at") else []
    if left_out:
        sentences.append(
            f"Rows of other versions, settings, points, seeds or truth in rows.jsonl, not shown: {left_out}."
        )
    columns = [name for name in SUMMARY_COLUMNS if name not in once]
    every = [(columns, summary), (FURTHER_COLUMNS, summary), (GAIN_COLUMNS, gains), (WORST_COLUMNS, worst)]
    # the meaning of ``judged_at`` is always explained, as a sentence above the table may use it
    shown = {"judged_at"} | {column for names, lines in every for column in _filled_columns(names, lines)}
    page = Template((files("isomatch_lab.evaluation") / "page.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"isomatch bench: {sets}"),
        summary=_table(columns, summary, by_set=True),
        further=_table(FURTHER_COLUMNS, summary, by_set=True),
        gains=GAINS_HTML.format(_table(GAIN_COLUMNS, gains, by_set=True)) if gains else "",
        curves="\n".join(
            CURVE_HTML.format(b64encode(panel.svg()).decode("ascii"), escape(f"Curves of {panel.title}"))
            for panel in panels
        ),
        note=escape(" ".join(sentences)),
        count=f"{len(worst)} of {len(rows)}; those with a problem first. All, with more measures, are in pairs.csv.",
        worst=_table(WORST_COLUMNS, worst),
        columns="".join(
            f"<dt>{escape(', '.join(map(_head, present)))}</dt><dd>{escape(text)}</dd>"
            for names, text in MEANINGS.items()
            if (present := [name for name in names.split() if name in shown])
        ),
    )
    write_text(path, page)


def told_of_parts(lines: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Leave out of rows and summaries what tells something of sets of parts alone.

    Where every vertex has a counterpart, none is matched wrongly: precision is 1, and overlap, recall and the mean error
    of what is matched say no more than the share that is unmatched.

    Parameters
    ----------
    lines : iterable of dict
        Rows, see `read_rows`, or their `summaries`.

    Returns
    -------
    list of dict
        Without "iou", "error_matched", "precision" and "recall" for sets in which no line has a precision below 1.
    """
    lines = list(lines)
    partial = {set_label(line) for line in lines if line.get("precision") not in (None, 1.0)}
    return [
        line if set_label(line) in partial else {k: v for k, v in line.items() if k not in PART_COLUMNS}
        for line in lines
    ]


def _filled_columns(columns: Iterable[str], rows: list[dict[str, Any]]) -> list[str]:
    """Columns that some row fills."""
    return [column for column in columns if any(row.get(column) not in (None, "") for row in rows)]


def _table(columns: Iterable[str], rows: list[dict[str, Any]], by_set: bool = False) -> str:
    """HTML table of the columns that some row fills; by set, with a line above the rows of each."""
    shown = _filled_columns(columns, rows)
    kind = (
        dict.fromkeys(shown, "")
        | dict.fromkeys(TEXT_COLUMNS, " class=words")
        | dict.fromkeys(SENTENCE_COLUMNS, " class=told")
    )
    head = "".join(f"<th scope=col{kind[column]}>{escape(_head(column))}</th>" for column in shown)
    body, last = "", None
    for row in rows:
        if by_set and set_label(row) != last:
            last = set_label(row)
            body += f"<tr class=set><th colspan={len(shown)} scope=colgroup>{escape(last)}</th></tr>"
        cells = "".join(
            f"<td{kind[column]}>{escape(_text(column, row.get(column)))}</td>" for column in shown
        )
        body += f"<tr{' class=bad' if 'problem' in row else ''}>{cells}</tr>"
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _head(column: str) -> str:
    within = column.removeprefix("within_")
    return column.replace("_", " ") if within == column else f"within {int(within)}"


def _text(column: str, value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return next((form for form, names in FORMATS.items() if column in names), "{:.3g}").format(value)
    return str(value).lower().replace("_", " ") if column == "outcome" else str(value)
