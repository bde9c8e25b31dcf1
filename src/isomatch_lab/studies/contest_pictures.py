"""Draw the pair of median error of each contest, of those that ``docs/lab/contests/contests.csv`` lists.

    python -m isomatch_lab.studies.contest_pictures --data DIR [-o docs/lab/contests]

matches it again and writes ``CONTEST.png``, the map and the error on the source.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.contests import CONTESTS
from isomatch_lab.studies.worst_pairs import draw

PAGE = Path(__file__).parents[3] / "docs" / "lab" / "contests"
SHOWN = ("topkids", "cuts", "holes", "species_other", "two_parts")


def median_pair(rows: list[dict[str, str]]) -> str:
    """Name of the pair in the middle."""
    return sorted(rows, key=lambda row: float(row["error"]))[len(rows) // 2]["pair"]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the benchmark sets")
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="folder of the pictures")
    asked = parser.parse_args()
    with (PAGE / "contests.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["error"]]
    for contest in SHOWN:
        shapes = benchmark_set(asked.data / CONTESTS[contest].of)
        name = median_pair([row for row in rows if row["contest"] == contest])
        names = next(pair for pair in shapes.pairs if "-".join(pair) == name)
        draw(shapes.load(*names), names, asked.output / f"{contest}.png")
