"""Non-rigid registration: one surface moved smoothly onto another, in any space that holds both."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve

from isomatch.correspondence.functional_maps import Embedding, SampledBasis
from isomatch.correspondence.surface_index import SurfaceIndex
from isomatch.runtime.threads import parallel_map, row_product
from isomatch.values.arrays import IntArray, single

RIDGE = 1e-6  # of the number of equations; above the rounding of normal equations in single precision


def register_nonrigid(
    embedding: Embedding,
    source: SurfaceIndex,
    target: SurfaceIndex,
    displacements: SampledBasis,
    target_vertices: IntArray,
    steps: int,
) -> Embedding:
    """Move the source, in the space of an embedding, smoothly onto the target.

    In each step the samples of either surface find their nearest points on the other one. The displacement of the
    source, a combination of smooth functions, that best joins all these points is applied. As the surfaces come to
    coincide, the map between them becomes smooth, and the two directions become inverse to each other.

    Parameters
    ----------
    embedding : Embedding
        Coordinates (n_s, d) and (n_t, d).
    source, target : SurfaceIndex
        The surfaces.
    displacements : SampledBasis
        Functions (n_s, K) of the source that a displacement may combine, and the source's samples.
    target_vertices : (m_t,) array of int
        The target's samples.
    steps : int
        Number of steps.

    Returns
    -------
    Embedding
        The moved source, and the target as it was.

    Notes
    -----
    O(m √n d) a step for the nearest neighbours and O(n K d) for the displacement. Using both directions makes a map
    reversible, as in Ezuz, Solomon & Ben-Chen, *Reversible Harmonic Maps*, 2019. The form of the fit is ours.

    Examples
    --------
    A square is moved onto one that is shifted by 0.1. Displacements are constant, so that one step does it.

    >>> import numpy as np
    >>> from isomatch.correspondence import VertexCells
    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> index = SurfaceIndex(np.zeros((0, 3), dtype=int), VertexCells.of(np.array([0]), np.zeros(4, dtype=int)))
    >>> both, every = Embedding(square, square + [0.1, 0.0]), np.arange(4)
    >>> moved = register_nonrigid(both, index, index, SampledBasis(np.ones((4, 1)), every), every, steps=1)
    >>> moved.source.round(4)[:2].tolist()
    [[0.1, 0.0], [1.1, 0.0]]
    """
    of_target = embedding.target
    functions, source_vertices = displacements.functions, displacements.vertices
    moved, at_samples = embedding.source, single(displacements.at_samples)
    for _ in range(steps):
        searches = (target, of_target, moved[source_vertices]), (source, moved, of_target[target_vertices])
        forth, back = parallel_map(lambda search: search[0].points(*search[1:]), searches)
        # forth: u(s) = nearest point − s at samples of the source; back: u(nearest point) = t − nearest point
        design = np.vstack([at_samples, back.interpolated(functions)])
        wanted = np.vstack(
            [
                forth.interpolated(of_target) - embedding.source[source_vertices],
                of_target[target_vertices] - back.interpolated(embedding.source),
            ]
        )
        gram = (design.T @ design).astype(np.float64) + RIDGE * len(design) * np.eye(design.shape[1])
        coefficients = solve(gram, (design.T @ wanted).astype(np.float64), assume_a="pos")
        moved = embedding.source + row_product(functions, coefficients)
    return Embedding(moved, of_target)
