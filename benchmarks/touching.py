"""Bodies whose touching limbs were fused by a union: the pairs of TOPKIDS.

    python benchmarks/touching.py --data DIR -o OUT

matches every pair of ``DIR/topkids``, fused body → clean body, without hints: as it is, and with the target decimated to
half of its vertices, since the set shares the triangulation of the target outside the contacts. Vertices of the target
are permuted and rotated. It writes ``touching.csv``, one row for each map, and ``touching_table.csv``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

import isomatch
from isomatch import Mesh
from isomatch.lab.evaluation import counted, geodesic_errors
from isomatch.lab.sets import relabelled
from isomatch.resolution import decimate
from studies import asked_for, in_parallel, summed_up, write_rows, write_table

KINDS = ("as they are", "target remeshed")
POINTS = 400
COLUMNS = ("pair", "target", "error", "worst 5 %", "outcome", "notes")
Job = tuple[str, str, str, str]  # folder of the sets, kind, source, target


def jobs(data: str) -> Iterator[Job]:
    """List every pair, as it is and with a target that is remeshed."""
    lines = (Path(data) / "topkids" / "pairs.txt").read_text(encoding="utf-8").splitlines()
    for kind in KINDS:
        for _, source, target in (line.split() for line in lines if line.strip()):
            yield data, kind, source, target


def judged(job: Job) -> dict[str, Any]:
    """Match one pair, and measure the error at its truth points."""
    data, kind, source, target = job
    folder = Path(data) / "topkids"
    with np.load(folder / "shapes.npz") as shapes, np.load(folder / "truth.npz") as truths:
        body, clean = (Mesh(shapes[name], shapes[f"{name}_faces"]) for name in (source, target))
        truth = truths[f"{source}|{target}"]
    truth = truth[truth[:, 1] >= 0]
    if kind == "target remeshed":
        coarse = decimate(clean, clean.n_vertices // 2).mesh
        truth[:, 1] = KDTree(coarse.vertices).query(clean.vertices[truth[:, 1]])[1]
        clean = coarse
    clean, number = relabelled(clean, seed=1)
    truth[:, 1] = number[truth[:, 1]]
    found = isomatch.match(body, clean)
    errors = 100 * counted(geodesic_errors(clean, found.map, truth, POINTS))
    return {
        "pair": f"{source}-{target}",
        "target": kind,
        "error": float(errors.mean()),
        "worst 5 %": float(np.quantile(errors, 0.95)),
        "outcome": found.outcome.name,
        "notes": "; ".join(found.notes),
    }


def table(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """For each kind: mean, median and worst error, wrong maps, those called right, and their largest error."""
    for kind in KINDS:
        yield {"target": kind, **summed_up([row for row in rows if row["target"] == kind])}


if __name__ == "__main__":
    asked = asked_for(__doc__, "touching.csv")
    rows = write_rows(asked.output / "touching.csv", COLUMNS, in_parallel(judged, jobs(asked.data)))
    write_table(asked.output / "touching_table.csv", list(table(rows)))
