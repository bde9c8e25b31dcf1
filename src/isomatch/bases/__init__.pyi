from isomatch.bases.build import distance_basis
from isomatch.bases.canonical_form import CanonicalForm, canonical_form, classical_scaling
from isomatch.bases.choices import BasisMethod, Weighting
from isomatch.bases.distance_basis import DistanceBasis
from isomatch.bases.domain import basis_domain
from isomatch.bases.interpolation import fmds_basis, smds_basis, spectral_interpolant
from isomatch.bases.laplace_basis import LaplaceBasis, laplace_basis, refined_laplace_basis
from isomatch.bases.laplacian import factorised, stiffness_and_masses
from isomatch.bases.nystrom import exact_basis, nystrom_basis
from isomatch.bases.prediction import ColumnPredictor, predicted_basis

__all__ = [
    "BasisMethod",
    "CanonicalForm",
    "ColumnPredictor",
    "DistanceBasis",
    "LaplaceBasis",
    "Weighting",
    "basis_domain",
    "canonical_form",
    "classical_scaling",
    "distance_basis",
    "exact_basis",
    "factorised",
    "fmds_basis",
    "laplace_basis",
    "nystrom_basis",
    "predicted_basis",
    "refined_laplace_basis",
    "smds_basis",
    "spectral_interpolant",
    "stiffness_and_masses",
]
