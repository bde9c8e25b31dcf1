from isomatch.lab.damage.coarser import decimate, resample
from isomatch.lab.damage.damaged import Damaged
from isomatch.lab.damage.disturbed import noise, weld
from isomatch.lab.damage.missing import cut, holes, limb_removed, view
from isomatch.lab.damage.pair import DamagedPair, damaged_pair
from isomatch.lab.damage.registry import DAMAGES, Damage, DamageChoice

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
