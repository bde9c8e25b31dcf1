from isomatch.assets import Asset, Attribute, read_asset, read_mesh, read_point_cloud, write_asset, write_mesh
from isomatch.bases import (
    CanonicalForm,
    DistanceBasis,
    LaplaceBasis,
    canonical_form,
    distance_basis,
    laplace_basis,
)
from isomatch.collections import Collection
from isomatch.correspondence import Correspondence, Wrapped, WrapQuality, wrap
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
from isomatch.geodesics import (
    GeodesicPath,
    distance_engine,
    farthest_point_sampling,
    geodesic_distances,
    geodesic_path,
)
from isomatch.landmarks import Landmarks, median_landmarks, nearest_landmarks, read_landmarks, write_landmarks
from isomatch.matching import (
    BothDirections,
    MatchResult,
    Outcome,
    Quality,
    Verification,
    match,
    match_both,
    verify,
)
from isomatch.mending import MeshReport, check, repair
from isomatch.runtime.stage_timer import show_progress
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, prepare
from isomatch.surfaces import Graph, Mesh, PointCloud, PrecisePoints
from isomatch.transfer import bake_texture, carry_attributes, carry_landmarks

__version__: str

__all__ = [
    "Asset",
    "Attribute",
    "BothDirections",
    "CanonicalForm",
    "Collection",
    "Config",
    "Correspondence",
    "DescriptorError",
    "DistanceBasis",
    "FormatError",
    "GeodesicDistanceDescriptor",
    "GeodesicPath",
    "Graph",
    "InputError",
    "IsomatchError",
    "LandmarkError",
    "Landmarks",
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
    "PrecisePoints",
    "PreparedShape",
    "Quality",
    "SettingError",
    "UnwritableFileError",
    "Verification",
    "WrapQuality",
    "Wrapped",
    "bake_texture",
    "canonical_form",
    "carry_attributes",
    "carry_landmarks",
    "check",
    "distance_basis",
    "distance_engine",
    "farthest_point_sampling",
    "geodesic_distance_descriptor",
    "geodesic_distances",
    "geodesic_path",
    "heat_kernel_signature",
    "laplace_basis",
    "match",
    "match_both",
    "median_landmarks",
    "nearest_landmarks",
    "prepare",
    "read_asset",
    "read_landmarks",
    "read_mesh",
    "read_point_cloud",
    "repair",
    "show_progress",
    "verify",
    "wave_kernel_signature",
    "wrap",
    "write_asset",
    "write_landmarks",
    "write_mesh",
]
