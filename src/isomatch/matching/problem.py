"""Two prepared shapes and their samples, on which hypotheses are tried and compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, SearchRows, single
from isomatch._core.cached import cached_property
from isomatch._core.errors import MemoryBudgetError, MeshError, NotConvergedError
from isomatch._core.stage_timer import MATCHING, Progress, StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding, SignedPoints, SpectralPair, nearest_of_few
from isomatch.io import SurfaceLike
from isomatch.matching.proposals.extremities import extremity_assignments
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, SmoothShape, prepare

# of both shapes, from which no automatic map is told; discs and balls 11 to 40, bodies to 6
MANY_ROTATIONS = 11


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


@dataclass(frozen=True, eq=False)
class ShapePair(SmoothPair):
    """Source and target, with what matching needs of both.

    A *row* counts the search vertices of a shape, a *vertex* those of its body. In shapes of arrays, ``m_s`` and ``m_t``
    are the search vertices of source and target, ``n_s`` and ``n_t`` the vertices of their bodies, ``n_source`` and
    ``n_target`` the user's, and ``r`` those that a refinement maps.

    Parameters
    ----------
    source, target : PreparedShape
    config : Config
        The settings of the match.
    functions : Embedding, optional
        Known functions, of mean 0 and variance 1: values at the user's vertices, (n_source, q) and (n_target, q).
    """

    source: PreparedShape
    target: PreparedShape

    @property
    def turned(self) -> ShapePair:
        """The pair the other way round."""
        functions = None if self.functions is None else Embedding(*self.functions[::-1])
        return ShapePair(self.target, self.source, self.config, functions)

    @property
    def has_finer(self) -> bool:
        """Whether either shape has a finer level on which maps are polished."""
        return self.source.finer is not None or self.target.finer is not None

    @cached_property
    def polishable(self) -> SmoothPair:
        """The shapes at these levels."""
        source, target = parallel_map(lambda shape: shape.polishable, (self.source, self.target))
        return SmoothPair(source, target, self.config, self.functions)

    @cached_property
    def source_vertices(self) -> Int[BodyVertices, "m_s"]:
        """Search vertices of the source."""
        return BodyVertices(self.source.sample_vertices[: self.source.config.n_search])

    @cached_property
    def target_vertices(self) -> Int[BodyVertices, "m_t"]:
        """Search vertices of the target."""
        return BodyVertices(self.target.sample_vertices[: self.target.config.n_search])

    @cached_property
    def search_points(self) -> tuple[SignedPoints, SignedPoints]:
        """Leading columns of the descriptors of source and target at the search vertices."""
        source, target, rank = self.source.points, self.target.points, self.config.search.rank
        return source.at(self.source_vertices, rank), target.at(self.target_vertices, rank)

    @cached_property
    def search_signatures(self) -> Embedding:
        """The signatures at the search vertices."""
        source, target = self.signatures
        return Embedding(source[self.source_vertices], target[self.target_vertices])

    @cached_property
    def search_spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases, for maps from search vertices to search vertices: rows."""
        source = self.source.sampled_basis(self.source.config.n_search)
        return SpectralPair(source, self.target.laplace.vectors[self.target_vertices], nearest_of_few)

    @property
    def both_open(self) -> bool:
        """Whether both shapes have a long boundary, as patches and tubes have."""
        least = self.config.parts.long_boundary
        return min(self.source.longest_boundary, self.target.longest_boundary) > least

    @cached_property
    def extremity_assignments(self) -> list[Int[BodyVertices, "q 2"]]:
        """Extremal points assigned to extremal points, see `extremity_assignments`."""
        return extremity_assignments(self.source, self.target, self.config.search)

    @property
    def limbless(self) -> bool:
        """Whether a shape has too few extremities to tell a map, or both have a long boundary."""
        return self.both_open or not self.extremity_assignments

    @property
    def sideless(self) -> bool:
        """Whether the target has symmetries but no inside, so that rotations cannot be told from mirror images."""
        return bool(self.target.symmetries) and self.target.one_sided

    @property
    def round(self) -> bool:
        """Whether both shapes have so many rotations that those found are a few of a continuous group, as of a ball."""
        both = self.source.symmetries, self.target.symmetries
        return min(sum(each.orientation >= 0 for each in own) for own in both) >= MANY_ROTATIONS

    @property
    def notes(self) -> tuple[str, ...]:
        """What was repaired or left out of either shape."""
        return tuple(f"{side}: {note}" for side in ("source", "target") for note in getattr(self, side).notes)

    @property
    def left_out(self) -> float:
        """Largest share of either shape in components that are not matched; see `PreparedShape`."""
        return max(self.source.left_out, self.target.left_out)

    @cached_property
    def _target_row_distances(self) -> Float[FloatArray, "m_t m_t"]:
        """Geodesic distances between the target's search vertices, in √area."""
        return self.target.distances_between(self.target_vertices)

    def distances_between_maps(
        self, target_row: Int[SearchRows, "m_s"], others: Sequence[Int[SearchRows, "m_s"]]
    ) -> Float[FloatArray, "q"]:
        """Mean geodesic distance between the images of a map and of each of others, in √area."""
        if not others:
            return np.zeros(0)
        return np.asarray(self._target_row_distances[np.array(others), target_row].mean(axis=1))

    def inverted(self, target_row: Int[SearchRows, "m_s"]) -> Int[SearchRows, "m_t"]:
        """Invert a map: for each search vertex of the target the row whose image is nearest."""
        return SearchRows(self._target_row_distances[:, target_row].argmin(axis=1))

    def differs(
        self, target_row: Int[SearchRows, "m_s"], others: Sequence[Int[SearchRows, "m_s"]], least: float
    ) -> bool:
        """Tell whether a map differs from each of others by more than a mean distance, in √area."""
        return bool((self.distances_between_maps(target_row, others) > least).all())


def search_pairs(pair: ShapePair, target_row: Int[SearchRows, "m_s"]) -> Int[BodyVertices, "m_s 2"]:
    """Pair search vertices with their images under a map of them."""
    return BodyVertices(np.column_stack([pair.source_vertices, pair.target_vertices[target_row]]))


def prepare_pair(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    config: Config | None = None,
    seed: int = 0,
    timer: StageTimer | None = None,
) -> ShapePair:
    """Prepare what is not yet prepared, both at once; by default with the settings of what is. Errors as of `match`."""
    sides = [("source", source), ("target", target)]
    ready = [shape.requested for _, shape in sides if isinstance(shape, PreparedShape)]
    settings = config or next(iter(ready), Config())
    shares = [0.0, 0.0]

    def prepared(number: int) -> PreparedShape:
        side, shape = sides[number]

        def reach(stage: str, share: float) -> None:
            shares[number] = share
            if timer:
                timer.reach(f"prepare: {stage}", MATCHING["components"] * sum(shares) / 2)

        return _prepared(side, shape, settings, seed, reach)

    first, second = parallel_map(prepared, range(2))
    for (side, surface), shape in zip(sides, (first, second)):
        if timer and shape is not surface:
            timer.beside(side, {stage: spent for stage, spent in shape.timings.items() if stage != "total"})
    return ShapePair(first, second, settings)


def _prepared(
    side: str, shape: SurfaceLike | PreparedShape, config: Config, seed: int, progress: Progress
) -> PreparedShape:
    if isinstance(shape, PreparedShape):
        shape.require_prepared_for(config, side)
        return shape
    try:
        return prepare(shape, config, seed, progress=progress)
    except (MeshError, MemoryBudgetError, NotConvergedError) as error:
        raise type(error)(f"{side}: {error}") from error
