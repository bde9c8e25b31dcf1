"""The problem of a match: two shapes, priors, and how maps are proposed and refined."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeAlias

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray, SearchRows
from isomatch._core.cached import cached_property
from isomatch._core.errors import MemoryBudgetError, MeshError, NotConvergedError, SettingError
from isomatch._core.stage_timer import MATCHING_SHARES, StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding, SignedPoints, SpectralPair, nearest_of_few
from isomatch.io import SurfaceLike
from isomatch.matching.coordinates import SmoothPair, refine_images
from isomatch.matching.maps import Fit
from isomatch.matching.parameters import SCREENING
from isomatch.matching.priors import Priors
from isomatch.matching.proposals.extremities import extremity_assignments
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, prepare

Start: TypeAlias = "Callable[[Problem], Iterable[IntArray]]"
"""Proposes first maps of a problem: arrays (q, 2) of vertices of both bodies."""


class Refinement(ABC):
    """Improves a map: subclass it, implement ``__call__``, and hand an instance to `match`.

    Several threads call it at once, so it must not keep anything between calls. Every model refines its maps with it,
    before one is selected. `check_refinement` checks that it keeps the laws of a refinement.

    Examples
    --------
    One step of spectral upsampling:

    >>> class Upsampled(Refinement):
    ...     def __call__(self, problem, fit):
    ...         return problem.spectra.image(problem.spectra.fit_and_upsample(fit.image, (20, 40)))
    >>> Upsampled().searches_further
    True
    """

    searches_further: ClassVar[bool] = True
    """Whether maps of parts, elastic maps, and alternatives to priors are searched, too."""
    polishes: ClassVar[bool] = False
    """Whether the map of a large mesh is refined by joint coordinates on a finer level."""
    in_rounds: ClassVar[bool] = False
    """Whether each model refines in its own rounds, and drops hopeless maps after each."""
    smooth: ClassVar[bool] = False
    """Whether a smooth map is preferred to one that matches every detail."""

    @abstractmethod
    def __call__(self, problem: Problem, fit: Fit) -> Int[IntArray, "r"]:
        """Refine ``fit.image``: target vertices for ``problem.refinement_vertices``.

        Return the refined images; the model measures them. In a match of a part, the source of ``problem`` is the part.
        """

    def everywhere(self, problem: Problem, fit: Fit, coordinates: Callable[[], Embedding]) -> Embedding:
        """Coordinates of all vertices in which images are nearest points."""
        return coordinates()


class Joint(Refinement):
    """Spectral upsampling joint with signatures, positions and normals, then registration.

    Each model runs it in rounds; a call refines one map of complete shapes by all rounds.

    Examples
    --------
    A refinement that runs it twice:

    >>> class Twice(Refinement):
    ...     def __call__(self, problem, fit):
    ...         return Joint()(problem, replace(fit, image=Joint()(problem, fit)))
    >>> from dataclasses import replace
    >>> from isomatch.matching import check_refinement
    >>> check_refinement(Twice())
    """

    polishes: ClassVar[bool] = True
    in_rounds: ClassVar[bool] = True

    def __call__(self, problem: Problem, fit: Fit) -> Int[BodyVertices, "r"]:
        """Refine one map."""
        image = fit.image
        for sizes, with_positions in problem.config.refining.rounds:
            image, _ = refine_images(problem, image, fit.side, sizes, with_positions)
        return image


@dataclass(frozen=True, eq=False)
class Problem(SmoothPair):
    """Two shapes to be matched, with priors, settings, refinement and starts.

    A *row* numbers the search vertices of a shape, a *vertex* the vertices of its body. In shapes of arrays,
    ``m_s`` and ``m_t`` count the search vertices of source and target, ``n_s`` and ``n_t`` the vertices of their bodies,
    ``n_source`` and ``n_target`` the user's vertices, and ``r`` the vertices that a refinement maps.

    Parameters
    ----------
    source, target : PreparedShape
    config : Config
        The settings of the match.
    functions : Embedding, optional
        Known functions, of mean 0 and variance 1: values at the user's vertices, (n_source, q) and (n_target, q).
    priors : Priors
        What the user knows of the map; by default nothing.
    refinement : Refinement
        Refines maps; by default `Joint`.
    starts : sequence of callable, optional
        Propose first maps, besides priors; by default `default_starts`.
    relation : callable, optional
        Builds the `MatchingModel` of the problem; by default every model that suits the shapes is tried.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> from isomatch.matching import prepare_pair
    >>> problem = prepare_pair(*(animal.mesh for animal in example_pair()))
    >>> problem.priors.any, problem.refinement.smooth
    (False, False)
    """

    source: PreparedShape
    target: PreparedShape
    priors: Priors = field(default_factory=Priors)
    refinement: Refinement = field(default_factory=Joint)
    starts: Sequence[Start] | None = None
    relation: Callable[[Problem], object] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.refinement, Refinement):
            raise SettingError(
                f"refinement = {self.refinement!r} is no Refinement; give an instance of a subclass"
            )
        if not (self.relation is None or callable(self.relation)):
            raise SettingError(
                f"relation is an object of type {type(self.relation).__name__}; give what builds a model of the problem, "
                "such as the class itself: relation=Isometry"
            )
        if callable(self.starts):
            raise SettingError(f"starts = {name_of(self.starts)} is one start; give a list of them")
        if self.starts is not None:
            object.__setattr__(self, "starts", tuple(self.starts))
            if not all(map(callable, self.starts)):
                raise SettingError("starts hold something that cannot be called with a pair of shapes")

    @property
    def turned(self) -> Problem:
        """The problem with source and target exchanged, and with their roles in ``config.part``."""
        functions = None if self.functions is None else Embedding(*self.functions[::-1])
        config, priors, source = self.config, self.priors.turned, self.target
        if config.part in ("source", "target"):
            config = replace(config, part="target" if config.part == "source" else "source")
        return replace(
            self, source=source, target=self.source, config=config, functions=functions, priors=priors
        )

    @property
    def has_finer(self) -> bool:
        """Whether either shape has a finer level on which maps are polished."""
        return self.source.finer is not None or self.target.finer is not None

    @cached_property
    def polishable(self) -> SmoothPair:
        """The shapes at the levels on which maps are polished."""
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
        """First columns of the distance descriptors of both shapes at the search vertices."""
        source, target, rank = self.source.points, self.target.points, self.config.search.rank
        return source.at(self.source_vertices, rank), target.at(self.target_vertices, rank)

    @cached_property
    def search_signatures(self) -> Embedding:
        """The signatures at the search vertices."""
        source, target = self.signatures
        return Embedding(source[self.source_vertices], target[self.target_vertices])

    @cached_property
    def search_spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases of both shapes, for maps between search vertices."""
        source = self.source.sampled_basis(self.source.config.n_search)
        return SpectralPair(source, self.target.laplace.vectors[self.target_vertices], nearest_of_few)

    @property
    def is_sided(self) -> bool:
        """Whether the map must have one orientation, and no priors are known."""
        config = self.config
        wanted = config.orientation != "any" and config.hypotheses == "all"
        return self.oriented and wanted and not self.priors.any

    @property
    def allows_elastic(self) -> bool:
        """Whether an elastic map is sought if no isometry fits."""
        preserves = self.oriented and self.config.orientation == "preserve"
        searches = self.refinement.searches_further and self.config.hypotheses == "all"
        return preserves and searches and self.relation is None and not self.priors.has_functions

    @property
    def both_open(self) -> bool:
        """Whether both shapes have a long boundary, as patches and tubes have."""
        least = self.config.parts.long_boundary
        return min(self.source.longest_boundary, self.target.longest_boundary) > least

    @cached_property
    def extremity_assignments(self) -> list[Int[BodyVertices, "q 2"]]:
        """Assignments of extremal points of the shapes, see `extremity_assignments`."""
        return extremity_assignments(self.source, self.target, self.config.search)

    @property
    def limbless(self) -> bool:
        """Whether a shape has too few extremities for a map, or both have a long boundary."""
        return self.both_open or not self.extremity_assignments

    @property
    def sideless(self) -> bool:
        """Whether the target has symmetries but no inside, so rotations look like mirror images."""
        return bool(self.target.symmetries) and self.target.one_sided

    @property
    def round(self) -> bool:
        """Whether both shapes seem to have a continuous group of rotations, like a ball."""
        symmetries = self.source.symmetries, self.target.symmetries
        n_rotations = [sum(symmetry.orientation >= 0 for symmetry in group) for group in symmetries]
        return min(n_rotations) >= SCREENING.min_rotations_of_round

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what was repaired or left out of either shape."""
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
        """Mean geodesic distance between images of a map and of each other map, in √area."""
        if not others:
            return np.zeros(0)
        return np.asarray(self._target_row_distances[np.array(others), target_row].mean(axis=1))

    def inverted(self, target_row: Int[SearchRows, "m_s"]) -> Int[SearchRows, "m_t"]:
        """Invert a map: for each target search vertex, find the row with the nearest image."""
        return SearchRows(self._target_row_distances[:, target_row].argmin(axis=1))

    def differs(
        self, target_row: Int[SearchRows, "m_s"], others: Sequence[Int[SearchRows, "m_s"]], least: float
    ) -> bool:
        """Whether a map differs from each of others by more than a mean distance, in √area."""
        return bool((self.distances_between_maps(target_row, others) > least).all())


def name_of(handed_in: object) -> str:
    """Name of a start or relation: its class, or its function without "starts_from_"."""
    function = getattr(handed_in, "func", handed_in)  # what a `functools.partial` calls
    return str(getattr(function, "__name__", type(function).__name__)).removeprefix("starts_from_")


def target_rows_near(problem: Problem, vertices: Int[BodyVertices, "q"]) -> Int[SearchRows, "q"]:
    """Find the row of the target's search vertex that is nearest to each target vertex."""
    return SearchRows(problem.target.distances.between(problem.target_vertices, vertices).argmin(axis=0))


def search_pairs(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Int[BodyVertices, "m_s 2"]:
    """Pair each search vertex of the source with its image under a map."""
    return BodyVertices(np.column_stack([pair.source_vertices, pair.target_vertices[target_row]]))


def prepare_pair(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    config: Config | None = None,
    seed: int = 0,
    timer: StageTimer | None = None,
) -> Problem:
    """Prepare two shapes in parallel, unless they are prepared. Errors as of `match`.

    By default, a prepared shape decides the settings. The problem has no priors and refines by `Joint`, whatever the
    settings name; ``dataclasses.replace`` sets priors, refinement, starts and relation.
    """
    sides = [("source", source), ("target", target)]
    settings_of_prepared = [shape.requested for _, shape in sides if isinstance(shape, PreparedShape)]
    settings = config or next(iter(settings_of_prepared), Config())
    shares = [0.0, 0.0]

    def prepare_side(number: int) -> PreparedShape:
        side, shape = sides[number]

        def report(stage: str, share: float) -> None:
            shares[number] = share
            if timer:
                timer.reach(f"prepare: {stage}", MATCHING_SHARES["components"] * sum(shares) / 2)

        if isinstance(shape, PreparedShape):
            shape.require_prepared_for(settings, side)
            return shape
        try:
            return prepare(shape, settings, seed, progress=report)
        except (MeshError, MemoryBudgetError, NotConvergedError) as error:
            raise type(error)(f"{side}: {error}") from error

    first, second = parallel_map(prepare_side, range(2))
    for (side, surface), shape in zip(sides, (first, second)):
        if timer and shape is not surface:
            timer.beside(side, {stage: spent for stage, spent in shape.timings.items() if stage != "total"})
    return Problem(first, second, settings)
