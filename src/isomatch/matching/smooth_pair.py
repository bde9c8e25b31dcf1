"""Two bodies with their smooth functions, on which the joint refinement works."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import BodyVertices, Int, single
from isomatch._core.cached import cached_property
from isomatch.correspondence import Embedding, SpectralPair
from isomatch.settings import Config
from isomatch.shapes import SmoothShape


@dataclass(frozen=True, eq=False)
class SmoothPair:
    """Two bodies with their smooth functions."""

    source: SmoothShape
    target: SmoothShape
    config: Config
    functions: Embedding | None = None  # weighted values at the users' vertices

    @cached_property
    def refinement_vertices(self) -> Int[BodyVertices, "r"]:
        """Source vertices whose images refinements compute."""
        return BodyVertices(self.source.sample_vertices[: self.source.config.n_refine])

    @cached_property
    def signatures(self) -> Embedding:
        """Point signatures that both shapes have, and known functions."""
        both = self.source.signatures, self.target.signatures
        n_common = min(signatures.shape[1] for signatures in both)
        return Embedding(
            *(single(np.hstack([x[:, :n_common], functions])) for x, functions in zip(both, self.known))
        )

    @cached_property
    def known(self) -> Embedding:
        """The known functions on the bodies, without columns if there are none."""
        if self.functions is None:
            return Embedding(*(np.zeros((shape.body.n_vertices, 0)) for shape in (self.source, self.target)))
        source, target = self.functions
        return Embedding(self.source.restrict(source), self.target.restrict(target))

    @cached_property
    def spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases, for maps from refinement vertices to target vertices."""
        return SpectralPair(
            self.source.sampled_basis(self.source.config.n_refine),
            self.target.laplace.vectors,
            self.target.index.vertices,
        )

    @property
    def n_functions(self) -> int:
        """Number of Laplace–Beltrami functions that both shapes have."""
        return min(len(self.source.laplace.values), len(self.target.laplace.values))

    @property
    def oriented(self) -> bool:
        """Whether both shapes have an inside, so that normals and curvature can be compared."""
        return self.source.triangles is not None and self.target.triangles is not None
