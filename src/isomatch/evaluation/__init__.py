"""Maps against the truth: errors, curves, and runs over benchmark sets."""

from isomatch.evaluation.benchmark import BenchmarkRun, read_rows, run_benchmark, summaries, write_tables
from isomatch.evaluation.princeton import cumulative_curve, geodesic_errors

__all__ = [
    "BenchmarkRun",
    "cumulative_curve",
    "geodesic_errors",
    "read_rows",
    "run_benchmark",
    "summaries",
    "write_tables",
]
