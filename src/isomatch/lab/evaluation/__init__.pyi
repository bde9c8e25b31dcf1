from isomatch.lab.evaluation.benchmark import rows_of, run_benchmark
from isomatch.lab.evaluation.benchmark_run import BenchmarkRun
from isomatch.lab.evaluation.bijectivity import coverage, cycle_errors
from isomatch.lab.evaluation.caching import CachingEngine
from isomatch.lab.evaluation.distortion import MetricDistortion, distance_table, metric_distortion
from isomatch.lab.evaluation.ledger import read_rows, set_label
from isomatch.lab.evaluation.methods import CONTINUATIONS, METHODS, Method
from isomatch.lab.evaluation.own_methods import MapsInFolder, OwnFunction
from isomatch.lab.evaluation.page import told_of_parts
from isomatch.lab.evaluation.princeton import (
    LIMIT,
    THRESHOLDS,
    SidedErrors,
    area_under_curve,
    counted,
    cumulative_curve,
    geodesic_errors,
    sided_errors,
)
from isomatch.lab.evaluation.published_curves import PublishedCurve, read_published_curves
from isomatch.lab.evaluation.result import BenchmarkResult, benchmark
from isomatch.lab.evaluation.smoothness import dirichlet_energy
from isomatch.lab.evaluation.tables import improvements, summaries, write_tables
from isomatch.lab.evaluation.true_landmarks import true_landmarks

__all__ = [
    "CONTINUATIONS",
    "LIMIT",
    "METHODS",
    "THRESHOLDS",
    "BenchmarkResult",
    "BenchmarkRun",
    "CachingEngine",
    "MapsInFolder",
    "Method",
    "MetricDistortion",
    "OwnFunction",
    "PublishedCurve",
    "SidedErrors",
    "area_under_curve",
    "benchmark",
    "counted",
    "coverage",
    "cumulative_curve",
    "cycle_errors",
    "dirichlet_energy",
    "distance_table",
    "geodesic_errors",
    "improvements",
    "metric_distortion",
    "read_published_curves",
    "read_rows",
    "rows_of",
    "run_benchmark",
    "set_label",
    "sided_errors",
    "summaries",
    "told_of_parts",
    "true_landmarks",
    "write_tables",
]
