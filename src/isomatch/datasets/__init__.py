"""Shapes with known correspondence: procedural creatures, the shipped pair, and published sets on disk."""

from isomatch.datasets.benchmarks import BenchmarkSet, benchmark_set, relabelled
from isomatch.datasets.creatures import Creature, creature, ground_truth, joint_names
from isomatch.datasets.example import example_pair
from isomatch.datasets.published import faust, remeshed, scape, tosca
from isomatch.datasets.shape_set import BenchmarkPair, KnownShape, ShapeSet
from isomatch.datasets.truth import Truth

__all__ = [
    "BenchmarkPair",
    "BenchmarkSet",
    "Creature",
    "KnownShape",
    "ShapeSet",
    "Truth",
    "benchmark_set",
    "creature",
    "example_pair",
    "faust",
    "ground_truth",
    "joint_names",
    "relabelled",
    "remeshed",
    "scape",
    "tosca",
]
