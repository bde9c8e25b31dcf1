"""How smooth, and how nearly one to one, are the maps? The default, without its last part, and the smooth option.

    python -m isomatch_lab.studies.smoothness --data DIR -o OUT

writes ``smoothness.csv``, one row for each map, and ``smoothness_table.csv``. Both directions are matched; the cycle
error is the mean geodesic distance, × 100 / √area, between a vertex and where the two maps lead it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch import Config, match, prepare
from isomatch.evaluation import coverage, cycle_errors
from isomatch.settings import RefinementSettings
from isomatch_lab.evaluation import dirichlet_energy
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import (
    Job,
    draw_jobs,
    in_parallel,
    mean_error,
    parse_arguments,
    write_rows,
    write_table,
)

SEED = 8  # seed of drawn pairs; chosen
PAIRS = {"faust_r": 5, "tosca_iso_r": 8, "scape": 3}  # number of pairs that are drawn from each set; chosen
VARIANTS = {  # settings that are compared
    "without registration": Config(refining=RefinementSettings(registration_steps=0)),
    "default": Config(),
    "smooth": Config(refinement="smooth"),
}
MEASURES = ("error", "cycle", "dirichlet", "image_area", "seconds")  # columns of the table


def measure_job(job: Job) -> list[dict[str, Any]]:
    """Match one pair both ways in every variant."""
    data, name, names = job
    pair = benchmark_set(name, data).load(*names)
    source, target = pair.source, pair.target
    shapes = prepare(source), prepare(target)
    rows = []
    for variant, config in VARIANTS.items():
        forward, backward = (match(*ends, config=config) for ends in (shapes, shapes[::-1]))
        rows.append(
            {
                "set": name,
                "pair": "-".join(names),
                "variant": variant,
                "error": mean_error(pair, forward.map),
                "cycle": 100 * float(cycle_errors(source, forward.map, backward.map, 400).mean()),
                "dirichlet": dirichlet_energy(source, target, forward.map),
                "image_area": coverage(target, forward.map, reach=0.0),
                "seconds": forward.timings["total"],
            }
        )
    return rows


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "smoothness.csv")
    jobs = draw_jobs(asked.data, PAIRS, SEED)
    rows = [row for rows in in_parallel(measure_job, jobs) for row in rows]
    write_rows(asked.output / "smoothness.csv", tuple(rows[0]), rows)
    table = []
    for variant in VARIANTS:
        chosen = [row for row in rows if row["variant"] == variant]
        means = {measure: f"{np.mean([row[measure] for row in chosen]):.3f}" for measure in MEASURES}
        table.append({"variant": variant, "pairs": len(chosen)} | means)
    write_table(asked.output / "smoothness_table.csv", table)
