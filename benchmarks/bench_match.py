"""Preparing a shape and matching two, at 5 000 and 28 000 vertices, with the error against the truth."""

import numpy as np
import pytest

from isomatch import geodesic_distances, match, prepare
from isomatch.datasets import ground_truth
from isomatch_lab.procedural import creature

SIZES = [5_000, 28_000]
SCORED = 500  # source vertices whose error is measured


@pytest.fixture(scope="module", params=SIZES)
def pair(request):
    """Two poses of one animal, differently triangulated."""
    n = request.param
    return creature(n, pose=0, triangulation=1), creature(round(1.05 * n), pose=1, triangulation=2)


def bench_prepare(benchmark, pair):
    """One shape."""
    benchmark.pedantic(prepare, (pair[0].mesh,), rounds=3, warmup_rounds=1)


def bench_match_prepared(benchmark, pair):
    """Two prepared shapes."""
    shapes = [prepare(made.mesh) for made in pair]
    result = benchmark.pedantic(match, shapes, rounds=3, warmup_rounds=1)
    _report(benchmark, pair, result)


def bench_match_meshes(benchmark, pair):
    """Everything, from two meshes to a map."""
    result = benchmark.pedantic(match, [made.mesh for made in pair], rounds=2, warmup_rounds=1)
    _report(benchmark, pair, result)


def _report(benchmark, pair, result):
    target = pair[1].mesh
    rows = np.linspace(0, pair[0].mesh.n_vertices - 1, SCORED).astype(int)
    truth = ground_truth(*pair).vertices[rows]
    apart = geodesic_distances(target, truth)[np.arange(SCORED), result.map.vertices[rows]]
    error = float(apart.mean() / np.sqrt(target.area))
    stages = {stage: round(spent, 3) for stage, spent in result.timings.items()}
    benchmark.extra_info.update(error=error, timings=stages)
    print(f"\n{pair[0]} → {pair[1]}: mean error {error:.4f} √area, {result.outcome.name}, {stages}")
