"""How much does it matter where the reproduction differs from the paper: one thing changed at a time.

    python -m isomatch_lab.studies.paper_deviations --data DIR -o OUT

writes ``deviations.csv`` and ``deviations_table.csv``: plain GDD and its post-processing from five true landmarks, as
the benchmark has them and with one thing changed; for each pair, the mean geodesic error (× 100 / √area, 1000 truth
points) and the mean square distortion divided by the distortion of the truth (100 × 1000 points).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from isomatch import Config, MatchResult, match
from isomatch.evaluation import counted, geodesic_errors
from isomatch.geodesics import distance_engine
from isomatch.settings import PreparationSettings, RefinementSettings, SearchSettings
from isomatch_lab.baselines import gdd, gdd_post
from isomatch_lab.evaluation import CachingEngine, metric_distortion, true_landmarks
from isomatch_lab.sets import BenchmarkPair, benchmark_set
from isomatch_lab.studies.shared import parse_arguments, write_rows, write_table

SEED = 0  # seed of drawn pairs; chosen
AT_ONCE_STEPS = 12  # number of refinements with all functions at once; more change little
PAIRS = {"tosca_iso_r": ("cat", "centaur"), "tosca": ("wolf",)}  # classes of each set, with one pair each


def whole(config: Config, pair: BenchmarkPair) -> Config:
    """Iterate on all vertices."""
    return replace(config, n_refine=pair.source.n_vertices)


def as_usual(config: Config, pair: BenchmarkPair) -> Config:
    """Change nothing."""
    return config


# settings that depart from ours in one thing, as their names in `VARIANTS` say
MIXED = Config(preparation=PreparationSettings(block_diagonal=False))
UNFLIPPED = Config(search=SearchSettings(flip_landmarks=False))
MESH_UNITS = Config(preparation=PreparationSettings(distance_unit="user"))
POST = Config(n_functions=200)
AT_ONCE = replace(POST, refining=RefinementSettings(laplace_steps_at_once=AT_ONCE_STEPS))
VARIANTS: dict[str, tuple[Callable[..., MatchResult], Config, Callable[..., Config]]] = {
    "GDD": (gdd, Config(), as_usual),
    "GDD, area weights": (match, Config(refinement="none", hypotheses="given"), as_usual),
    "GDD, C not block-diagonal": (gdd, MIXED, as_usual),
    "GDD, iterated on all vertices": (gdd, Config(), whole),
    "GDD, distances in mesh units": (gdd, MESH_UNITS, as_usual),
    "GDD, flips of the start not tried": (gdd, UNFLIPPED, as_usual),
    "GDD, k = 30, p = 60": (gdd, Config(rank=30, n_columns=60), as_usual),
    "GDD, k = 100, p = 200": (gdd, Config(rank=100, n_columns=200), as_usual),
    "post": (gdd_post, POST, as_usual),
    "post, 200 functions at once, F orthogonal": (gdd_post, AT_ONCE, as_usual),
    "post, area weights": (match, replace(POST, refinement="laplace_icp", hypotheses="given"), as_usual),
    "post, iterated on all vertices": (gdd_post, POST, whole),
    "post, 100 functions": (gdd_post, Config(n_functions=100), as_usual),
}


def measure(pair: BenchmarkPair) -> dict[str, tuple[float, float]]:
    """Error, and distortion divided by the distortion of the truth, for each variant."""
    source, target = (CachingEngine(distance_engine(mesh), 2.0**30) for mesh in (pair.source, pair.target))
    engines = source, target
    landmarks = true_landmarks(pair, seed=SEED, engines=engines)
    results = {}
    for name, (method, config, scope) in VARIANTS.items():
        image = method(pair.source, pair.target, landmarks, config=scope(config, pair)).map
        error = counted(geodesic_errors(pair.target, image, pair.truth, 1000, SEED, engines[1])).mean()
        distortion = metric_distortion(
            pair.source, pair.target, image, pair.truth, n_rows=100, seed=SEED, engines=engines
        )
        assert distortion.truth is not None
        results[name] = 100 * float(error), distortion.l2 / distortion.truth.l2
        print(pair.name, name, *np.round(results[name], 3), sep="  ", flush=True)
    return results


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "deviations.csv")
    rows, table = [], {variant: {"": variant} for variant in VARIANTS}
    for set_name, classes in PAIRS.items():
        chosen = benchmark_set(set_name, asked.data)
        for kind in classes:
            of_class = [pair for pair in chosen.pairs if pair[0].rstrip("0123456789") == kind]
            pair = chosen.load(*of_class[np.random.default_rng(SEED).integers(len(of_class))])
            for variant, numbers in measure(pair).items():
                rows.append((set_name, pair.name, variant, *(float(f"{number:.4g}") for number in numbers)))
                column = f"`{set_name}` {pair.name}: error, distortion / truth"
                table[variant][column] = "{:.2f}, {:.2f}".format(*numbers)
    columns = ("set", "pair", "variant", "error", "distortion_over_truth")
    write_rows(asked.output / "deviations.csv", columns, (dict(zip(columns, row)) for row in rows))
    write_table(asked.output / "deviations_table.csv", list(table.values()))
