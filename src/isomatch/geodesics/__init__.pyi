from isomatch.geodesics.component_engines import ComponentEngine
from isomatch.geodesics.dijkstra import distance_along_edges_to_nearest
from isomatch.geodesics.engines import (
    ENGINES,
    MetricSpace,
    distance_engine,
    engine_names,
    geodesic_distances,
    metric_space,
)
from isomatch.geodesics.given import RestrictedEngine
from isomatch.geodesics.intervals import MissingRegion
from isomatch.geodesics.paths import PATH_SUFFIXES, GeodesicPath, geodesic_path, geodesic_paths, write_paths
from isomatch.geodesics.points import points_of
from isomatch.geodesics.protocol import (
    Balls,
    ColumnEngine,
    DistanceEngine,
    geodesic_balls,
    ordinary_unit,
    pair_distances,
)
from isomatch.geodesics.sampling import (
    Sampling,
    euclidean_farthest_points,
    farthest_point_sampling,
    peripheral_vertex,
)

__all__ = [
    "ENGINES",
    "PATH_SUFFIXES",
    "Balls",
    "ColumnEngine",
    "ComponentEngine",
    "DistanceEngine",
    "GeodesicPath",
    "MetricSpace",
    "MissingRegion",
    "RestrictedEngine",
    "Sampling",
    "distance_along_edges_to_nearest",
    "distance_engine",
    "engine_names",
    "euclidean_farthest_points",
    "farthest_point_sampling",
    "geodesic_balls",
    "geodesic_distances",
    "geodesic_path",
    "geodesic_paths",
    "metric_space",
    "ordinary_unit",
    "pair_distances",
    "peripheral_vertex",
    "points_of",
    "write_paths",
]
