from isomatch.datasets.example import Creature, Truth, closest_points, example_pair, ground_truth
from isomatch.datasets.heads import AnimalHead, Species, animal_head

__all__ = [
    "AnimalHead",
    "Creature",
    "Species",
    "Truth",
    "animal_head",
    "closest_points",
    "example_pair",
    "ground_truth",
]
