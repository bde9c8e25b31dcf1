"""All methods, and isomatch started from the maps of each, on some pairs of three sets.

    python -m isomatch_lab.studies.methods --data DIR -o OUT

draws ten pairs of the remeshed sets; of SCAPE it takes the pairs of the Princeton benchmark, listed in ``DIR/scb``. It
writes what ``isomatch bench`` writes and ``methods_table.csv``, and draws the published curves in ``DIR/scb`` beside.
Rows that are already in OUT are not computed again.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from isomatch_lab.evaluation import (
    BenchmarkRun,
    read_published_curves,
    read_rows,
    run_benchmark,
    write_tables,
)
from isomatch_lab.studies.shared import parse_arguments, write_table

SETS = ("faust_r", "tosca_iso_r", "scape")  # sets that are measured
PAIRS, POINTS = 10, 500  # number of pairs of each set, and of points of each pair
WITH_PRIORS = (  # methods that are given landmarks or a map
    *("gdd", "gdd_post", "phi", "functional_maps_5pt", "zoomout_5pt"),
    *("sgmds_5pt", "sgf_5pt", "gmds_5pt", "gw_5pt"),
)
# methods that are given nothing; all methods alone; and methods whose maps others continue
AUTOMATIC = ("functional_maps", "zoomout", "sgmds", "sgf", "gmds", "gw", "pyfm")
ALONE = ("isomatch", *WITH_PRIORS, *AUTOMATIC)
STARTED = (
    *(f"{method}+isomatch" for method in ALONE[1:]),
    *(f"{method}+gdd_post" for method in ("functional_maps_5pt", "sgmds_5pt", "sgf_5pt")),
)
Row = dict[str, Any]


def run_of(name: str, data: str) -> BenchmarkRun:
    """Describe what is run on a set."""
    pairs = None
    if name == "scape":
        lines = Path(data, "scb", "pairs_Corr_Scape.txt").read_text(encoding="utf-8").split("\n")
        pairs = tuple((line.split()[0], line.split()[1]) for line in lines if line.split())
    return BenchmarkRun(name, (*ALONE, *STARTED), data, n_pairs=PAIRS, n_points=POINTS, pairs=pairs)


def by_set(rows: list[Row], methods: tuple[str, ...], cells: dict[str, str]) -> Iterator[Row]:
    """Make a row for each method; cells, which are formats, are filled for each set."""
    by_name = {(row["set"], row["method"]): row for row in rows}
    for method in methods:
        line = {"method": f"`{method}`"}
        for name in SETS:
            row = by_name.get((name, method))
            line |= {f"{name}: {cell}": text.format(**row) if row else "" for cell, text in cells.items()}
        yield line


def as_shown(row: Row, mirrored: set[str]) -> Row:
    """Give shares of correspondences in per cent, and one flip where the mirrored truth of a set is known."""
    one_flip = f"{row['either']:.2f}" if row["set"] in mirrored else "–"
    return row | {key: 100 * row[key] for key in ("within_05", "within_10")} | {"one_flip": one_flip}


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "rows, tables and curves")
    for name in SETS:
        for row in run_benchmark(run_of(name, asked.data), asked.output):
            print(name, row["pair"], row["method"], row.get("error"), row.get("outcome"), flush=True)
    summary = write_tables(asked.output, read_published_curves(Path(asked.data, "scb")))
    rows = list(read_rows(asked.output))
    mirrored = {row["set"] for row in rows if row.get("mirrored") is not None}
    shown = {
        "mean, one flip, failures": "{mean:.2f}, {one_flip}, {failures}",
        "within 0.05 / 0.10": "{within_05:.1f} / {within_10:.1f}",
    }
    table = by_set([as_shown(row, mirrored) for row in summary], ALONE, shown)
    write_table(asked.output / "methods_table.csv", list(table))
