from isomatch.datasets.example import Creature, Truth, closest_points, example_pair, ground_truth

__all__ = ["Creature", "Truth", "closest_points", "example_pair", "ground_truth"]
