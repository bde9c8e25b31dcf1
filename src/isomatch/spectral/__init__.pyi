from isomatch.spectral.basis import BasisMethod, Weighting, basis_domain
from isomatch.spectral.build import distance_basis
from isomatch.spectral.canonical_form import CanonicalForm, canonical_form, classical_scaling
from isomatch.spectral.distance_basis import DistanceBasis
from isomatch.spectral.laplace_basis import LaplaceBasis, laplace_basis, refined_laplace_basis
from isomatch.spectral.laplacian import factorise_for_threads, stiffness_and_masses
from isomatch.spectral.low_rank import nystrom_basis, spectral_interpolant

__all__ = [
    "BasisMethod",
    "CanonicalForm",
    "DistanceBasis",
    "LaplaceBasis",
    "Weighting",
    "basis_domain",
    "canonical_form",
    "classical_scaling",
    "distance_basis",
    "factorise_for_threads",
    "laplace_basis",
    "nystrom_basis",
    "refined_laplace_basis",
    "spectral_interpolant",
    "stiffness_and_masses",
]
