"""How alike two parts of a body look: around single points, and over regions that they may have in common."""

from __future__ import annotations

import numpy as np

from isomatch.descriptors import BallSignature, deviation_of
from isomatch.matching.relations.both_side import BothSide
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.cached import cached_property

# all chosen on two parts of SHREC'16, not one by one; docs/lab/design_notes.md
USUAL = 0.25  # cost of a candidate that says nothing
PRIOR_RADII = 1.5  # number of radii that a neutral mismatch counts as
USUAL_AREA, MOST_AREA, PRIOR_AREAS = 0.15, 1.0, 2.0  # the same of the logarithms of areas
LOOKS_WEIGHT, AREAS_WEIGHT = 0.6, 0.5
MOST_MISMATCH = 2.0  # standard deviations from which values differ as much as any two

AROUND = 0.12  # distance over which mismatches are averaged
N_ALIKE = 3  # samples of the target that always look as alike as any
BY_CHANCE = 1.2  # mean of −log of the ranks of images up to which they may be at random; uniform ranks have 1
NEUTRAL, PRIOR = 0.5, 0.5  # mismatch where nothing is known, and number of radii that it counts as

SURELY = 0.05  # distance from where nothing is shown, from which something surely is
UNCOVERED = 0.08  # distance from all images from which a sample of the target has none
LEFT_OUT_COST = 1.0  # of area that has no image but must, in evidence

N_AROUND = 8  # samples around each whose triangles are compared


class BothLooks:
    """What two parts look like around their samples.

    Parameters
    ----------
    source, target : BothSide
        The parts.
    """

    def __init__(self, source: BothSide, target: BothSide) -> None:
        self.source, self.target = source, target

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(self.source.looks, self.target.looks)

    @cached_property
    def _around(self) -> FloatArray:
        """(r, r) how much each sample of the source counts around each."""
        source = self.source
        around: FloatArray = np.exp(-((source.intervals.upper / AROUND) ** 2)) * source.areas
        return around

    def mismatches(self, rows: IntArray, images: IntArray) -> FloatArray:
        """(q,) how differently the parts look around some samples of the source and their images, vertices of the target.

        Means over near samples of the region, drawn to a neutral value where little is known.
        """
        here, there = self.source.looks.at(self.source.vertices[rows]), self.target.looks.at(images)
        count = (here.known & there.known).sum(axis=1)
        total = np.nan_to_num(here.mismatch(there, self._deviation)) * count
        around = self._around[np.ix_(rows, rows)]
        mean: FloatArray = (around @ (total + NEUTRAL * PRIOR)) / (around @ (count + PRIOR))
        return mean

    @cached_property
    def _looks_apart(self) -> FloatArray:
        """(r, c) how differently each sample of the source and each of the target look by themselves."""
        here, there = self.source.looks.at(self.source.vertices), self.target.looks.at(self.target.vertices)
        return _drawn_to(*_summed(here, there, self._deviation), USUAL, PRIOR_RADII)

    @cached_property
    def _surprise(self) -> FloatArray:
        """(r, c) how unlikely it is that a sample of the target looks as alike as this one: −log of its rank, 0…1."""
        apart = self._looks_apart
        rank = apart.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
        surprise: FloatArray = -np.log((rank + N_ALIKE) / apart.shape[1])
        return surprise

    def evidence(self, rows: IntArray, images: IntArray) -> float:
        """Sum area × how much better images look than at random, over the samples of a region where that is above 0.

        What everything looks like is no evidence, and shapes of two kinds, which look unlike everywhere, are judged as
        those of one.
        """
        surprise = self._surprise[rows, self.target.nearest_sample[images]]
        around = self._around[np.ix_(rows, rows)]
        mean = around @ surprise / around.sum(axis=1)
        return float(self.source.areas[rows] @ np.maximum(mean - BY_CHANCE, 0.0))

    def worth(self, rows: IntArray, images: IntArray) -> float:
        """Return the evidence for a region, less what speaks against it.

        Two parts of one body show the same where both reach: a sample that is nearer to one of the region than the image
        of that is to the boundary of the target must have an image. What has none counts against the region; so does what
        of the target must be an image.
        """
        source, target = self.source, self.target
        if not len(rows):
            return 0.0
        from_region = source.intervals.upper[:, rows]
        from_images = target.intervals.upper[:, target.nearest_sample[images]]
        shown = (target.to_boundary[images] - from_region).max(axis=1) > SURELY
        showing = (source.to_boundary[source.vertices[rows]] - from_images).max(axis=1) > SURELY
        shown[rows] = False
        left_out = source.areas[shown].sum()
        left_out += target.areas[showing & (from_images.min(axis=1) > UNCOVERED)].sum()
        return self.evidence(rows, images) - LEFT_OUT_COST * float(left_out)

    def alike(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Cost (m, c) of each candidate for each anchor by itself, by looks and areas of balls."""
        looks = self._looks_apart[np.ix_(rows, columns)]
        (of_source, known_there), (of_target, known_here) = self.source.ball_areas, self.target.ball_areas
        both = known_there[rows][:, None] & known_here[columns][None]
        apart = np.minimum(np.abs(of_source[rows][:, None] - of_target[columns][None]), MOST_AREA)
        areas = _drawn_to((apart * both).sum(axis=2), both.sum(axis=2), USUAL_AREA, PRIOR_AREAS)
        return LOOKS_WEIGHT * looks + AREAS_WEIGHT * areas


def signed_triangles(source: BothSide, rows: IntArray, target: BothSide, images: IntArray) -> float:
    """Mean sign of the small triangles of samples: 1 if their images are wound alike, −1 if they are mirrored."""
    if len(rows) <= N_AROUND:
        return 0.0
    apart = source.intervals.upper[np.ix_(rows, rows)]
    np.fill_diagonal(apart, np.inf)
    near = np.argpartition(apart, N_AROUND - 1, axis=1)[:, :N_AROUND]
    i, j = np.triu_indices(N_AROUND, 1)
    signs = []
    for mesh, vertices in (
        (source.shape.mesh_body, source.vertices[rows]),
        (target.shape.mesh_body, images),
    ):
        points, normals = mesh.vertices[vertices], mesh.vertex_normals[vertices]
        around = points[near] - points[:, None]
        signs.append(np.einsum("akd,ad->ak", np.cross(around[:, i], around[:, j]), normals))
    weights = np.abs(signs[0])
    return float((np.sign(signs[0] * signs[1]) * weights).sum() / max(weights.sum(), 1e-12))


def _summed(here: BallSignature, there: BallSignature, deviation: FloatArray) -> tuple[FloatArray, IntArray]:
    """Sum over the radii known at both of the halved mismatches of all pairs, and their number."""
    known = here.known[:, None] & there.known[None]
    total = np.zeros(known.shape[:2])
    for j in range(known.shape[2]):
        apart = np.abs(here.values[:, None, j] - there.values[None, :, j]) / deviation[j]
        total += known[:, :, j] * np.minimum(apart, MOST_MISMATCH).mean(axis=2) / MOST_MISMATCH
    return total, known.sum(axis=2)


def _drawn_to(total: FloatArray, count: IntArray, neutral: float, prior: float) -> FloatArray:
    drawn: FloatArray = (total + neutral * prior) / (count + prior)
    return drawn
