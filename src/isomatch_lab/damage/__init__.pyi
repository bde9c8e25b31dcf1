from isomatch_lab.damage.damaged import Damaged, DamagedPair, damaged_pair
from isomatch_lab.damage.disturbed import decimate, merge, noise, resample, weld
from isomatch_lab.damage.missing import cut, holes, limb_removed, view
from isomatch_lab.damage.registry import DAMAGES, Damage, DamageChoice

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
    "merge",
    "noise",
    "resample",
    "view",
    "weld",
]
