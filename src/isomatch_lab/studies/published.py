"""Published numbers of the contests, from ``published.csv``, with those of isomatch among them.

`beside` renders a table for each contest of ``docs/results/contests.csv`` on which others published. See ``results.py``.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

PUBLISHED = Path(__file__).with_suffix(".csv")
OURS = {  # contest in published.csv: heading, and our rows of it in contests.csv with what they are of
    "faust": (
        "FAUST remeshed",
        {"FAUST remeshed, 000–019": "of 000–019", "FAUST remeshed, 030–049": "of 030–049"},
    ),
    "topkids": ("TOPKIDS", {"TOPKIDS": "of the set"}),
    "cuts": ("SHREC'16 cuts", {"SHREC'16 cuts": "of four classes, file units"}),
    "holes": ("SHREC'16 holes", {"SHREC'16 holes": "of four classes"}),
    "smal": (
        "SMAL",
        {"SMAL, two species": "between two species", "SMAL, one species": "within a species"},
    ),
    "psmal": ("PARTIALSMAL", {"PARTIALSMAL": "of five species"}),
}
Row = dict[str, str]


def beside(results: Path) -> str:
    """Render the tables; the best comes first, by overlap where all have one, else by error."""
    with (results / "contests.csv").open(newline="", encoding="utf-8") as file:
        measured = {row["contest"]: row for row in csv.DictReader(file)}
    with PUBLISHED.open(newline="", encoding="utf-8") as file:
        published = list(csv.DictReader(file))
    tables = []
    for contest, (title, ours) in OURS.items():
        rows = [*_of(contest, published), *(_ours(measured[name], what) for name, what in ours.items())]
        tables.append(f"### {title}\n\n{_table(rows)}")
    return "\n".join(tables)


def _of(contest: str, rows: list[Row]) -> list[Row]:
    """Give the rows of a contest, each method with its year; what was seen in a summary alone keeps the mark."""
    shown = ("method", "error", "IoU, %", "learns", "pairs")
    return [
        {key: row[key] for key in shown}
        | {"method": f"{row['method']} {row['year']}{' †' * row['source'].endswith('†')}"}
        for row in rows
        if row["contest"] == contest
    ]


def _ours(row: Row, what: str) -> Row:
    """Give a contest of ours the columns of published.csv."""
    return {
        "method": "**isomatch**",
        "error": row["mean"],
        "IoU, %": row["IoU, %"],
        "learns": "nothing",
        "pairs": f"{row['pairs']} {what}, turned",
    }


def _table(rows: list[Row]) -> str:
    overlap = all(row["IoU, %"] for row in rows)
    rows = sorted(rows, key=lambda row: -float(row["IoU, %"]) if overlap else float(row["error"]))
    shown = [key for key in rows[0] if any(row[key] for row in rows)]
    return markdown(shown, ([row[key] for key in shown] for row in rows))


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Render a table."""
    rows = [f"| {' | '.join(cells)} |\n" for cells in (head, *lines)]
    return "".join([rows[0], f"|{'---|' * len(head)}\n", *rows[1:]])
