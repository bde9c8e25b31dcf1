"""Every registered engine against exact geodesics: error and time of a column, on real meshes and a procedural one.

    python -m isomatch_lab.studies.engines --data DIR -o OUT

writes ``engines.csv``, one row for each mesh and engine, and ``engines_table.csv``. Times are on one thread.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from isomatch import Mesh, MissingDependencyError, distance_engine
from isomatch.geodesics import DistanceEngine, engine_names
from isomatch_lab.procedural import creature
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import parse_arguments, write_rows, write_table

SOURCES = 10  # number of vertices from which distances are timed; chosen
REPEATS = 10  # number of runs; the fastest counts, and exact distances are timed once; chosen
REAL = (  # sets and shapes that are measured
    ("faust_r", "tr_reg_000"),
    ("faust_r", "tr_reg_033"),
    ("tosca_iso_r", "cat0"),
    ("tosca_iso_r", "wolf0"),
    ("tosca_iso_r", "victoria10"),
    ("tosca", "cat0"),
)


def meshes(data: str) -> Iterator[tuple[str, Mesh]]:
    """Shapes with their names."""
    yield "creature", creature(5000).mesh
    for name, shape in REAL:
        yield f"`{name}` {shape}", benchmark_set(name, data).load(shape, shape).source


def measure(name: str, mesh: Mesh) -> Iterator[dict[str, Any]]:
    """Relative error with respect to exact distances, and milliseconds a column, of each engine."""
    sources = np.random.default_rng(0).integers(mesh.n_vertices, size=SOURCES)
    columns, seconds = {}, {}
    for engine, solver in installed_engines(mesh).items():
        solver.distances_from(sources[:1])  # compiles loops and factorises matrices, which are not timed
        runs = []
        for _ in range(1 if engine == "exact" else REPEATS):
            started = time.perf_counter()
            columns[engine] = solver.distances_from(sources)
            runs.append((time.perf_counter() - started) / SOURCES)
        seconds[engine] = min(runs)
    exact = columns["exact"]
    away = exact > 0
    for engine, distances in columns.items():
        error = 100 * np.abs(distances[away] / exact[away] - 1)
        yield {
            "mesh": name,
            "vertices": mesh.n_vertices,
            "engine": engine,
            "mean": float(error.mean()),
            "p99": float(np.quantile(error, 0.99)),
            "max": float(error.max()),
            "milliseconds": 1e3 * seconds[engine],
        }


def installed_engines(mesh: Mesh) -> dict[str, DistanceEngine]:
    """Engines whose packages are installed."""
    engines = {}
    for name in engine_names(Mesh):
        with suppress(MissingDependencyError):
            engines[name] = distance_engine(mesh, name)
    return engines


def table(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """For each mesh the errors of each engine, and its time as a multiple of fast marching."""
    for name in dict.fromkeys(row["mesh"] for row in rows):
        members = {row["engine"]: row for row in rows if row["mesh"] == name}
        usual = members["fast_marching"]["milliseconds"]
        line = {"mesh": name, "vertices": members["exact"]["vertices"]}
        for engine, row in members.items():
            error = "" if engine == "exact" else f"{row['mean']:.2f} ({row['p99']:.1f}) %, "
            line[engine] = f"{error}× {row['milliseconds'] / usual:.1f}"
        yield line


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "tables")
    os.environ["ISOMATCH_NUM_THREADS"] = "1"
    rows = [row for name, mesh in meshes(asked.data) for row in measure(name, mesh)]
    write_rows(asked.output / "engines.csv", tuple(rows[0]), rows)
    write_table(asked.output / "engines_table.csv", list(table(rows)))
