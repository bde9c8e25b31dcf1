from isomatch.lab.sets.benchmarks import BenchmarkSet, benchmark_set
from isomatch.lab.sets.folder_set import FolderSet, FolderSettings, own_set
from isomatch.lab.sets.published import faust, remeshed, scape, tosca
from isomatch.lab.sets.shape_files import read_indices
from isomatch.lab.sets.shape_set import BenchmarkPair, KnownShape, ShapeSet, relabelled
from isomatch.lab.sets.stored_set import StoredSet
from isomatch.lab.sets.truth_files import Truth, read_truth

__all__ = [
    "BenchmarkPair",
    "BenchmarkSet",
    "FolderSet",
    "FolderSettings",
    "KnownShape",
    "ShapeSet",
    "StoredSet",
    "Truth",
    "benchmark_set",
    "faust",
    "own_set",
    "read_indices",
    "read_truth",
    "relabelled",
    "remeshed",
    "scape",
    "tosca",
]
