"""What is asked of a match: two prepared shapes, what is known of their map, and how maps are proposed and refined."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray, SearchRows
from isomatch._core.cached import cached_property
from isomatch._core.errors import MemoryBudgetError, MeshError, NotConvergedError, SettingError
from isomatch._core.stage_timer import MATCHING_SHARES, Progress, StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding, SignedPoints, SpectralPair, nearest_of_few
from isomatch.io import SurfaceLike
from isomatch.matching.coordinates import refined_images
from isomatch.matching.maps import Fit
from isomatch.matching.parameters import SCREENING
from isomatch.matching.priors import Priors
from isomatch.matching.proposals.extremities import extremity_assignments
from isomatch.matching.smooth_pair import SmoothPair
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, prepare

Start: TypeAlias = "Callable[[Problem], Iterable[IntArray]]"
"""Makes first maps of a problem: arrays (q, 2) of vertices of both bodies that may correspond, a few or all."""


class Refinement(ABC):
    """Makes a better map of one: subclass it, implement ``__call__``, and hand an instance to `match`.

    Several threads call it at once, so it keeps nothing between calls. A refinement takes part under every model, in the
    model selection and in the map returned. `check_refinement` tells whether it keeps the laws of one.

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
    """Whether parts are told from wholes, elastic maps sought, and runners-up of priors searched."""
    polishes: ClassVar[bool] = False
    """Whether the map of a large mesh is polished by joint coordinates on a finer level, and not only carried there."""
    in_rounds: ClassVar[bool] = False
    """Whether each model refines in rounds of its own, after each of which hopeless maps are given up."""
    smooth: ClassVar[bool] = False
    """Whether a smooth map is preferred to one that recognises every point."""

    @abstractmethod
    def __call__(self, problem: Problem, fit: Fit) -> Int[IntArray, "r"]:
        """Refine one map, ``fit.image``: vertices of the target's body for ``problem.refinement_vertices``.

        Return the same of the refined map; the model measures it. Of a part, the source of ``problem`` is the part.
        """

    def everywhere(self, problem: Problem, fit: Fit, coordinates: Callable[[], Embedding]) -> Embedding:
        """Coordinates of all vertices of both bodies in which images are nearest points; by default the model's."""
        return coordinates()


class Joint(Refinement):
    """Spectral upsampling joint with signatures, positions and normals, then registration.

    Each model does it in rounds; a call refines one map of complete shapes by all of them.

    Examples
    --------
    Twice the same:

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
            image, _ = refined_images(problem, image, fit.side, sizes, with_positions)
        return image


@dataclass(frozen=True, eq=False)
class Problem(SmoothPair):
    """What is asked of a match.

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
    priors : Priors
        What is known of the map; by default nothing.
    refinement : Refinement
        How maps are refined; by default jointly.
    starts : sequence of callable, optional
        Where first maps come from, beside priors; by default `default_starts`.
    relation : callable, optional
        Makes the model of the shapes, a `MatchingModel`, from the problem; by default each one that fits is tried.

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
        """The problem the other way round."""
        functions = None if self.functions is None else Embedding(*self.functions[::-1])
        ways = self.refinement, self.starts, self.relation
        return Problem(self.target, self.source, self.config, functions, self.priors.turned, *ways)

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
    def is_sided(self) -> bool:
        """Whether one orientation is wanted, of shapes that have one, and nothing else is known of the map."""
        config = self.config
        wanted = config.orientation != "any" and config.hypotheses == "all"
        return self.oriented and wanted and not self.priors.any

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
        return (
            min(sum(each.orientation >= 0 for each in own) for own in both)
            >= SCREENING.min_rotations_of_round
        )

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


def name_of(handed_in: object) -> str:
    """Name of a start or a relation: that of the function, without "starts_from_", or of the class."""
    function = getattr(handed_in, "func", handed_in)  # of a `functools.partial`
    return str(getattr(function, "__name__", type(function).__name__)).removeprefix("starts_from_")


def search_pairs(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Int[BodyVertices, "m_s 2"]:
    """Pair search vertices with their images under a map of them."""
    return BodyVertices(np.column_stack([pair.source_vertices, pair.target_vertices[target_row]]))


def prepare_pair(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    config: Config | None = None,
    seed: int = 0,
    timer: StageTimer | None = None,
) -> Problem:
    """Prepare what is not yet prepared, both at once; by default with the settings of what is. Errors as of `match`.

    Nothing is known of the map, and the refinement is joint, whatever the settings name: ``dataclasses.replace`` sets
    priors, refinement (one of `REFINEMENTS`, or your own), starts and relation.
    """
    sides = [("source", source), ("target", target)]
    ready = [shape.requested for _, shape in sides if isinstance(shape, PreparedShape)]
    settings = config or next(iter(ready), Config())
    shares = [0.0, 0.0]

    def prepared(number: int) -> PreparedShape:
        side, shape = sides[number]

        def reach(stage: str, share: float) -> None:
            shares[number] = share
            if timer:
                timer.reach(f"prepare: {stage}", MATCHING_SHARES["components"] * sum(shares) / 2)

        return _prepared(side, shape, settings, seed, reach)

    first, second = parallel_map(prepared, range(2))
    for (side, surface), shape in zip(sides, (first, second)):
        if timer and shape is not surface:
            timer.beside(side, {stage: spent for stage, spent in shape.timings.items() if stage != "total"})
    return Problem(first, second, settings)


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
