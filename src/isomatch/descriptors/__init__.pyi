from isomatch.descriptors.ball_signature import RADII, BallSignature, ball_signature, deviation_of
from isomatch.descriptors.gdd import GeodesicDistanceDescriptor, geodesic_distance_descriptor
from isomatch.descriptors.spectral_signatures import (
    heat_kernel_signature,
    mean_curvature,
    standardised,
    wave_kernel_map,
    wave_kernel_signature,
)

__all__ = [
    "RADII",
    "BallSignature",
    "GeodesicDistanceDescriptor",
    "ball_signature",
    "deviation_of",
    "geodesic_distance_descriptor",
    "heat_kernel_signature",
    "mean_curvature",
    "standardised",
    "wave_kernel_map",
    "wave_kernel_signature",
]
