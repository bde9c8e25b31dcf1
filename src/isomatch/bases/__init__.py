"""Bases: all distances, and the smooth functions, of a surface in n × k numbers."""

from isomatch.bases.distance_basis import (
    BasisMethod,
    DistanceBasis,
    Weighting,
    distance_basis,
    exact_basis,
    nystrom_basis,
)
from isomatch.bases.laplace_basis import LaplaceBasis, laplace_basis

__all__ = [
    "BasisMethod",
    "DistanceBasis",
    "LaplaceBasis",
    "Weighting",
    "distance_basis",
    "exact_basis",
    "laplace_basis",
    "nystrom_basis",
]
