"""Shapes with known correspondences."""

from isomatch.datasets.creatures import Creature, creature, ground_truth, joint_names
from isomatch.datasets.example import example_pair
from isomatch.datasets.truth import Truth

__all__ = ["Creature", "Truth", "creature", "example_pair", "ground_truth", "joint_names"]
