"""Draw pairs of the tables in ``docs/accuracy``: the worst of the benchmarks, and the median one of each contest.

    python -m isomatch_lab.studies.pair_pictures --data DIR [-o docs/accuracy] [--count 3]

matches them again and writes ``worst_1.png``, … and ``CONTEST.png`` with the geodesic error on the
source: measured at truth points; other points take the error of the nearest truth point in space.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path

from scipy.spatial import KDTree

from isomatch import match
from isomatch.evaluation import geodesic_errors
from isomatch.visualization import ValuePanel, draw_map
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.contests import CONTESTS

PAGES = Path(__file__).parents[3] / "docs" / "accuracy"  # folder of the pages with the pictures
SHOWN_CONTESTS = ("topkids", "cuts", "holes", "species_other", "two_parts")


def by_error(table: str) -> list[dict[str, str]]:
    """Rows of a table of the pages that have an error, the largest first."""
    with (PAGES / table).open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["error"]]
    return sorted(rows, key=lambda row: -float(row["error"]))


def pairs(data: Path, count: int) -> Iterator[tuple[str, str, str | Path | None, str]]:
    """Give the picture of each pair, its set, the folder of the sets, and its name."""
    for number, row in enumerate(by_error("pairs.csv")[:count], 1):
        yield f"worst_{number}.png", row["set"], data, row["pair"]
    for contest in SHOWN_CONTESTS:
        rows = [row for row in by_error("contests.csv")[::-1] if row["contest"] == contest]
        folder = str(data / CONTESTS[contest].of)
        yield f"{contest}.png", folder, None, rows[len(rows) // 2]["pair"]


def draw(path: Path, name: str, folder: str | Path | None, pair_name: str) -> None:
    """Match a pair of a set and draw map and error."""
    chosen = benchmark_set(name, folder)
    titles = next(names for names in chosen.pairs if "-".join(names) == pair_name)
    pair = chosen.load(*titles)
    result = match(pair.source, pair.target)
    error = 100 * geodesic_errors(pair.target, result.map, pair.truth)
    nearest = KDTree(pair.source.vertices[pair.truth[:, 0]]).query(pair.source.vertices)[1]
    values = ValuePanel(error[nearest], "geodesic error × 100 / √area", highest=25.0)
    draw_map(*(pair.source, pair.target, result.map, path), titles=titles, values=values, width=1200)
    print(f"{path.name}: {pair.name}, mean error {error.mean():.2f}, {result.outcome.name}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the benchmark sets")
    parser.add_argument("-o", "--output", type=Path, default=PAGES, help="folder of the pictures")
    parser.add_argument("--count", type=int, default=3, help="how many of the worst pairs")
    asked = parser.parse_args()
    for picture, name, folder, pair_name in pairs(asked.data, asked.count):
        (asked.output / picture).parent.mkdir(parents=True, exist_ok=True)
        draw(asked.output / picture, name, folder, pair_name)
