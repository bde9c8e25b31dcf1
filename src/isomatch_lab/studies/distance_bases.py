"""Distance bases of the TOSCA wolf: error against rank, and against preparation time, for every method.

    python -m isomatch_lab.studies.distance_bases --data DIR -o OUT

writes ``distance_bases.csv`` and ``.png``, ``distance_bases_table.csv``, and the errors on other shapes at k = 50 as
multiples of the optimum, ``distance_ratios.csv``; needs ``tosca`` and ``tosca_iso_r``.
"""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from isomatch import Mesh, distance_basis, geodesic_distances, laplace_basis
from isomatch.spectral import BasisMethod
from isomatch_lab.paper.basis_error import project_distances, relative_error
from isomatch_lab.procedural import creature
from isomatch_lab.studies.shared import parse_arguments, write_rows, write_table

# weights, method, rank k, number of columns p, relative error, processor seconds or "" without them
Row: TypeAlias = tuple[str, str, int, int, float, Any]
RANKS = (5, 10, 20, 30, 40, 50, 75, 100)  # ranks that are measured; chosen
TABLE_RANKS = (5, 10, 20, 30, 50, 100)  # ranks that the table shows; chosen
COLUMNS = (60, 80, 100, 140, 200, 300, 400)  # numbers of distance columns at rank 50; chosen
METHODS: dict[BasisMethod, str] = {"predicted": "C3", "nystrom": "C0", "fmds": "C2", "smds": "C4"}  # colours
COMPARED_BASES: tuple[tuple[BasisMethod, int], ...] = (  # methods and numbers of columns in the table
    ("predicted", 100),
    ("predicted", 200),
    ("nystrom", 100),
)
NAMES = {  # labels of methods
    "exact": "exact (optimum)",
    "predicted": "predicted columns (default)",
    "nystrom": "Nyström",
    "fmds": "FMDS",
    "smds": "SMDS",
    "laplace": "Laplace basis",
}


def measure(mesh: Mesh, distances: np.ndarray) -> Iterator[Row]:
    """One row for each basis."""
    everywhere = np.arange(mesh.n_vertices)
    smooth = laplace_basis(mesh, max(RANKS)).vectors
    for weights in ("uniform", "area"):
        measure = mesh.vertex_areas if weights == "area" else np.ones(mesh.n_vertices)
        exact = distance_basis(mesh, max(RANKS), max(RANKS), "exact", weights, held_out=0)
        for k in RANKS:
            row = exact.truncated(k).row(everywhere)
            yield weights, "exact", k, mesh.n_vertices, relative_error(row, distances, measure), ""
            one_sided = project_distances(smooth[:, :k], distances, measure)
            yield weights, "laplace", k, mesh.n_vertices, relative_error(one_sided, distances, measure), ""
        settings = [(k, 2 * k) for k in RANKS] + [(50, p) for p in COLUMNS if p != 100]
        for method in METHODS:
            for k, p in settings:
                started = time.process_time()
                basis = distance_basis(mesh, k, p, method, weights, held_out=0)
                seconds = time.process_time() - started
                error = relative_error(basis.row(everywhere), distances, measure)
                yield weights, method, k, p, error, round(seconds, 3)


def draw(rows: list[Row], path: Path) -> None:
    """Error against rank at p = 2 k, and against preparation time at k = 50, for both weights."""
    figure, axes = plt.subplots(2, 2, figsize=(11, 8), layout="constrained", sharey=True)
    for (by_rank, by_time), weights in zip(axes, ("uniform", "area")):
        chosen = [row for row in rows if row[0] == weights]
        best = next(row[4] for row in chosen if row[1] == "exact" and row[2] == 50)
        for method, colour in (("laplace", "0.6"), *METHODS.items(), ("exact", "k")):
            line = [
                (r[2], r[4]) for r in chosen if r[1] == method and (r[3] == 2 * r[2] or method not in METHODS)
            ]
            by_rank.plot(*zip(*line), "o-", color=colour, label=NAMES.get(method, method), markersize=4)
        for method, colour in METHODS.items():
            timed = sorted((r[3], r[5], r[4]) for r in chosen if r[1] == method and r[2] == 50)
            by_time.plot([r[1] for r in timed], [r[2] for r in timed], "o-", color=colour, markersize=4)
            for p, seconds, error in timed:
                if method in ("predicted", "fmds") and p in (100, 200, 400):
                    by_time.annotate(f"{p}", (seconds, error), (2, 4), textcoords="offset points", fontsize=8)
        by_time.axhline(best, color="k")
        by_rank.set(
            yscale="log", xlabel="rank k, from p = 2 k columns", ylabel=f"relative error, {weights} weights"
        )
        by_time.set(xscale="log", xlabel="processor seconds to prepare rank 50; numbers: columns p")
        by_time.set_xticks((0.2, 0.5, 1, 2), ("0.2", "0.5", "1", "2"))
        by_time.set_xticks((), minor=True)
        for axis in (by_rank, by_time):
            axis.grid(alpha=0.3, which="both")
    axes[0, 0].legend()
    figure.savefig(path, dpi=110)


def ratios(data: Path) -> Iterator[tuple[str, str, str, int, float]]:
    """Give shape, weights, method, p and error / optimum at k = 50, on other shapes."""
    meshes = {"creature": creature(4000).mesh}
    for name in ("centaur0", "cat0"):
        with np.load(data / "tosca_iso_r" / f"{name}.npz") as held:
            meshes[name] = Mesh(held["vertices"], held["faces"])
    for name, mesh in meshes.items():
        distances = all_distances(mesh)
        everywhere = np.arange(mesh.n_vertices)
        for weights in ("uniform", "area"):
            measure = mesh.vertex_areas if weights == "area" else np.ones(mesh.n_vertices)
            optimum = relative_error(
                distance_basis(mesh, 50, 50, "exact", weights, held_out=0).row(everywhere), distances, measure
            )
            for method, p in COMPARED_BASES:
                basis = distance_basis(mesh, 50, p, method, weights, held_out=0)
                yield (
                    name,
                    weights,
                    method,
                    p,
                    relative_error(basis.row(everywhere), distances, measure) / optimum,
                )


def all_distances(mesh: Mesh) -> np.ndarray:
    """(n, n) by fast marching, symmetrised."""
    distances = geodesic_distances(mesh, np.arange(mesh.n_vertices))
    return np.asarray((distances + distances.T) / 2)


def table(rows: list[Row]) -> Iterator[dict[str, Any]]:
    """Errors for some ranks, for both weights and every method, from 2 k columns."""
    for weights in ("uniform", "area"):
        for method, name in NAMES.items():
            line = {"weights": weights, "method": name}
            for w, m, k, p, error, _ in rows:
                if (w, m) == (weights, method) and k in TABLE_RANKS and (p == 2 * k or method not in METHODS):
                    line[f"k = {k}"] = f"{error:.4f}"
            yield line


def main() -> None:
    """Measure, write, draw."""
    asked = parse_arguments(__doc__, "tables and curves")
    data = Path(asked.data)
    with np.load(data / "tosca" / "wolf.npz") as poses:
        mesh = Mesh(poses["wolf0"], poses["faces"])
    distance_basis(mesh, 5, 10)  # compiles loops, which are not timed
    rows = list(measure(mesh, all_distances(mesh)))
    columns = ("weights", "method", "k", "p", "relative_error", "processor_seconds")
    written = ((*row[:4], f"{row[4]:.5f}", row[5]) for row in rows)
    write_rows(asked.output / "distance_bases.csv", columns, (dict(zip(columns, row)) for row in written))
    write_table(asked.output / "distance_bases_table.csv", list(table(rows)))
    draw(rows, asked.output / "distance_bases.png")
    names = ("shape", "weights", "method", "p", "error_over_optimum")
    others = ((*row[:4], f"{row[4]:.3f}") for row in ratios(data))
    write_table(asked.output / "distance_ratios.csv", [dict(zip(names, row)) for row in others])


if __name__ == "__main__":
    main()
