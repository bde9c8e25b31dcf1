"""Which hypothesis is true: energies that tell the map from its mirror image and its half-turned twins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._arrays import IntArray
from isomatch._threads import parallel_map
from isomatch.matching.alignment import orthogonal_alignment, residual
from isomatch.matching.config import Orientation
from isomatch.matching.hypotheses import Hypothesis
from isomatch.matching.pair import SEARCH_RANK, Glimpse, Pair
from isomatch.matching.prepare import PreparedShape
from isomatch.surfaces.mesh import vertex_normals

SIZES = tuple(range(20, 51, 5))  # functions in the upsampling that precedes the judgement
SMOOTH = 40  # functions of the surfaces whose normals are compared
CONTENDER = 3.0  # energy, against the best, up to which a hypothesis is refined and compared again
MOST_CONTENDERS = 6
SAME_ENERGY = (
    1.5  # energy, against the best, up to which orientation decides among maps that agree with landmarks
)
ORIENTED = 0.3  # mean cosine between normals above which a map counts as orientation-preserving


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis after upsampling to 50 functions, and the evidence for it.

    Parameters
    ----------
    hypothesis : Hypothesis
        What was judged.
    image : (m,) array of int
        Target row of each source row, upsampled.
    energy : float
        See `energy_of`; with 30 columns.
    orientation : float
        Mean cosine between the normals of the smooth target drawn on the source and those of the smooth target: near 1
        for the true map, near −1 for its mirror image, between for mixtures; 0 where a shape has no normals.
    """

    hypothesis: Hypothesis
    image: IntArray
    energy: float
    orientation: float


def judge(pair: Pair, hypotheses: list[Hypothesis]) -> list[Judged]:
    """Judge every hypothesis; the order is kept."""
    return parallel_map(lambda hypothesis: _judge(pair, hypothesis), hypotheses)


def ranked(judged: list[Judged], orientation: Orientation) -> list[Judged]:
    """Best first: first those of the wanted orientation, then those not clearly of the other, then the rest."""
    return sorted(judged, key=lambda j: (_orientation_class(j.orientation, orientation), j.energy))


def ranked_by_side(judged: list[Judged], orientation: Orientation) -> list[Judged]:
    """Best first among maps that agree with landmarks, which may ask for the mirror image.

    The wanted side comes first only where its energy is near the best: a mixture of both sides is neither.
    """
    limit = SAME_ENERGY * min((j.energy for j in judged), default=0.0)
    return sorted(
        judged,
        key=lambda j: (
            _orientation_class(j.orientation, orientation) > 0 or j.energy > limit,
            _orientation_class(j.orientation, "any"),
            j.energy,
        ),
    )


def contenders(order: list[Judged], orientation: Orientation, rounds: int = 1) -> list[Judged]:
    """Keep those near enough to the best to deserve a full refinement: comparable energy, not of the other side.

    The orientation of a right map through few functions can be small where limbs touch; the misfit after refinement,
    which compares normals everywhere, decides among all that lean to the wanted side. Each round of the search may send
    six.
    """
    side = max(1, _orientation_class(order[0].orientation, orientation))
    leaning = [judged for judged in order if _orientation_class(judged.orientation, orientation) <= side]
    leaning.sort(key=lambda judged: judged.energy)
    return [judged for judged in leaning if judged.energy <= CONTENDER * leaning[0].energy][
        : rounds * MOST_CONTENDERS
    ]


def _orientation_class(cosine: float, wanted: Orientation) -> int:
    kept = {"preserve": cosine, "reverse": -cosine, "any": abs(cosine)}[wanted]
    return 0 if kept > ORIENTED else 1 if kept > 0 else 2


def _judge(pair: Pair, hypothesis: Hypothesis) -> Judged:
    image = pair.upsampled(hypothesis.alignment.image, SIZES)
    onto = pair.target.rows[image]
    return Judged(
        hypothesis,
        image,
        energy_of(pair, pair.source.rows, onto, SEARCH_RANK),
        orientation_of(pair.source, pair.target.shape, onto, SMOOTH),
    )


def energy_of(pair: Pair, rows: IntArray, image: IntArray, rank: int | None = None) -> float:
    """Energy of a map (m,) from source to target body vertices: residual × squared curvature mismatch.

    The residual is the misfit of the distance descriptors after the best rotation, in units of √(average distance): it
    sees all but near-symmetries. Those are seen by the mismatch, the mean absolute difference of the standardised signed
    mean curvatures; 1 where a shape has none.
    """
    source, target = pair.source.shape, pair.target.shape
    at_target, at_source = target.cloud.at(image, rank), source.cloud.at(rows, rank)
    distances = residual(at_target, at_source, orthogonal_alignment(at_target, at_source))
    mismatch = np.abs(target.curvature[image] - source.curvature[rows]).mean() if pair.sided else 1.0
    return float(distances * mismatch**2)


def orientation_of(source: Glimpse, target: PreparedShape, image: IntArray, k: int) -> float:
    """Mean cosine between the normals of the target, low-passed to k functions, and of its copy drawn on the source.

    ``image`` (m,) holds the target body vertex of each row of the glimpse. 0 where a shape has no triangles.
    """
    mesh, onto = source.shape.triangles, target.triangles
    if mesh is None or onto is None:
        return 0.0
    k = min(k, source.functions.shape[1], len(target.laplace.values))
    copy = source.shape.laplace.vectors[:, :k] @ source.fit(onto.vertices[image], k)
    drawn = vertex_normals(copy, mesh.faces)[source.rows]
    smooth = vertex_normals(target.laplace.low_passed(onto.vertices, k), onto.faces)[image]
    return float(np.einsum("ij,ij->i", drawn, smooth).mean())
