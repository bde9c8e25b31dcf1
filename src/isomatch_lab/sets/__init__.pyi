from isomatch_lab.sets.benchmarks import BenchmarkSet, benchmark_set
from isomatch_lab.sets.folder_set import FolderSet, FolderSettings, own_set
from isomatch_lab.sets.published import faust, remeshed, scape, tosca
from isomatch_lab.sets.shape_set import BenchmarkPair, KnownShape, ShapeSet, relabelled
from isomatch_lab.sets.stored_set import StoredSet

__all__ = [
    "BenchmarkPair",
    "BenchmarkSet",
    "FolderSet",
    "FolderSettings",
    "KnownShape",
    "ShapeSet",
    "StoredSet",
    "benchmark_set",
    "faust",
    "own_set",
    "relabelled",
    "remeshed",
    "scape",
    "tosca",
]
