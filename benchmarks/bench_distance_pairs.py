"""Geodesic distances of random pairs from a basis of rank 50, on one thread."""

import time

import numpy as np
import pytest

from isomatch import distance_basis
from isomatch_lab.procedural import creature

PAIRS = 1_000_000
REPEATS = 5  # the quickest counts


@pytest.mark.parametrize("size", [4_000, 28_000, 200_000])
def bench_pairs(benchmark, size, monkeypatch):
    """Millions of pairs a second in double and in single precision, and by plain indexing."""
    mesh = creature(size).mesh
    double = distance_basis(mesh, held_out=0)
    single = double.astype(np.float32)
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "1")
    i, j = np.random.default_rng(0).integers(mesh.n_vertices, size=(2, PAIRS))
    scaled = double.vectors * double.values
    ways = {
        "double": lambda: double.distance(i, j),
        "single": lambda: single.distance(i, j),
        "indexing": lambda: np.einsum("ij,ij->i", scaled[i], double.vectors[j]),
    }
    told = []
    for name, way in ways.items():
        seconds = []
        for _ in range(REPEATS):
            started = time.perf_counter()
            way()
            seconds.append(time.perf_counter() - started)
        benchmark.extra_info[name] = PAIRS / min(seconds)
        told.append(f"{name} {PAIRS / min(seconds) / 1e6:.1f}")
    print(f"\n{mesh.n_vertices} vertices, million pairs a second: {', '.join(told)}")
    benchmark.pedantic(ways["double"], rounds=1)
