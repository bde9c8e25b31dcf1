from isomatch.datasets.example import Creature, example_pair, ground_truth
from isomatch.datasets.truth import Truth, closest_points

__all__ = ["Creature", "Truth", "closest_points", "example_pair", "ground_truth"]
