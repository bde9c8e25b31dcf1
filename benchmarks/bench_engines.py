"""Every registered engine against exact geodesics: error and time per column, on real meshes and a procedural one."""

import time
from contextlib import suppress

import numpy as np
import pytest

from conftest import DATA
from isomatch import Mesh, MissingDependencyError, distance_engine
from isomatch.datasets import creature
from isomatch.geodesics import DistanceEngine, engine_names

pytest.importorskip("pygeodesic", reason="needs pygeodesic, whose distances are the reference")

SOURCES = 10
REPEATS = 10  # the fastest counts; exact is timed once
MESHES = (
    "creature 5k",
    "faust_r/tr_reg_000",
    "faust_r/tr_reg_033",
    "tosca_iso_r/cat0",
    "tosca_iso_r/wolf0",
    "tosca_iso_r/victoria10",
    "tosca/cat0",
)


def _mesh(name: str) -> Mesh:
    if name == "creature 5k":
        return creature(5000).mesh
    folder, shape = name.split("/")
    path = DATA / folder / (f"{shape.rstrip('0123456789')}.npz" if folder == "tosca" else f"{shape}.npz")
    if not path.exists():
        pytest.skip(f"needs {path.relative_to(DATA)}; set ISOMATCH_DATA")
    with np.load(path, allow_pickle=False) as held:
        return Mesh(held[shape if folder == "tosca" else "vertices"], held["faces"])


def _installed_engines(mesh: Mesh) -> dict[str, DistanceEngine]:
    engines = {}
    for name in engine_names(Mesh):
        with suppress(MissingDependencyError):
            engines[name] = distance_engine(mesh, name)
    return engines


@pytest.mark.parametrize("name", MESHES)
def bench_engines(benchmark, name, monkeypatch):
    """Mean and largest relative error with respect to exact distances, milliseconds per column on one thread."""
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "1")
    mesh = _mesh(name)
    sources = np.random.default_rng(0).integers(mesh.n_vertices, size=SOURCES)
    engines = _installed_engines(mesh)
    columns, seconds = {}, {}
    for engine, each in engines.items():
        each.distances_from(sources[:1])  # compiles, factorises
        runs = []
        for _ in range(1 if engine == "exact" else REPEATS):
            started = time.perf_counter()
            columns[engine] = each.distances_from(sources)
            runs.append((time.perf_counter() - started) / SOURCES)
        seconds[engine] = min(runs)
    exact = columns["exact"]
    away = exact > 0
    print(f"\n{name}, {mesh.n_vertices} vertices")
    for engine in engines:
        error = np.abs(columns[engine][away] / exact[away] - 1)
        print(
            f"  {engine:14} mean {error.mean():7.3%}  99 % {np.quantile(error, 0.99):7.2%}  max {error.max():7.2%}  "
            f"{1e3 * seconds[engine]:8.2f} ms per column"
        )
        benchmark.extra_info[engine] = float(error.mean())
    benchmark.pedantic(engines["fast_marching"].distances_from, (sources,), rounds=3)
