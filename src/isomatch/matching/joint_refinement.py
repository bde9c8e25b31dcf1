"""Joint refinement: from a map on a few hundred vertices to a precise one on all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch.correspondence import (
    Embedding,
    PrecisePoints,
    SampledBasis,
    nearest_of_few,
    register_nonrigid,
)
from isomatch.matching.candidates import Candidate, energy_of, extended
from isomatch.matching.pair import ShapePair, SmoothPair
from isomatch.matching.select import survivors
from isomatch.runtime.threads import parallel_map, row_product
from isomatch.surfaces import vertex_normals
from isomatch.values.arrays import FloatArray, IntArray, single

EVERYWHERE = slice(None)


@dataclass(frozen=True, eq=False)
class RefinedCandidate:
    """A candidate refined on the refinement vertices.

    Parameters
    ----------
    candidate : Candidate
        The candidate it came from.
    target_vertex : (n_refine,) array of int
        Image of each refinement vertex.
    misfit : float
        Mean distance of these vertices from their images in the joint coordinates of the last step. It judges a map by
        everything at once: spectrum, signatures, positions and normals after the best smooth fit.
    score : float
        What speaks against the map: misfit × a power of the energy of the refined map. The misfit sees detail, after a
        fit that may have smoothed over what distances and curvature still see. nan until the last stage.
    """

    candidate: Candidate
    target_vertex: IntArray
    misfit: float
    score: float = np.nan

    @property
    def orientation(self) -> float:
        """That of the candidate."""
        return self.candidate.orientation

    @property
    def side(self) -> float:
        """1 if the map preserves the orientation of the faces, −1 if it reverses it."""
        return 1.0 if self.orientation >= 0 else -1.0

    @property
    def landmark_error(self) -> float:
        """That of the candidate."""
        return self.candidate.landmark_error

    @property
    def hint_error(self) -> float:
        """That of the candidate."""
        return self.candidate.hint_error

    @property
    def residual(self) -> float:
        """That of the hypothesis, before any refinement."""
        return self.candidate.hypothesis.alignment.residual


def refine_jointly(
    pair: ShapePair, candidates: list[Candidate], both_sides: bool = False
) -> list[RefinedCandidate]:
    """Upsample spectrally, joint with signatures, positions and normals; give up candidates on the way.

    In each step the target's functions *and positions* are fitted on the source by least squares over the source's
    refinement vertices, F and c; the next images are nearest neighbours, among all target vertices (in the first stage,
    but for its last step, among n_refine samples), in

    - the spectral coordinates Φ_t Fᵀ against Φ_s, divided by √k,
    - point signatures,
    - after the first stage, positions: the smoothed target against the copy of it drawn on the source, Φ_s c,
    - and normals of both.

    Positions and normals are those of the target and of its own copy, so the pose of either shape does not matter.

    Parameters
    ----------
    pair : ShapePair
        The two shapes.
    candidates : list of Candidate
        Maps to refine. The sign of their orientation tells how normals are to be compared.
    both_sides : bool
        Whether to keep the best of each orientation to the end, however badly it fits.

    Returns
    -------
    list of RefinedCandidate
        Without those given up on the way, because another arrived at the same map or fitted much better; see
        `survivors`.

    Notes
    -----
    O(n_refine √n (K + q)) a step for the nearest neighbours, O(n K²) for the coordinates.
    """
    settings = pair.config.refining
    rows = pair.refinement_vertices
    fits = [RefinedCandidate(c, extended(pair, c.target_row, rows), np.inf) for c in candidates]
    stages = (
        (settings.sizes_without_positions, False),
        (settings.sizes_with_positions, True),
        (settings.final_sizes, True),
    )
    for sizes, with_positions in stages:
        if sizes and fits:
            fits = parallel_map(lambda fit: _stepped(pair, fit, sizes, with_positions), fits)  # noqa: B023
            kept = survivors(
                fits, distances_between(pair, fits), pair.config.selection, with_positions, both_sides
            )
            fits = [replace(fits[i], candidate=fits[j].candidate) for i, j in kept]
    return [replace(fit, score=_score(pair, fit)) for fit in fits]


def distances_between(pair: ShapePair, fits: list[RefinedCandidate]) -> FloatArray:
    """Mean geodesic distance between the images of each two refined maps, (q, q), in √area."""
    apart = np.zeros((len(fits),) * 2)
    for i, fit in enumerate(fits):
        for j, other in enumerate(fits[:i]):
            apart[i, j] = apart[j, i] = pair.target.mean_distance(fit.target_vertex, other.target_vertex)
    return apart


def shares_elsewhere(pair: ShapePair, fits: list[RefinedCandidate]) -> FloatArray:
    """Share of vertices that each two refined maps send to places far apart, (q, q)."""
    far, shares = pair.config.selection.elsewhere_distance, np.zeros((len(fits),) * 2)
    for i, fit in enumerate(fits):
        for j, other in enumerate(fits[:i]):
            apart = pair.target.distance(fit.target_vertex, other.target_vertex)
            shares[i, j] = shares[j, i] = (apart > far).mean()
    return shares


def _score(pair: ShapePair, fit: RefinedCandidate) -> float:
    energy = energy_of(pair, pair.refinement_vertices, fit.target_vertex)
    return float(fit.misfit * energy**pair.config.selection.energy_exponent)


def _stepped(
    pair: SmoothPair, fit: RefinedCandidate, sizes: tuple[int, ...], with_positions: bool
) -> RefinedCandidate:
    target_vertex, misfit = fit.target_vertex, fit.misfit
    side = fit.side if with_positions else 0.0
    samples = pair.target.sample_vertices[: pair.target.config.n_refine]
    for k in sizes:
        size, last = min(k, pair.n_functions), with_positions or k == sizes[-1]
        of_source, of_target = _joint(
            pair, target_vertex, size, side, pair.refinement_vertices, EVERYWHERE if last else samples
        )
        row = (pair.target.index.vertices if last else nearest_of_few)(of_target, of_source)
        misfit = float(np.linalg.norm(of_target[row] - of_source, axis=1).mean())
        target_vertex = row if last else samples[row]
    return RefinedCandidate(fit.candidate, target_vertex, misfit)


def joint_embedding(pair: SmoothPair, fit: RefinedCandidate, smooth: bool) -> Embedding:
    """Coordinates of all vertices of both bodies under a refined map, with all functions, after registration.

    Signatures recognise points. The smooth variant does without them, and registers in more steps: positions, normals
    and spectrum alone make a smoother map.
    """
    settings, k = pair.config.refining, pair.n_functions
    everywhere = np.arange(pair.source.body.n_vertices)
    embedding = _joint(pair, fit.target_vertex, k, fit.side, everywhere)
    steps = settings.registration_steps
    if smooth:
        steps = settings.smooth_registration_steps
        signatures = np.s_[k : k + pair.signatures.source.shape[1]]
        embedding = Embedding(*(np.delete(x, signatures, axis=1) for x in embedding))
    source, target = pair.source, pair.target
    displacements = SampledBasis(source.functions, pair.refinement_vertices)
    samples = target.sample_vertices[: target.config.n_refine]
    return register_nonrigid(embedding, source.index, target.index, displacements, samples, steps)


def polished_points(pair: ShapePair, finer: SmoothPair, fit: RefinedCandidate, smooth: bool) -> PrecisePoints:
    """Polish a refined map at the finer levels of its shapes: image of each source vertex there.

    The last steps of the joint refinement, and the registration.
    """
    image, between = fit.target_vertex, pair.target.refining
    start = replace(fit, target_vertex=image if between is None else between.nearest_members[image])
    stepped = _stepped(finer, start, pair.config.refining.polished_sizes, with_positions=True)
    embedding = joint_embedding(finer, stepped, smooth)
    return finer.target.index.points(embedding.target, embedding.source)


def _joint(
    pair: SmoothPair,
    target_vertex: IntArray,
    k: int,
    side: float,
    source_vertex: IntArray,
    onto_vertex: IntArray | slice = EVERYWHERE,
) -> Embedding:
    """Coordinates of some vertices of source and target; with positions and normals unless side is 0."""
    settings, source, target = pair.config.refining, pair.source, pair.target
    basis, onto = pair.spectra.source, target.triangles
    with_positions = side != 0 and source.triangles is not None and onto is not None
    unit, weight = 1 / settings.position_unit, settings.normal_weight
    functional_map = basis.fit(target.laplace.vectors[target_vertex, :k], k) / np.sqrt(k)

    def of_source() -> FloatArray:
        phi = source.functions[:, :k]
        columns = [phi[source_vertex] * np.float32(1 / np.sqrt(k)), pair.signatures.source[source_vertex]]
        if with_positions:
            drawn = row_product(phi, basis.fit(target.mesh_body.vertices[target_vertex], k))
            normals = vertex_normals(drawn, source.faces)[source_vertex]
            columns += [single(unit * drawn[source_vertex]), single(side * weight * normals)]
        return np.hstack(columns)

    def of_target() -> FloatArray:
        phi = target.functions[onto_vertex, :k]
        columns = [row_product(phi, functional_map.T), pair.signatures.target[onto_vertex]]
        if with_positions:
            smooth, normals = (each[onto_vertex] for each in target.smoothed(k))
            columns += [single(unit * smooth), single(weight * normals)]
        return np.hstack(columns)

    return Embedding(*parallel_map(lambda half: half(), (of_source, of_target)))
