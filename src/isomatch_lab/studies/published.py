"""Published numbers of the contests, from ``published.csv``, with the numbers of isomatch among them.

`beside` tells the place of each contest of ``docs/results/contests.csv`` on which others published. See ``results.py``.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

PUBLISHED = Path(__file__).with_suffix(".csv")  # table of published numbers
OURS = {  # contest in published.csv: heading, and our rows in contests.csv with what each covers
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
    """Render where each of our rows stands among the published ones: by overlap where all have one, else by error."""
    with (results / "contests.csv").open(newline="", encoding="utf-8") as file:
        measured = {row["contest"]: row for row in csv.DictReader(file)}
    with PUBLISHED.open(newline="", encoding="utf-8") as file:
        published = list(csv.DictReader(file))
    lines = []
    for contest, (title, ours) in OURS.items():
        others = [row for row in published if row["contest"] == contest]
        overlap = all(row["IoU, %"] for row in others)
        key = "IoU, %" if overlap else "error"
        others.sort(key=lambda row: float(row[key]), reverse=overlap)
        alike = [row for row in others if row["learns"].startswith("nothing")]
        for name, what in ours.items():
            our = measured[name][key if overlap else "mean"]
            better = sum(
                float(row[key]) > float(our) if overlap else float(row[key]) < float(our) for row in others
            )
            best = [_describe(rows[0], key) if rows else "" for rows in (others, alike)]
            place = f"{better + 1} of {len(others) + 1}"
            lines.append([f"{title}, {measured[name]['pairs']} {what}", key, our, place, *best])
    return markdown(
        ["set, pairs of isomatch", "measure", "isomatch", "place", "best", "best without learning"], lines
    )


def _describe(row: Row, key: str) -> str:
    """Name a method, its year and its number; † marks a number known from a summary only."""
    return f"{row['method']} {row['year']}{' †' * row['source'].endswith('†')}: {row[key]}"


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Render a table."""
    rows = [f"| {' | '.join(cells)} |\n" for cells in (head, *lines)]
    return "".join([rows[0], f"|{'---|' * len(head)}\n", *rows[1:]])
