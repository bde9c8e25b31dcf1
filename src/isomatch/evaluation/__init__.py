"""Maps against the truth: errors, curves, and runs over benchmark sets."""

from isomatch.evaluation.benchmark import BenchmarkRun, read_rows, run_benchmark, summaries, write_tables
from isomatch.evaluation.bijectivity import coverage, cycle_errors
from isomatch.evaluation.distortion import MetricDistortion, metric_distortion
from isomatch.evaluation.princeton import (
    SidedErrors,
    area_under_curve,
    cumulative_curve,
    geodesic_errors,
    mean_error,
    sided_errors,
)
from isomatch.evaluation.smoothness import conformal_distortion, dirichlet_energy, torn_edges

__all__ = [
    "BenchmarkRun",
    "MetricDistortion",
    "SidedErrors",
    "area_under_curve",
    "conformal_distortion",
    "coverage",
    "cumulative_curve",
    "cycle_errors",
    "dirichlet_energy",
    "geodesic_errors",
    "mean_error",
    "metric_distortion",
    "read_rows",
    "run_benchmark",
    "sided_errors",
    "summaries",
    "torn_edges",
    "write_tables",
]
