"""Distance columns: geodesic engines and the sampling that drives them."""

from isomatch.geodesics.dijkstra import distance_along_edges_to_nearest
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
    "Sampling",
    "distance_along_edges_to_nearest",
    "distance_engine",
    "farthest_point_sampling",
    "geodesic_distances",
    "pair_distances",
    "peripheral_vertex",
]
