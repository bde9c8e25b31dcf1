"""Draw the pairs with the largest errors of ``docs/lab/benchmarks/pairs.csv``.

    python -m isomatch_lab.studies.worst_pairs --data DIR [-o docs/lab/benchmarks] [--count 3]

matches them again and writes ``worst_1.png``, … with the geodesic error on the source, at truth points and, between them,
that of the nearest one in space.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

from scipy.spatial import KDTree

from isomatch import match
from isomatch.evaluation import geodesic_errors
from isomatch.view import ValuePanel, draw_map
from isomatch_lab.sets import BenchmarkPair, benchmark_set

PAGE = Path(__file__).parents[3] / "docs" / "lab" / "benchmarks"


def worst(count: int) -> list[dict[str, str]]:
    """Rows of the pairs with the largest errors, the worst first."""
    with (PAGE / "pairs.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["error"]]
    return sorted(rows, key=lambda row: -float(row["error"]))[:count]


def draw(pair: BenchmarkPair, titles: tuple[str, str], path: Path) -> None:
    """Match a pair and draw map and error."""
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
    parser.add_argument("--data", required=True, help="folder of the benchmark sets")
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="folder of the pictures")
    parser.add_argument("--count", type=int, default=3, help="how many pairs")
    asked = parser.parse_args()
    for number, row in enumerate(worst(asked.count), 1):
        chosen = benchmark_set(row["set"], asked.data)
        source, target = next(names for names in chosen.pairs if "-".join(names) == row["pair"])
        pair = chosen.load(source, target)
        draw(pair, (source, target), asked.output / f"worst_{number}.png")
