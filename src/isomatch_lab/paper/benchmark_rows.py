"""The rows of a benchmark run that an item of the paper needs: read from the folder of runs, or computed there."""

from __future__ import annotations

from typing import Any

from isomatch_lab.evaluation import BenchmarkRun, rows_of, run_benchmark
from isomatch_lab.paper.item import Setting


def benchmark_rows(
    setting: Setting, set_name: str, methods: tuple[str, ...], **options: Any
) -> list[dict[str, Any]]:
    """Run what is not yet in the folder of runs; return all rows, pair by pair in the order of the methods."""
    run = BenchmarkRun(
        set_name,
        methods,
        setting.folder,
        setting.n_pairs,
        setting.n_points,
        setting.seed,
        setting.jobs,
        **options,
    )
    for count, row in enumerate(run_benchmark(run, setting.runs), 1):
        setting.progress(f"{set_name}: {count} rows, last {row['pair']} by {row['method']}")
    return rows_of(run, setting.runs)
