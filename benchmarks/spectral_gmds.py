"""What Spectral GMDS lacks: another start than five points, or functions at the end, one at a time.

    python benchmarks/spectral_gmds.py --data DIR -o OUT [scape faust_r tosca_iso_r]

writes ``spectral_gmds.csv``: for each pair, start and end, the mean geodesic error (× 100 / √area, 500 truth points) and
the share of points within 0.025, 0.05 and 0.10. The starts are five true landmarks, the map of `match`, and the truth. At
the end the map of points is left as it is, or it grows from 50 or from 20 functions. The truth alone is also shown
through 50 functions, without the method.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from typing import Any

import numpy as np

from isomatch import Correspondence, match
from isomatch.correspondence import fit_functional_map, nearest_rows, spectral_embedding
from isomatch.evaluation import counted, geodesic_errors
from isomatch.geodesics import distance_engine
from isomatch.matching import ShapePair, prepare_pair
from isomatch_lab.baselines import SpectralGmdsConfig, spectral_gmds
from isomatch_lab.baselines.task import AT_FULL_RESOLUTION
from isomatch_lab.evaluation import CachingEngine, true_landmarks
from isomatch_lab.sets import BenchmarkPair, benchmark_set
from studies import asked_for

SEED = 0
PAIRS = 13  # of each set
ENDS: dict[str, tuple[int, ...]] = {
    "as it is": (),
    "grown from 50": tuple(range(50, 201, 5)),
    "grown from 20": tuple(range(20, 201, 5)),
}
SHARES = (0.025, 0.05, 0.10)


def through_functions(pair: BenchmarkPair, shapes: ShapePair, k: int) -> Correspondence:
    """Map every vertex by the functional map (k, k) that fits the truth best."""
    here, there = pair.truth.T
    source, target = (shape.laplace.vectors[:, :k] for shape in (shapes.source, shapes.target))
    coordinates = spectral_embedding(fit_functional_map(source[here], target[there]), source, target)
    return Correspondence(nearest_rows(coordinates.target, coordinates.source), pair.target.n_vertices)


def measured(pair: BenchmarkPair) -> Iterator[dict[str, Any]]:
    """Rows of a pair: one for each start and end."""
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
    maps = {
        ("match alone", ""): automatic,
        ("truth alone", "50 functions"): through_functions(pair, shapes, 50),
    }
    for start, hint in starts.items():
        for end, sizes in ENDS.items():
            config = SpectralGmdsConfig(final_sizes=sizes)
            maps[start, end] = spectral_gmds(*prepared, **hint, config=config).map
    for (start, end), found in maps.items():
        errors = counted(geodesic_errors(pair.target, found, pair.truth, 500, SEED, engine))
        yield {
            "pair": pair.name,
            "start": start,
            "end": end,
            "error": f"{100 * errors.mean():.4g}",
            **{f"within {share}": f"{(errors <= share).mean():.4g}" for share in SHARES},
        }


if __name__ == "__main__":
    asked = asked_for(__doc__, "spectral_gmds.csv", ("scape", "faust_r", "tosca_iso_r"))
    columns = ("set", "pair", "start", "end", "error", *(f"within {share}" for share in SHARES))
    with (asked.output / "spectral_gmds.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        for name in asked.kinds or ("scape", "faust_r", "tosca_iso_r"):
            chosen = benchmark_set(name, asked.data).chosen(PAIRS, SEED)
            for names in chosen.pairs:
                writer.writerows({"set": name} | row for row in measured(chosen.load(*names)))
                file.flush()
                print(*names, flush=True)
