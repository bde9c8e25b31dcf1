from isomatch.mending._winding import seems_inside_out
from isomatch.mending.caps import capped, capped_at
from isomatch.mending.check import MeshReport, check
from isomatch.mending.outer import inner_faces
from isomatch.mending.outliers import outliers
from isomatch.mending.repair import Repair, parted_described, repair, welded_surface, without_seams
from isomatch.mending.self_contacts import Cut, creases, cut_along, cut_self_contacts, ends_of, handles
from isomatch.mending.sheets import Separation, separate_sheets
from isomatch.mending.walls import double_walled_share

__all__ = [
    "Cut",
    "MeshReport",
    "Repair",
    "Separation",
    "capped",
    "capped_at",
    "check",
    "creases",
    "cut_along",
    "cut_self_contacts",
    "double_walled_share",
    "ends_of",
    "handles",
    "inner_faces",
    "outliers",
    "parted_described",
    "repair",
    "seems_inside_out",
    "separate_sheets",
    "welded_surface",
    "without_seams",
]
