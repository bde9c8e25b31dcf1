"""Fast marching against potpourri3d's, in time and in error to exact geodesics (pygeodesic), in one run."""

import time

import numpy as np
import pytest

from isomatch import distance_engine, geodesic_distances

exact_package = pytest.importorskip("pygeodesic.geodesic", reason="needs pygeodesic")
potpourri3d = pytest.importorskip("potpourri3d", reason="needs potpourri3d")

SOURCES = 20
COMPARED = 3  # sources for which exact distances are computed, about a second each


def _seconds(function) -> tuple[float, object]:
    started = time.perf_counter()
    result = function()
    return time.perf_counter() - started, result


@pytest.mark.parametrize("threads", [1, 2])
def bench_columns(benchmark, large_mesh, monkeypatch, threads):
    """Distance columns from 20 random vertices."""
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", str(threads))
    sources = np.random.default_rng(0).integers(large_mesh.n_vertices, size=SOURCES)
    geodesic_distances(large_mesh, sources[:1])
    benchmark.extra_info["per_source"] = SOURCES
    benchmark.pedantic(geodesic_distances, (large_mesh, sources), rounds=3)


@pytest.mark.parametrize("threads", [1, 2])
def bench_against_peer(benchmark, large_mesh, monkeypatch, threads):
    """Ratio of times for each source, both set up beforehand (the peer has one thread); and mean relative errors."""
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", str(threads))
    sources = np.random.default_rng(0).integers(large_mesh.n_vertices, size=SOURCES)
    engine = distance_engine(large_mesh)
    solver = potpourri3d.MeshFastMarchingDistanceSolver(large_mesh.vertices, large_mesh.faces)

    def peer():
        return np.array([solver.compute_distance([[(int(source), [])]]) for source in sources])

    engine.distances_from(sources[:1])
    ratios = []
    for _ in range(5):
        ours, computed = _seconds(lambda: engine.distances_from(sources))
        theirs, of_peer = _seconds(peer)
        ratios.append(theirs / ours)
    errors = _mean_relative_errors(large_mesh, sources, computed, of_peer)
    benchmark.extra_info.update(ratio=float(np.median(ratios)), error=errors[0], error_of_peer=errors[1])
    print(
        f"\n{large_mesh}, {threads} threads: {ours / SOURCES * 1e3:.1f} ms a source, potpourri3d "
        f"{theirs / SOURCES * 1e3:.1f} ms, {np.median(ratios):.1f} times as fast; mean relative error "
        f"{errors[0]:.2%}, potpourri3d {errors[1]:.2%}"
    )
    benchmark.pedantic(engine.distances_from, (sources,), rounds=1)


def _mean_relative_errors(mesh, sources, *results) -> list[float]:
    exact = exact_package.PyGeodesicAlgorithmExact(mesh.vertices, mesh.faces.astype(np.int32))
    errors = np.zeros((len(results), COMPARED))
    for i, source in enumerate(sources[:COMPARED]):
        truth, _ = exact.geodesicDistances(np.array([source]), None)
        away = truth > 0
        for j, distances in enumerate(results):
            errors[j, i] = np.abs(distances[i][away] / truth[away] - 1).mean()
    return [float(error) for error in errors.mean(axis=1)]
