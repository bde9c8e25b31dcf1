"""Point signatures that a part and a whole share: each knows how far its value can be trusted near a boundary."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from isomatch._arrays import FloatArray
from isomatch.descriptors import mean_curvature
from isomatch.matching.parts.part_pair import PartPair

N_ENERGIES = 20
REACH = 4.0  # a function of eigenvalue λ feels a boundary at a distance of about REACH / √λ
CURVATURE_REACH = 3.0


class PartSignatures(NamedTuple):
    """Signatures of part and whole, and weights between 0 (at the boundary) and 1 (far from it) of the part's."""

    part: FloatArray
    whole: FloatArray
    weights: FloatArray


def part_signatures(pair: PartPair) -> PartSignatures:
    """Wave signatures that do not depend on the area, and curvatures.

    Returns
    -------
    PartSignatures
        (n_part, 23), (n_whole, 23) and (n_part, 23). Both are standardised by the moments of the whole.
    """
    settings = pair.config.preparation
    part, whole = pair.part, pair.whole
    part_values, whole_values = part.laplace.values[1:] / pair.share, whole.laplace.values[1:]
    last = min(90, len(whole_values) - 1)
    energies = np.linspace(np.log(whole_values[4]), np.log(whole_values[last]), N_ENERGIES)
    width = 1.4 * (energies[1] - energies[0])

    def filters(values: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-0.5 * ((energies - np.log(values[:, None])) / width) ** 2))

    wave_whole = np.log(whole.laplace.vectors[:, 1:] ** 2 @ filters(whole_values) + 1e-3)
    wave_part = np.log(part.laplace.vectors[:, 1:] ** 2 / pair.share @ filters(part_values) + 1e-3)
    mean, deviation = wave_whole.mean(axis=0), wave_whole.std(axis=0)
    weight = settings.wave_weight / np.sqrt(N_ENERGIES)
    of_whole, of_part = [weight * (wave_whole - mean) / deviation], [weight * (wave_part - mean) / deviation]
    distance = pair.to_boundary[:, None]
    weights = [1 - np.exp(-((distance * np.exp(energies / 2) / REACH) ** 2))]
    weight = settings.curvature_weight / np.sqrt(len(settings.curvature_functions))
    part_mesh, whole_mesh = pair.meshes
    for size in settings.curvature_functions:
        k = min(size, len(whole_values))
        k_part = int(np.clip(round(k * pair.share), 8, len(part_values)))
        there = mean_curvature(whole_mesh, whole.laplace, k)
        here = mean_curvature(part_mesh, part.laplace, k_part) / pair.unit
        mean, deviation = there.mean(), max(there.std(), 1e-9)  # of a sphere, nothing deviates
        there, here = (there - mean) / deviation, (here - mean) / deviation
        of_whole.append(weight * there[:, None])
        of_part.append(weight * np.clip(here, there.min(), there.max())[:, None])
        weights.append(1 - np.exp(-((distance * np.sqrt(whole_values[k - 2]) / CURVATURE_REACH) ** 2)))
    return PartSignatures(np.hstack(of_part), np.hstack(of_whole), np.hstack(weights))
