from isomatch_lab.evaluation.benchmark import rows_of, run_benchmark
from isomatch_lab.evaluation.benchmark_run import BenchmarkRun
from isomatch_lab.evaluation.curves import PublishedCurve, read_published_curves
from isomatch_lab.evaluation.distortion import MetricDistortion, distance_table, metric_distortion
from isomatch_lab.evaluation.ledger import read_rows, set_label
from isomatch_lab.evaluation.methods import CONTINUATIONS, METHODS, MapsInFolder, Method, OwnFunction
from isomatch_lab.evaluation.page import told_of_parts
from isomatch_lab.evaluation.result import BenchmarkResult, benchmark
from isomatch_lab.evaluation.smoothness import dirichlet_energy
from isomatch_lab.evaluation.subject import CachingEngine
from isomatch_lab.evaluation.tables import improvements, summaries, write_tables
from isomatch_lab.evaluation.true_landmarks import true_landmarks

__all__ = [
    "CONTINUATIONS",
    "METHODS",
    "BenchmarkResult",
    "BenchmarkRun",
    "CachingEngine",
    "MapsInFolder",
    "Method",
    "MetricDistortion",
    "OwnFunction",
    "PublishedCurve",
    "benchmark",
    "dirichlet_energy",
    "distance_table",
    "improvements",
    "metric_distortion",
    "read_published_curves",
    "read_rows",
    "rows_of",
    "run_benchmark",
    "set_label",
    "summaries",
    "told_of_parts",
    "true_landmarks",
    "write_tables",
]
