from isomatch_lab.procedural.creatures import creature, joint_names
from isomatch_lab.procedural.organs import PLANS, Organ, organ, organ_truth

__all__ = ["PLANS", "Organ", "creature", "joint_names", "organ", "organ_truth"]
