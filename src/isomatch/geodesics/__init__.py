"""Distance columns: geodesic engines and the sampling that drives them."""

from isomatch.geodesics._pending import RestrictedEngine, euclidean_farthest_points, nearest_along_edges
from isomatch.geodesics.engines import EngineName, MetricSpace, distance_engine, geodesic_distances
from isomatch.geodesics.given import GivenFunction, GivenMatrix
from isomatch.geodesics.pairs import pair_distances
from isomatch.geodesics.protocol import DistanceEngine
from isomatch.geodesics.sampling import Sampling, farthest_point_sampling, peripheral_vertex

__all__ = [
    "DistanceEngine",
    "EngineName",
    "GivenFunction",
    "GivenMatrix",
    "MetricSpace",
    "RestrictedEngine",
    "Sampling",
    "distance_engine",
    "euclidean_farthest_points",
    "farthest_point_sampling",
    "geodesic_distances",
    "nearest_along_edges",
    "pair_distances",
    "peripheral_vertex",
]
