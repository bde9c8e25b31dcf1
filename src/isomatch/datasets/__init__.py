"""Shapes with known correspondences."""

from isomatch.datasets.creatures import Creature, creature, ground_truth, joint_names
from isomatch.datasets.example import example_pair
from isomatch.datasets.published import faust, remeshed, scape, tosca
from isomatch.datasets.shape_set import BenchmarkPair, KnownShape, ShapeSet
from isomatch.datasets.truth import Truth

__all__ = [
    "BenchmarkPair",
    "Creature",
    "KnownShape",
    "ShapeSet",
    "Truth",
    "creature",
    "example_pair",
    "faust",
    "ground_truth",
    "joint_names",
    "remeshed",
    "scape",
    "tosca",
]
