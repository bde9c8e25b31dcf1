from isomatch.datasets.example import Creature as Creature
from isomatch.datasets.example import Truth as Truth
from isomatch.datasets.example import closest_points as closest_points
from isomatch.datasets.example import example_pair as example_pair
from isomatch.datasets.example import ground_truth as ground_truth
from isomatch.datasets.heads import AnimalHead as AnimalHead
from isomatch.datasets.heads import Species as Species
from isomatch.datasets.heads import animal_head as animal_head
