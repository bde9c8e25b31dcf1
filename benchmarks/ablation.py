"""What does each part contribute? The same pairs, each time with one part left out.

    python benchmarks/ablation.py --data DIR -o OUT

writes ``ablation.csv``: for each variant and set the mean error (geodesic, × 100 / √area), failures (> 10), and the mean
seconds of the match on one thread, shapes prepared.
"""

from __future__ import annotations

import csv
import time
from contextlib import ExitStack
from typing import Any

import numpy as np

from isomatch import Config, match, prepare
from isomatch.datasets.benchmarks import benchmark_set
from isomatch.matching import choice, hypotheses, pipeline, refine
from studies import asked_for, changed, drawn, in_parallel, mean_error

SEED = 77
PAIRS = {"faust_r": 4, "tosca_iso_r": 8, "scape": 2}
NO_TWINS: tuple[Any, dict[str, Any]] = (pipeline, {"twins": lambda *_: []})
NO_TURNS = {"FLIPPED_PARENTS": 0, "COMPOSED": 0, "RECOMPOSED": 0}
VARIANTS: dict[str, tuple[Config, list[tuple[Any, dict[str, Any]]]]] = {
    "everything": (Config(), []),
    "smooth option": (Config(refinement="smooth"), []),
    "no settling in both directions": (Config(), [(refine, {"SETTLING_STEPS": 0})]),
    "no positions and normals": (
        Config(),
        [(refine, {"STAGES": tuple((sizes, False) for sizes, _ in refine.STAGES), "SETTLING_STEPS": 0})],
    ),
    "refinement: after the paper's post-processing": (Config(refinement="laplace_icp"), []),
    "refinement: none (plain descriptors)": (Config(refinement="none"), []),
    "no contest: energy alone decides": (Config(), [(choice, {"MOST_CONTENDERS": 1})]),
    "contest decided by misfit alone": (Config(), [(refine, {"score_of": lambda pair, fit: fit.misfit})]),
    "no twins": (Config(), [NO_TWINS]),
    "no second round of compositions": (Config(), [(hypotheses, {"RECOMPOSED": 0})]),
    "no compositions, no twins": (Config(), [(hypotheses, {"COMPOSED": 0, "RECOMPOSED": 0}), NO_TWINS]),
    "no flips, no compositions": (Config(), [(hypotheses, NO_TURNS)]),
    "no flips, no compositions, no twins": (
        Config(),
        [(hypotheses, NO_TURNS), NO_TWINS],
    ),
    "starts without point signatures": (Config(), [(hypotheses, {"SIGNATURE_SHARE": 0.0})]),
    "one set of extremal points": (Config(), [(hypotheses, {"FEATURE_COUNTS": (5,)})]),
    "either orientation": (Config(orientation="any"), []),
}


def measured(job: tuple[str, str, tuple[str, str]]) -> list[dict[str, Any]]:
    """Match one pair in every variant."""
    data, name, names = job
    pair = benchmark_set(name, data).load(*names)
    shapes = prepare(pair.source), prepare(pair.target)
    match(*shapes)
    rows = []
    for variant, (config, changes) in VARIANTS.items():
        with ExitStack() as stack:
            for module, values in changes:
                stack.enter_context(changed(module, **values))
            started = time.perf_counter()
            found = match(*shapes, config=config)
        seconds = time.perf_counter() - started
        rows.append(
            {"variant": variant, "set": name, "error": mean_error(pair, found.map), "seconds": seconds}
        )
    return rows


if __name__ == "__main__":
    asked = asked_for(__doc__, "ablation.csv")
    jobs = drawn(asked.data, PAIRS, SEED)
    rows = [row for rows in in_parallel(measured, jobs) for row in rows]
    with (asked.output / "ablation.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("variant", "set", "pairs", "mean", "median", "failures", "seconds"))
        for variant in VARIANTS:
            for name in PAIRS:
                chosen = [row for row in rows if (row["variant"], row["set"]) == (variant, name)]
                errors = np.array([row["error"] for row in chosen])
                seconds = np.mean([row["seconds"] for row in chosen])
                line = (
                    len(errors),
                    *np.round([errors.mean(), np.median(errors)], 3),
                    int((errors > 10).sum()),
                )
                writer.writerow((variant, name, *line, round(float(seconds), 2)))
                print(variant, name, *line, round(float(seconds), 2), sep="  ")
