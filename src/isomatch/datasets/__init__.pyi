from isomatch.datasets.creatures import Creature, creature, ground_truth, joint_names
from isomatch.datasets.example import example_pair
from isomatch.datasets.organs import PLANS, Organ, organ, organ_truth
from isomatch.datasets.truth import Truth

__all__ = [
    "PLANS",
    "Creature",
    "Organ",
    "Truth",
    "creature",
    "example_pair",
    "ground_truth",
    "joint_names",
    "organ",
    "organ_truth",
]
