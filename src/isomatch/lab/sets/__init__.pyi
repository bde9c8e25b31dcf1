from isomatch.lab.sets.benchmarks import BenchmarkSet, benchmark_set, relabelled
from isomatch.lab.sets.published import faust, remeshed, scape, tosca
from isomatch.lab.sets.shape_files import read_indices
from isomatch.lab.sets.shape_set import BenchmarkPair, KnownShape, ShapeSet

__all__ = [
    "BenchmarkPair",
    "BenchmarkSet",
    "KnownShape",
    "ShapeSet",
    "benchmark_set",
    "faust",
    "read_indices",
    "relabelled",
    "remeshed",
    "scape",
    "tosca",
]
