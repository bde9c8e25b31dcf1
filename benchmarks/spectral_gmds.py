"""Does Spectral GMDS lack a better start than five points, or functions at the end: both, one at a time.

    python benchmarks/spectral_gmds.py --data DIR -o OUT [scape faust_r tosca_iso_r]

writes ``spectral_gmds.csv``: for each pair, start and number of functions at the end, the mean geodesic error (× 100 /
√area, 500 truth points) and the share of points within 0.025, 0.05 and 0.10. The starts are five true landmarks, the map
of `match`, and the truth. "truth alone" is the truth through so many functions, without the method.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from typing import Any

import numpy as np

from isomatch import Correspondence, match
from isomatch.baselines import SpectralGmdsConfig, spectral_gmds
from isomatch.baselines.task import AT_FULL_RESOLUTION
from isomatch.correspondence import fit_functional_map, nearest_rows, spectral_embedding
from isomatch.datasets import BenchmarkPair, benchmark_set
from isomatch.evaluation import CachingEngine, counted, geodesic_errors, true_landmarks
from isomatch.geodesics import distance_engine
from isomatch.matching import ShapePair, prepare_pair
from studies import asked_for

SEED = 0
PAIRS = 13  # of each set
LAST = (50, 100, 200)
SHARES = (0.025, 0.05, 0.10)


def through_functions(pair: BenchmarkPair, shapes: ShapePair, k: int) -> Correspondence:
    """Map every vertex by the functional map (k, k) that fits the truth best."""
    here, there = pair.truth.T
    source, target = (shape.laplace.vectors[:, :k] for shape in (shapes.source, shapes.target))
    coordinates = spectral_embedding(fit_functional_map(source[here], target[there]), source, target)
    return Correspondence(nearest_rows(coordinates.target, coordinates.source), pair.target.n_vertices)


def measured(pair: BenchmarkPair) -> Iterator[dict[str, Any]]:
    """Rows of a pair: one for each start and number of functions."""
    engine = CachingEngine(distance_engine(pair.target), 2.0**30)
    shapes = prepare_pair(pair.source, pair.target, AT_FULL_RESOLUTION, SEED)
    prepared = shapes.source, shapes.target
    known = np.full(pair.source.n_vertices, -1)
    known[pair.truth[:, 0]] = pair.truth[:, 1]
    automatic = match(*prepared, config=AT_FULL_RESOLUTION).map
    starts = {
        "five landmarks": {"landmarks": true_landmarks(pair, seed=SEED)},
        "match": {"initial_map": automatic.vertices},
        "truth": {"initial_map": known},
    }
    maps = {("match alone", None): automatic}
    for last in LAST:
        maps["truth alone", last] = through_functions(pair, shapes, last)
        for start, hint in starts.items():
            maps[start, last] = spectral_gmds(*prepared, **hint, config=SpectralGmdsConfig(last=last)).map
    for (start, last), found in maps.items():
        errors = counted(geodesic_errors(pair.target, found, pair.truth, 500, SEED, engine))
        yield {
            "pair": pair.name,
            "start": start,
            "functions": last,
            "error": f"{100 * errors.mean():.4g}",
            **{f"within {share}": f"{(errors <= share).mean():.4g}" for share in SHARES},
        }


if __name__ == "__main__":
    asked = asked_for(__doc__, "spectral_gmds.csv", ("scape", "faust_r", "tosca_iso_r"))
    columns = ("set", "pair", "start", "functions", "error", *(f"within {share}" for share in SHARES))
    with (asked.output / "spectral_gmds.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        for name in asked.kinds or ("scape", "faust_r", "tosca_iso_r"):
            chosen = benchmark_set(name, asked.data).chosen(PAIRS, SEED)
            for names in chosen.pairs:
                writer.writerows({"set": name} | row for row in measured(chosen.load(*names)))
                file.flush()
                print(*names, flush=True)
