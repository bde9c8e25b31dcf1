"""How much does it matter where the reproduction differs from the paper: one thing changed at a time.

    python benchmarks/paper_deviations.py --data DIR -o OUT

writes ``deviations.csv``: plain GDD and its post-processing from five true landmarks, as the benchmark has them and with
one thing changed; for each pair, the mean geodesic error (× 100 / √area, 1000 truth points) and the ratio of the
mean square distortion to that of the truth (100 × 1000 points).
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
from isomatch.matching.nearest import Coordinates, nearest_in_cells
from scipy.linalg import polar

from isomatch import Config, MatchResult, PreparedShape, match
from isomatch.baselines import gdd, gdd_post
from isomatch.datasets import BenchmarkPair
from isomatch.datasets.benchmarks import benchmark_set
from isomatch.evaluation import counted, geodesic_errors, metric_distortion, true_landmarks
from isomatch.evaluation.remembering import RememberingEngine
from isomatch.geodesics import distance_engine
from isomatch.matching import alignment, choice, pipeline, refine, spectral
from isomatch.matching.pair import Pair
from studies import asked_for, changed

SEED = 0
AT_ONCE_STEPS = 12  # more change little
PAIRS = {"tosca_iso_r": ("cat", "centaur"), "tosca": ("wolf",)}  # one of each class


def whole(config: Config, pair: BenchmarkPair) -> Config:
    """Iterate on all vertices."""
    return replace(config, n_refine=pair.source.n_vertices)


def unrestricted(target: Any, source: Any) -> Any:
    """Find the orthogonal C that minimises ‖T C − S‖, real and imaginary columns mixed: a unitary C of the paper."""
    cross = target.coordinates.swapaxes(-1, -2) @ source.coordinates
    u, _, v = np.linalg.svd(cross, full_matrices=False)
    return u @ v


def at_once(pair: Pair, start: Coordinates) -> Coordinates:
    """Post-process with all functions from the start, F orthogonal: the paper as it is written."""
    source, target = pair.source.shape.laplace, pair.target.shape
    k = min(len(source.values), len(target.laplace.values))
    rows = nearest_in_cells(start[0], start[1][pair.refinement.rows], target.cells)
    first = polar(pair.refinement.fit(target.laplace.vectors[rows, :k], k))[0]
    return spectral.coordinates(pair, spectral.icp(pair, first, k, AT_ONCE_STEPS))


def as_usual(config: Config, pair: BenchmarkPair) -> Config:
    """Change nothing."""
    return config


MIXED = [(module, {"orthogonal_alignment": unrestricted}) for module in (alignment, choice, refine)]
UNFLIPPED = [(pipeline, {"twins": lambda pair, winner, known: []})]
MESH_UNITS = [(PreparedShape, {"intrinsic_scale": property(lambda shape: 1.0 / shape.scale)})]
AT_ONCE = [(refine, {"by_laplace_icp": at_once})]
VARIANTS: dict[str, tuple[Callable[..., MatchResult], Config, Callable[..., Config], list[Any]]] = {
    "GDD": (gdd, Config(), as_usual, []),
    "GDD, area weights": (match, Config(hypotheses="given", refinement="none"), as_usual, []),
    "GDD, C not block-diagonal": (gdd, Config(), as_usual, MIXED),
    "GDD, iterated on all vertices": (gdd, Config(), whole, []),
    "GDD, distances in mesh units": (gdd, Config(), as_usual, MESH_UNITS),
    "GDD, flips of the start not tried": (gdd, Config(), as_usual, UNFLIPPED),
    "GDD, k = 30, p = 60": (gdd, Config(rank=30, n_columns=60), as_usual, []),
    "GDD, k = 100, p = 200": (gdd, Config(rank=100, n_columns=200), as_usual, []),
    "post": (gdd_post, Config(), as_usual, []),
    "post, 200 functions at once, F orthogonal": (gdd_post, Config(), as_usual, AT_ONCE),
    "post, area weights": (match, Config(hypotheses="given", refinement="laplace_icp"), as_usual, []),
    "post, iterated on all vertices": (gdd_post, Config(), whole, []),
    "post, 100 functions": (gdd_post, Config(n_functions=100), as_usual, []),
}


def measured(pair: BenchmarkPair) -> dict[str, tuple[float, float]]:
    """Error and distortion over that of the truth, for each variant."""
    source, target = (
        RememberingEngine(distance_engine(mesh), 2.0**30) for mesh in (pair.source, pair.target)
    )
    engines = source, target
    landmarks = true_landmarks(pair, seed=SEED, engines=engines)
    results = {}
    for name, (method, config, scope, changes) in VARIANTS.items():
        with ExitStack() as stack:
            for module, values in changes:
                stack.enter_context(changed(module, **values))
            found = method(pair.source, pair.target, landmarks, config=scope(config, pair)).map
        error = counted(geodesic_errors(pair.target, found, pair.truth, 1000, SEED, engines[1])).mean()
        distortion = metric_distortion(
            pair.source, pair.target, found, pair.truth, n_rows=100, seed=SEED, engines=engines
        )
        results[name] = 100 * float(error), distortion.l2 / distortion.truth.l2
        print(pair.name, name, *np.round(results[name], 3), sep="  ", flush=True)
    return results


if __name__ == "__main__":
    asked = asked_for(__doc__, "deviations.csv")
    with (asked.output / "deviations.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("set", "pair", "variant", "error", "distortion_over_truth"))
        for set_name, classes in PAIRS.items():
            chosen = benchmark_set(set_name, asked.data)
            for kind in classes:
                of_class = [pair for pair in chosen.pairs if pair[0].rstrip("0123456789") == kind]
                pair = chosen.load(*of_class[np.random.default_rng(SEED).integers(len(of_class))])
                for variant, numbers in measured(pair).items():
                    writer.writerow((set_name, pair.name, variant, *(f"{number:.4g}" for number in numbers)))
                file.flush()
