"""What does each part contribute? Hard pairs, each time with one part left out, by settings alone.

    python -m isomatch_lab.studies.ablation --data DIR -o OUT

writes ``ablation_pairs.csv``, a row for each pair and variant, and ``ablation.csv``, a row for each variant: over all
pairs the mean error (geodesic, × 100 / √area), failures (> 10), maps that are worse or better than with everything by
more than 0.3, wrong maps that were reported as right, and the mean seconds of the match on one thread, shapes prepared.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from isomatch import Config, NotConvergedError, match, prepare
from isomatch.settings import RefinementSettings, SearchSettings, SelectionSettings
from isomatch_lab.studies.shared import (
    Job,
    hard_jobs,
    in_parallel,
    load_job,
    mean_error,
    parse_arguments,
    write_rows,
    write_table,
)

FAILURE_ERROR = 10.0  # 100 × mean error / √area; a pair with a larger one has failed; chosen
NOTICEABLE_CHANGE = 0.3  # 100 × error / √area; smallest difference that counts as worse or better; chosen
EVERYTHING = "everything"  # name of the variant that leaves nothing out
STEPS = RefinementSettings()
LATE_POSITIONS = RefinementSettings(  # positions and normals count in the last step only
    sizes_without_positions=STEPS.sizes_without_positions + STEPS.sizes_with_positions + STEPS.final_sizes,
    sizes_with_positions=(),
    final_sizes=(),
    registration_steps=0,
)
VARIANTS: dict[str, Config] = {  # settings that leave one thing out
    EVERYTHING: Config(),
    "no model selection: energy alone decides": Config(selection=SelectionSettings(most_contenders=1)),
    "model selection by spectral residual alone": Config(selection=SelectionSettings(energy_exponent=0.0)),
    "energy without curvature": Config(selection=SelectionSettings(curvature_exponent=0.0)),
    "no flips": Config(search=SearchSettings(flipped=0)),
    "one set of extremities": Config(search=SearchSettings(extremity_counts=(5,))),
    "no registration": Config(refining=RefinementSettings(registration_steps=0)),
    "positions and normals in the last step only, no registration": Config(refining=LATE_POSITIONS),
}


def measure(job: Job) -> list[dict[str, Any]]:
    """Match one pair in every variant."""
    pair = load_job(job)
    shapes = prepare(pair.source), prepare(pair.target)
    match(*shapes)
    rows = []
    for variant, config in VARIANTS.items():
        started = time.perf_counter()
        try:
            result = match(*shapes, config=config)
            error, outcome = mean_error(pair, result.map), result.outcome.name
        except NotConvergedError:
            error, outcome = 100.0, "NotConvergedError"
        seconds = time.perf_counter() - started
        row = {"variant": variant, "set": job[1], "pair": pair.name, "error": round(error, 3)}
        rows.append(row | {"outcome": outcome, "seconds": round(seconds, 2)})
    return rows


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each variant, over all pairs."""
    usual = {row["pair"]: row["error"] for row in rows if row["variant"] == EVERYTHING}
    table = []
    for variant in VARIANTS:
        chosen = [row for row in rows if row["variant"] == variant]
        errors = np.array([row["error"] for row in chosen])
        gained = errors - np.array([usual[row["pair"]] for row in chosen])
        wrong = [row for row in chosen if row["error"] > FAILURE_ERROR and row["outcome"] == "CONVERGED"]
        table.append(
            {
                "variant": variant,
                "pairs": len(errors),
                "mean": round(errors.mean(), 3),
                "median": round(float(np.median(errors)), 3),
                "failures": int((errors > FAILURE_ERROR).sum()),
                "worse": int((gained > NOTICEABLE_CHANGE).sum()),
                "better": int((gained < -NOTICEABLE_CHANGE).sum()),
                "wrong_called_right": len(wrong),
                "seconds": round(float(np.mean([row["seconds"] for row in chosen])), 2),
            }
        )
    return table


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "ablation.csv")
    rows = [row for rows in in_parallel(measure, hard_jobs(asked.data)) for row in rows]
    write_rows(asked.output / "ablation_pairs.csv", tuple(rows[0]), rows)
    write_table(asked.output / "ablation.csv", summary(rows))
