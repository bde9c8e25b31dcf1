from isomatch.datasets.benchmarks import BenchmarkSet, benchmark_set, relabelled
from isomatch.datasets.creatures import Creature, creature, ground_truth, joint_names
from isomatch.datasets.damage import (
    DAMAGES,
    Damage,
    DamageChoice,
    Damaged,
    DamagedPair,
    cut,
    damaged_pair,
    decimate,
    holes,
    limb_removed,
    noise,
    resample,
    view,
    weld,
)
from isomatch.datasets.example import example_pair
from isomatch.datasets.organs import Organ, organ, organ_truth
from isomatch.datasets.published import faust, remeshed, scape, tosca
from isomatch.datasets.shape_files import read_indices
from isomatch.datasets.shape_set import BenchmarkPair, KnownShape, ShapeSet
from isomatch.datasets.truth import Truth

__all__ = [
    "DAMAGES",
    "BenchmarkPair",
    "BenchmarkSet",
    "Creature",
    "Damage",
    "DamageChoice",
    "Damaged",
    "DamagedPair",
    "KnownShape",
    "Organ",
    "ShapeSet",
    "Truth",
    "benchmark_set",
    "creature",
    "cut",
    "damaged_pair",
    "decimate",
    "example_pair",
    "faust",
    "ground_truth",
    "holes",
    "joint_names",
    "limb_removed",
    "noise",
    "organ",
    "organ_truth",
    "read_indices",
    "relabelled",
    "remeshed",
    "resample",
    "scape",
    "tosca",
    "view",
    "weld",
]
