"""The refinements that come with isomatch: the joint one, its smooth variant, and those of the paper."""

from __future__ import annotations

from operator import itemgetter
from typing import ClassVar

import numpy as np
from scipy.linalg import polar

from isomatch.correspondence import Embedding, signed_procrustes
from isomatch.matching.fit import Fit
from isomatch.matching.pair import ShapePair
from isomatch.matching.screening import energy_of
from isomatch.matching.stages import Joint, Refinement, Relation
from isomatch.runtime.threads import parallel_map
from isomatch.settings import RefinementName
from isomatch.shapes import orientation_of
from isomatch.values.arrays import FloatArray, IntArray

# functions from which the functional map grows; each is tried; docs/lab/paper.md: the best of four heals most
LAPLACE_FIRST = (15, 20, 30, 40)

LAPLACE_CHOICE = 50  # functions at which the best of these is chosen; chosen: as many as the rank

LAPLACE_STEP = 5  # functions added in each step; Melzi et al. 2019

# iterations of the plain descriptor alignment on the refinement vertices; two on all follow; chosen, not measured
DISTANCE_STEPS = 15


class Smooth(Joint):
    """The joint refinement with more steps of registration, for a map that is smooth and nearly one to one."""

    @property
    def smooth(self) -> bool:
        """It is."""
        return True


class Descriptors(Joint):
    """The paper's plain method: nothing after the alignment of the distance descriptors of the map selected."""

    looks_further: ClassVar[bool] = False
    polishes: ClassVar[bool] = False

    def everywhere(self, relation: Relation, fit: Fit) -> Embedding:
        """Align distance descriptors, from the hypothesis that the map came from."""
        if fit.candidate is None:
            return relation.embedding(fit)
        return descriptor_embedding(relation.pair, fit.candidate.hypothesis.target_row)


class LaplaceIcp(Descriptors):
    """Post-processing like the paper's: iterative closest points in the Laplace–Beltrami basis."""

    def everywhere(self, relation: Relation, fit: Fit) -> Embedding:
        """Post-process the alignment of distance descriptors."""
        return laplace_icp_embedding(relation.pair, super().everywhere(relation, fit))


def descriptor_embedding(pair: ShapePair, target_row: IntArray) -> Embedding:
    """Align distance descriptors on the refinement vertices, then twice on all: the paper's plain method.

    ``target_row`` (m_s,) is a map of the search vertices. Shamai & Kimmel 2017.
    """
    source, target = pair.source.points, pair.target.points

    def turned(source_vertex: IntArray, target_vertex: IntArray) -> FloatArray:
        return target.coordinates @ signed_procrustes(source.at(source_vertex), target.at(target_vertex))

    points = turned(pair.source_vertices, pair.target_vertices[target_row])
    everywhere = np.arange(len(source.coordinates))
    for vertices in (*[pair.refinement_vertices] * DISTANCE_STEPS, everywhere, everywhere):
        images = pair.target.index.vertices(points, source.coordinates[vertices])
        points = turned(vertices, images)
    return Embedding(source.coordinates, points)


def laplace_icp_embedding(pair: ShapePair, start: Embedding) -> Embedding:
    """Post-process a map by iterative closest points in the Laplace–Beltrami basis.

    The functional map F grows from a few functions to all, some more in each step, on the refinement vertices; then
    once on all vertices. F is fitted by least squares: where shapes stretch it is not orthogonal. Few functions at first
    heal large errors of the start, more keep limbs apart. So several sizes are tried, and of those that keep the
    orientation of the start the one of least energy, see `energy_of`, grows on.

    Notes
    -----
    Shamai & Kimmel 2017, section on post-processing, where F is orthogonal and has its size from the start
    (``laplace_steps_at_once``); growth as in Melzi et al., *ZoomOut*, 2019; the choice among sizes is ours.
    """
    settings, spectra, vertices = pair.config.refining, pair.spectra, pair.refinement_vertices
    weights = pair.source.laplace.weights
    rows = spectra.nearest(start.target, start.source[vertices])
    most = pair.n_functions
    if settings.laplace_steps_at_once:
        first = polar(spectra.functional_map(rows, most))[0]
        return spectra.embedding(spectra.orthogonal_icp(first, most, settings.laplace_steps_at_once, weights))
    middle = min(LAPLACE_CHOICE, most)

    def side(target_vertex: IntArray) -> float:
        return float(np.sign(orientation_of(pair.source, spectra.source, pair.target, target_vertex, middle)))

    def sizes(first: int, last: int) -> tuple[int, ...]:
        return (*range(first + LAPLACE_STEP, last, LAPLACE_STEP), last) if last > first else ()

    def grown(first: int) -> tuple[bool, float, FloatArray]:
        functional_map = spectra.upsampled(spectra.functional_map(rows, first), sizes(first, middle))
        image = spectra.image(functional_map)
        return side(image) != kept, energy_of(pair, vertices, image), functional_map

    kept = side(rows)
    trials = parallel_map(grown, sorted({min(first, middle) for first in LAPLACE_FIRST}))
    *_, functional_map = min(trials, key=itemgetter(0, 1))
    functional_map = spectra.upsampled(functional_map, sizes(middle, most))
    of_source, of_target = spectra.embedding(functional_map)
    everywhere = spectra.nearest(of_target, of_source)
    on_target = pair.target.laplace.vectors[everywhere, :most]
    return spectra.embedding(pair.source.laplace.coefficients(on_target, most))


REFINEMENTS: dict[RefinementName, Refinement] = {
    "joint": Joint(),
    "smooth": Smooth(),
    "laplace_icp": LaplaceIcp(),
    "none": Descriptors(),
}
"""The refinements that settings can name."""
