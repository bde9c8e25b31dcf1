from isomatch.correspondence.alignment import (
    Alignment,
    alignment_residual,
    closest_point_images,
    iterative_closest_points,
    signed_procrustes,
)
from isomatch.correspondence.boundary import Boundary
from isomatch.correspondence.checked_map import UNMATCHED
from isomatch.correspondence.common_regions import Intervals, grow_common_regions, trilaterate_common
from isomatch.correspondence.correspondence import Correspondence, MapFile, read_map
from isomatch.correspondence.foreign_maps import IndexBase, index_base
from isomatch.correspondence.functional_maps import (
    Embedding,
    FunctionalMap,
    SampledBasis,
    SpectralPair,
    fit_functional_map,
    spectral_embedding,
)
from isomatch.correspondence.grown_regions import grow_regions
from isomatch.correspondence.interval_matching import (
    IntervalCost,
    assign_points,
    pin_first,
    trilaterate,
)
from isomatch.correspondence.linear_alignment import (
    alignment_from_functions,
    alignments_from_points,
    nearest_under_rotation,
)
from isomatch.correspondence.median_map import geometric_median, median_map
from isomatch.correspondence.nearest_neighbours import (
    VertexCells,
    nearest_in_cells,
    nearest_of_few,
    nearest_rows,
)
from isomatch.correspondence.nearest_points import (
    faces_around_vertices,
    nearest_points,
)
from isomatch.correspondence.poses import Pose, poses_between
from isomatch.correspondence.registration import register_nonrigid
from isomatch.correspondence.rigid_registration import (
    RigidRegistration,
    nearest_with_normals,
    register_as_rigid_as_possible,
    with_normals,
)
from isomatch.correspondence.rotation import nearest_rotation
from isomatch.correspondence.signed_points import SignedPoints
from isomatch.correspondence.surface_index import SurfaceIndex
from isomatch.correspondence.welding import welded_map
from isomatch.correspondence.wrapping import Wrapped, WrapQuality, wrap
from isomatch.surfaces import PrecisePoints, nearest_in_triangle

__all__ = [
    "UNMATCHED",
    "Alignment",
    "Boundary",
    "Correspondence",
    "Embedding",
    "FunctionalMap",
    "IndexBase",
    "IntervalCost",
    "Intervals",
    "MapFile",
    "Pose",
    "PrecisePoints",
    "RigidRegistration",
    "SampledBasis",
    "SignedPoints",
    "SpectralPair",
    "SurfaceIndex",
    "VertexCells",
    "WrapQuality",
    "Wrapped",
    "alignment_from_functions",
    "alignment_residual",
    "alignments_from_points",
    "assign_points",
    "closest_point_images",
    "faces_around_vertices",
    "fit_functional_map",
    "geometric_median",
    "grow_common_regions",
    "grow_regions",
    "index_base",
    "iterative_closest_points",
    "median_map",
    "nearest_in_cells",
    "nearest_in_triangle",
    "nearest_of_few",
    "nearest_points",
    "nearest_rotation",
    "nearest_rows",
    "nearest_under_rotation",
    "nearest_with_normals",
    "pin_first",
    "poses_between",
    "read_map",
    "register_as_rigid_as_possible",
    "register_nonrigid",
    "signed_procrustes",
    "spectral_embedding",
    "trilaterate",
    "trilaterate_common",
    "welded_map",
    "with_normals",
    "wrap",
]
