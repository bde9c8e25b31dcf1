"""Point signatures that a part and a whole share: each knows how far its value can be trusted near a boundary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from isomatch.descriptors import mean_curvature
from isomatch.matching.relations.part_pair import PartPair
from isomatch.shapes import CURVATURE_WEIGHT, WAVE_WEIGHT, PreparedShape
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_method, cached_property

N_ENERGIES = 20
REACH = 4.0  # a function of eigenvalue λ feels a boundary at a distance of about REACH / √λ
CURVATURE_REACH = 3.0


class PartSignatures(NamedTuple):
    """Signatures of a part, and weights between 0 (at the boundary) and 1 (far from it): both (n_part, 23 + q)."""

    values: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class WholeSignatures:
    """Signatures of a whole, and those of its parts in comparable numbers.

    These are wave signatures that do not depend on the area (Aubry, Schlickewei & Cremers, *The wave kernel signature*,
    ICCV Workshops 2011, without its normalisation) and mean curvatures, standardised by their moments on the whole.

    Parameters
    ----------
    whole : PreparedShape
        A mesh of area 1.
    known : (n_whole, q) array of float
        Known functions, which have no boundary to fear.
    """

    whole: PreparedShape
    known: FloatArray

    @cached_property
    def _energies(self) -> FloatArray:
        values = self.whole.laplace.values[1:]
        return np.linspace(np.log(values[4]), np.log(values[min(90, len(values) - 1)]), N_ENERGIES)

    def _waves(self, vectors: FloatArray, values: FloatArray) -> FloatArray:
        """Logarithms of wave signatures (n, 20) of eigenpairs in units of the whole."""
        width = 1.4 * (self._energies[1] - self._energies[0])
        filters = np.exp(-0.5 * ((self._energies - np.log(values[:, None])) / width) ** 2)
        return np.asarray(np.log(vectors**2 @ filters + 1e-3))

    @cached_property
    def _raw(self) -> tuple[FloatArray, FloatArray]:
        """Wave signatures and curvatures before they are standardised."""
        laplace, settings = self.whole.laplace, self.whole.config.preparation
        mesh = self.whole.mesh_body
        sizes = [min(size, len(laplace.values) - 1) for size in settings.curvature_functions]
        curvatures = np.stack([mean_curvature(mesh, laplace, k, weld=False) for k in sizes], axis=1)
        return self._waves(laplace.vectors[:, 1:], laplace.values[1:]), curvatures

    @cached_property
    def _weights(self) -> tuple[float, float]:
        settings = self.whole.config.preparation
        return (
            WAVE_WEIGHT / np.sqrt(N_ENERGIES),
            CURVATURE_WEIGHT / np.sqrt(len(settings.curvature_functions)),
        )

    @cached_property
    def values(self) -> FloatArray:
        """(n_whole, 23 + q) signatures."""
        weighted = [weight * _standardised(raw, raw) for weight, raw in zip(self._weights, self._raw)]
        return np.hstack([*weighted, self.known])

    @cached_method
    def _curvature_of_part(self, part: PreparedShape, k: int) -> FloatArray:
        return mean_curvature(part.mesh_body, part.laplace, k, weld=False)

    @cached_method
    def of_part(self, pair: PartPair) -> PartSignatures:
        """Signatures of a part in the unit of a pair."""
        return self._of_part(pair, np.arange(len(pair.to_boundary)))

    @cached_method
    def of_anchors(self, pair: PartPair) -> PartSignatures:
        """Those of its anchors alone, (m, 23 + q)."""
        return self._of_part(pair, pair.anchors)

    def _of_part(self, pair: PartPair, vertices: IntArray) -> PartSignatures:
        part, sizes = pair.part, pair.config.preparation.curvature_functions
        whole_values, distance = self.whole.laplace.values[1:], pair.to_boundary[vertices, None]
        waves, curvatures = self._raw
        vectors, values = part.laplace.vectors[vertices, 1:], part.laplace.values[1:]
        of_part = self._waves(vectors / pair.unit, values / pair.share)
        signatures = [self._weights[0] * _standardised(of_part, waves)]
        weights = [1 - np.exp(-((distance * np.exp(self._energies / 2) / REACH) ** 2))]
        for column, size in zip(curvatures.T, sizes):
            k = min(size, len(whole_values))
            k_part = int(np.clip(round(k * pair.share), 8, len(part.laplace.values) - 1))
            curvature = self._curvature_of_part(part, k_part)[vertices]
            here = _standardised(curvature / pair.unit, column)
            there = _standardised(column, column)
            signatures.append(self._weights[1] * np.clip(here, there.min(), there.max())[:, None])
            weights.append(1 - np.exp(-((distance * np.sqrt(whole_values[k - 2]) / CURVATURE_REACH) ** 2)))
        known = pair.functions.source[vertices]
        return PartSignatures(np.hstack([*signatures, known]), np.hstack([*weights, np.ones_like(known)]))


def _standardised(values: FloatArray, reference: FloatArray) -> FloatArray:
    """Subtract the mean of a reference and divide by its deviation; of a sphere, nothing deviates."""
    standard: FloatArray = (values - reference.mean(axis=0)) / np.maximum(reference.std(axis=0), 1e-9)
    return standard
