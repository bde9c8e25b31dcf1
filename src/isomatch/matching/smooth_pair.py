"""Two bodies with their smooth functions."""

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
    """Two bodies with their smooth functions: what the joint refinement needs."""

    source: SmoothShape
    target: SmoothShape
    config: Config
    functions: Embedding | None = None  # weighted values at the users' vertices

    @cached_property
    def refinement_vertices(self) -> Int[BodyVertices, "r"]:
        """Source vertices on which refinements iterate."""
        return BodyVertices(self.source.sample_vertices[: self.source.config.n_refine])

    @cached_property
    def signatures(self) -> Embedding:
        """Point signatures that both shapes have, and known functions."""
        of_source, of_target = self.source.signatures, self.target.signatures
        common = min(of_source.shape[1], of_target.shape[1])
        sides = zip((of_source, of_target), self.known)
        return Embedding(*(single(np.hstack([own[:, :common], functions])) for own, functions in sides))

    @cached_property
    def known(self) -> Embedding:
        """The known functions on the bodies, without columns if none is."""
        if self.functions is None:
            return Embedding(*(np.zeros((shape.body.n_vertices, 0)) for shape in (self.source, self.target)))
        source, target = self.functions
        return Embedding(self.source.restrict(source), self.target.restrict(target))

    @cached_property
    def spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases, for maps from the refinement vertices to all vertices of the target."""
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
        """Whether both shapes have an inside and an outside, so that normals and curvature can be compared."""
        return self.source.triangles is not None and self.target.triangles is not None
