"""Damage: a mesh made from a whole one, where each of its vertices was before, and the truth that remains."""

from isomatch.datasets.damage.coarser import decimate, resample
from isomatch.datasets.damage.damaged import Damaged
from isomatch.datasets.damage.disturbed import noise, weld
from isomatch.datasets.damage.missing import cut, holes, limb_removed, view
from isomatch.datasets.damage.pair import DamagedPair, damaged_pair
from isomatch.datasets.damage.registry import DAMAGES, Damage, DamageChoice

__all__ = [
    "DAMAGES",
    "Damage",
    "DamageChoice",
    "Damaged",
    "DamagedPair",
    "cut",
    "damaged_pair",
    "decimate",
    "holes",
    "limb_removed",
    "noise",
    "resample",
    "view",
    "weld",
]
