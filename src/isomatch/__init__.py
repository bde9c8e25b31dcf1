"""Point-to-point correspondence between near-isometric surfaces.

From geodesic distance descriptors, spectra, curvature and smoothed positions; no training, no landmarks needed.
"""

from typing import TYPE_CHECKING

from isomatch._renamed import old_names
from isomatch.bases import (
    CanonicalForm,
    DistanceBasis,
    LaplaceBasis,
    canonical_form,
    distance_basis,
    laplace_basis,
)
from isomatch.correspondence import Correspondence
from isomatch.descriptors import (
    GeodesicDistanceDescriptor,
    geodesic_distance_descriptor,
    heat_kernel_signature,
    wave_kernel_signature,
)
from isomatch.errors import (
    DescriptorError,
    FormatError,
    InputError,
    IsomatchError,
    LandmarkError,
    MapError,
    MemoryBudgetError,
    MeshError,
    MissingDependencyError,
    MissingFileError,
    NotConvergedError,
    SettingError,
    UnwritableFileError,
)
from isomatch.geodesics import distance_engine, farthest_point_sampling, geodesic_distances
from isomatch.matching import Config, MatchResult, Outcome, PreparedShape, Quality, match, prepare
from isomatch.surfaces import (
    Graph,
    Mesh,
    MeshReport,
    PointCloud,
    check,
    read_mesh,
    read_point_cloud,
    repair,
    write_mesh,
)

__version__ = "0.1.0"

__all__ = [
    "CanonicalForm",
    "Config",
    "Correspondence",
    "DescriptorError",
    "DistanceBasis",
    "FormatError",
    "GeodesicDistanceDescriptor",
    "Graph",
    "InputError",
    "IsomatchError",
    "LandmarkError",
    "LaplaceBasis",
    "MapError",
    "MatchResult",
    "MemoryBudgetError",
    "Mesh",
    "MeshError",
    "MeshReport",
    "MissingDependencyError",
    "MissingFileError",
    "NotConvergedError",
    "Outcome",
    "PointCloud",
    "PreparedShape",
    "Quality",
    "SettingError",
    "UnwritableFileError",
    "canonical_form",
    "check",
    "distance_basis",
    "distance_engine",
    "farthest_point_sampling",
    "geodesic_distance_descriptor",
    "geodesic_distances",
    "heat_kernel_signature",
    "laplace_basis",
    "match",
    "prepare",
    "read_mesh",
    "read_point_cloud",
    "repair",
    "wave_kernel_signature",
    "write_mesh",
]

if not TYPE_CHECKING:  # a type checker still reports names that never were
    __getattr__ = old_names(__name__)
