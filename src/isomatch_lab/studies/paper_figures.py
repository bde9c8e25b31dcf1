"""The paper's figures and its table as the pages show them, with the means of the methods of figure 5.

    python -m isomatch_lab.studies.paper_figures --data DIR -o OUT

writes what ``isomatch paper all --points 500`` does, and ``paper_table.csv``: of each method on each set the mean error
(× 100 / √area) and the area under the curve. Rows of runs that are in OUT are used.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from isomatch_lab.paper import ITEMS, Setting, reproduce
from isomatch_lab.paper.benchmark_rows import benchmark_rows
from isomatch_lab.paper.curves_5pt import METHODS
from isomatch_lab.paper.princeton_curves import sets_of
from isomatch_lab.studies.shared import parse_arguments, write_table

POINTS = 500  # number of points of the truth that are measured for each pair; chosen


def print_stage(stage: str) -> None:
    """Print a stage."""
    print(stage, flush=True)


def means(setting: Setting) -> list[dict[str, str]]:
    """Rows of the table: methods that are given the same five landmarks, and the one that is given none."""
    sets = {name: benchmark_rows(setting, name, tuple(METHODS)) for name in sets_of(setting)}
    table = []
    for method, (label, _) in METHODS.items():
        row = {"": label}
        for name, rows in sets.items():
            method_rows = [row for row in rows if row["method"] == method]
            error, area = (np.mean([row[measure] for row in method_rows]) for measure in ("error", "auc"))
            row[name.upper()] = f"{error:.2f}, {area:.3f}"
        table.append(row)
    return table


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "the figures and paper_table.csv")
    setting = Setting(Path(asked.data), asked.output / "runs", n_points=POINTS, progress=print_stage)
    for record in reproduce(tuple(ITEMS), setting, asked.output, force=True):
        for verdict in record["verdicts"]:
            print_stage(f"{record['item']}: {'holds' if verdict['holds'] else 'fails'}: {verdict['claim']}")
    write_table(asked.output / "paper_table.csv", means(setting))
