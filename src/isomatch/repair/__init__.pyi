from isomatch.repair._winding import seems_inside_out
from isomatch.repair.caps import close_holes
from isomatch.repair.check import MeshReport, check
from isomatch.repair.draft import Draft, VertexTrace
from isomatch.repair.for_matching import LARGE_MESH, prepare_for_matching
from isomatch.repair.outer import inner_faces
from isomatch.repair.outliers import find_outliers
from isomatch.repair.repair import Repair, repair, without_seams
from isomatch.repair.self_contacts import (
    Cut,
    count_handles,
    cut_along,
    cut_self_contacts,
    ends_of,
    find_creases,
)
from isomatch.repair.sheets import Separation, separate_sheets
from isomatch.repair.walls import double_walled_share

__all__ = [
    "LARGE_MESH",
    "Cut",
    "Draft",
    "MeshReport",
    "Repair",
    "Separation",
    "VertexTrace",
    "check",
    "close_holes",
    "count_handles",
    "cut_along",
    "cut_self_contacts",
    "double_walled_share",
    "ends_of",
    "find_creases",
    "find_outliers",
    "inner_faces",
    "prepare_for_matching",
    "repair",
    "seems_inside_out",
    "separate_sheets",
    "without_seams",
]
