"""How much does each fine setting matter? Some hard pairs, each time with one setting about halved or doubled.

    python -m isomatch_lab.studies.sensitivity --data DIR -o OUT

writes ``sensitivity.csv``: for each setting and value the mean error (geodesic, × 100 / √area) over the pairs, failures
(> 10), and the largest change of a pair. The first row has the defaults. ``sensitivity_table.csv`` has the values that
change the mean by more than 0.2, and the range of all others.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from isomatch import Config, IsomatchError, PreparedShape, match, prepare
from isomatch_lab.studies.shared import (
    Job,
    hard_jobs,
    in_parallel,
    load_job,
    mean_error,
    parse_arguments,
    write_table,
)

FAILURE_ERROR = 10.0  # 100 × mean error / √area; a pair with a larger one has failed; chosen
NOTICEABLE_CHANGE = 0.2  # 100 × error / √area; smallest change of the mean error that is reported; chosen
HARD_PAIRS_STEP = 16  # every sixteenth hard pair is taken; chosen
DEFAULTS = Config()
VALUES: dict[str, dict[str, tuple[Any, ...]]] = {  # settings by stage; "" for the everyday settings
    "": {"n_search": (300, 600), "n_refine": (500, 2000)},
    "preparation": {
        "extremity_spacing": (0.15, 0.4),
        "n_extremities": (7, 12),
        "signature_step": (2, 10),
        "curvature_functions": ((100,), (25, 50, 100, 200)),
        "energy_curvature_functions": (50, 200),
    },
    "search": {
        "start_columns": (10, 30),
        "ridge": (0.0001, 0.01),
        "n_candidate_extremities": (6, 8),
        "assignments": (4, 16),
        "eccentricity_weight": (0.0, 1.0),
        "start_steps": (6, 24),
        "flip_steps": (2, 8),
        "unchanged": (0.95, 1.0),
        "compare_every": (1, 4),
        "same_start": (0.01, 0.04),
        "same_map": (0.025, 0.1),
        "n_hypotheses": (7, 28),
        "flipped": (2, 5),
        "flipped_functions": (12, 30),
    },
    "selection": {
        "normal_functions": (20, 80),
        "orientation_threshold": (0.15, 0.5),
        "energy_limit": (1.5, 6.0),
        "most_contenders": (3, 12),
        "extension_functions": (25, 100),
        "spectral_residual_limit": (1.05, 1.3),
        "same_map": (0.01, 0.04),
        "energy_exponent": (0.1, 0.5),
    },
    "refining": {"position_unit": (0.04, 0.16), "normal_weight": (0.15, 0.6), "registration_steps": (2, 8)},
}


def variants() -> dict[tuple[str, str], Config]:
    """List the settings by what was changed and to what."""
    made = {("defaults", ""): DEFAULTS}
    for stage, settings in VALUES.items():
        for name, values in settings.items():
            for value in values:
                if stage:
                    config = replace(DEFAULTS, **{stage: replace(getattr(DEFAULTS, stage), **{name: value})})
                else:
                    config = replace(DEFAULTS, **{name: value})
                made[f"{stage}.{name}".lstrip("."), str(value)] = config
    return made


def measure(job: Job) -> dict[tuple[str, str], float]:
    """Match one pair with each value; shapes are prepared again where a setting asks for it."""
    pair = load_job(job)
    usual = prepare(pair.source), prepare(pair.target)
    errors = {}
    for key, config in variants().items():
        shapes: tuple[PreparedShape, PreparedShape] = usual
        if DEFAULTS.differs_in_preparation(config):
            shapes = prepare(pair.source, config), prepare(pair.target, config)
        try:
            errors[key] = mean_error(pair, match(*shapes, config=config).map)
        except IsomatchError:
            errors[key] = 100.0
    return errors


def notable_rows(table: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows whose mean differs from the defaults, and the range of all others."""
    usual, rows = table[0]["mean"], table[1:]
    moved = [row for row in rows if abs(row["mean"] - usual) > NOTICEABLE_CHANGE]
    means = [row["mean"] for row in rows if row not in moved]
    rest = {"setting": f"{len(means)} other values", "mean": f"{min(means):.2f} to {max(means):.2f}"}
    shown = [
        {
            "setting": f"`{r['setting']}`",
            "value": r["value"],
            "mean": f"{r['mean']:.2f}",
            "failures": r["failures"],
        }
        for r in sorted(moved, key=lambda row: -row["mean"])
    ]
    return [
        {"setting": "defaults", "value": "", "mean": f"{usual:.2f}", "failures": table[0]["failures"]},
        *shown,
        rest,
    ]


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "sensitivity.csv")
    jobs = hard_jobs(asked.data)[::HARD_PAIRS_STEP]
    rows = []
    for job, row in zip(jobs, in_parallel(measure, jobs), strict=True):
        rows.append(row)
        print(*job[1:], round(row["defaults", ""], 2), flush=True)
    usual = np.array([row["defaults", ""] for row in rows])
    table = []
    for setting, value in variants():
        errors = np.array([row[setting, value] for row in rows])
        most = np.abs(errors - usual).argmax()
        table.append(
            {
                "setting": setting,
                "value": value,
                "pairs": len(errors),
                "mean": round(errors.mean(), 3),
                "failures": int((errors > FAILURE_ERROR).sum()),
                "largest_change": round(errors[most] - usual[most], 2),
            }
        )
    write_table(asked.output / "sensitivity.csv", table)
    write_table(asked.output / "sensitivity_table.csv", notable_rows(table))
