"""Farthest point sampling of 100 points against its 100 full columns alone: what choosing them costs."""

import time

import numpy as np

from isomatch.geodesics import distance_engine, farthest_point_sampling

SAMPLES = 100


def bench_sampling(benchmark, large_mesh):
    """Ratio of the time of sampling, columns included, to that of the columns."""
    engine = distance_engine(large_mesh)
    ratios = []
    for _ in range(3):
        started = time.perf_counter()
        sampling = farthest_point_sampling(engine, SAMPLES, start=0)
        whole = time.perf_counter() - started
        started = time.perf_counter()
        engine.distances_from(sampling.vertices)
        ratios.append(whole / (time.perf_counter() - started))
    benchmark.extra_info["ratio"] = float(np.median(ratios))
    print(
        f"\n{large_mesh}: sampling {SAMPLES} points takes {np.median(ratios):.2f} times its distance columns"
    )
    benchmark.pedantic(farthest_point_sampling, (engine, SAMPLES, 0), rounds=3)
