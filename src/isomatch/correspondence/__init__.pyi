from isomatch.correspondence.alignment import (
    Alignment,
    SignedPoints,
    alignment_from_functions,
    alignment_residual,
    alignments_from_points,
    closest_point_images,
    iterative_closest_points,
    nearest_under_rotation,
    signed_procrustes,
)
from isomatch.correspondence.correspondence import Correspondence, read_map
from isomatch.correspondence.functional_maps import (
    Embedding,
    FunctionalMap,
    SampledBasis,
    SpectralPair,
    fit_functional_map,
    spectral_embedding,
)
from isomatch.correspondence.interval_matching import (
    IntervalCost,
    Intervals,
    assign_points,
    grow_regions,
    pin_first,
    trilaterate,
)
from isomatch.correspondence.map_arrays import UNMATCHED
from isomatch.correspondence.map_files import PAIR_FORMAT, SIDES, IndexBase, index_base, pair_parts
from isomatch.correspondence.median_map import geometric_median, median_map
from isomatch.correspondence.nearest import (
    SurfaceIndex,
    VertexCells,
    faces_around_vertices,
    nearest_of_few,
    nearest_points,
    nearest_rows,
)
from isomatch.correspondence.poses import Pose, carry_along, nearest_rotation, poses_between
from isomatch.correspondence.registration import (
    RigidRegistration,
    nearest_with_normals,
    register_nonrigid,
    with_normals,
)
from isomatch.correspondence.template_bending import Boundary
from isomatch.correspondence.wrapping import Wrapped, WrapQuality, welded_map, wrap
from isomatch.surfaces import PrecisePoints, nearest_in_triangle

__all__ = [
    "PAIR_FORMAT",
    "SIDES",
    "UNMATCHED",
    "Alignment",
    "Boundary",
    "Correspondence",
    "Embedding",
    "FunctionalMap",
    "IndexBase",
    "IntervalCost",
    "Intervals",
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
    "carry_along",
    "closest_point_images",
    "faces_around_vertices",
    "fit_functional_map",
    "geometric_median",
    "grow_regions",
    "index_base",
    "iterative_closest_points",
    "median_map",
    "nearest_in_triangle",
    "nearest_of_few",
    "nearest_points",
    "nearest_rotation",
    "nearest_rows",
    "nearest_under_rotation",
    "nearest_with_normals",
    "pair_parts",
    "pin_first",
    "poses_between",
    "read_map",
    "register_nonrigid",
    "signed_procrustes",
    "spectral_embedding",
    "trilaterate",
    "welded_map",
    "with_normals",
    "wrap",
]
