from isomatch.repair._winding import seems_inside_out
from isomatch.repair.caps import capped, capped_at
from isomatch.repair.check import MeshReport, check
from isomatch.repair.outer import inner_faces
from isomatch.repair.outliers import outliers
from isomatch.repair.repair import Repair, parted_described, repair, welded_surface, without_seams
from isomatch.repair.self_contacts import Cut, creases, cut_along, cut_self_contacts, ends_of, handles
from isomatch.repair.sheets import Separation, separate_sheets
from isomatch.repair.walls import double_walled_share

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
