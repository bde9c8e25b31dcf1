from isomatch.repair._winding import seems_inside_out
from isomatch.repair.caps import capped
from isomatch.repair.check import MeshReport, check
from isomatch.repair.draft import Draft, VertexTrace
from isomatch.repair.for_matching import LARGE_MESH, prepare_for_matching
from isomatch.repair.outer import inner_faces
from isomatch.repair.outliers import outliers
from isomatch.repair.repair import Repair, repair, without_seams
from isomatch.repair.self_contacts import Cut, creases, cut_along, cut_self_contacts, ends_of, handles
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
    "capped",
    "check",
    "creases",
    "cut_along",
    "cut_self_contacts",
    "double_walled_share",
    "ends_of",
    "handles",
    "inner_faces",
    "outliers",
    "prepare_for_matching",
    "repair",
    "seems_inside_out",
    "separate_sheets",
    "without_seams",
]
