"""A model claims how two shapes are related, and finds and measures maps under this claim."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import ClassVar, Generic, TypeVar

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int
from isomatch._core.cached import cached_property
from isomatch._core.errors import DescriptorError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding
from isomatch.descriptors import BallSignature, deviation_of
from isomatch.matching.assessment.evidence import Measured, Solution
from isomatch.matching.coordinates import SmoothPair
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.priors import Priors
from isomatch.matching.problem import Problem, Refinement
from isomatch.matching.proposals.starts import default_starts, first_maps_of, starts_from_anchors
from isomatch.matching.selection import Ranking, weigh_costs
from isomatch.matching.verify import Verification, verifier_of
from isomatch.shapes import PreparedShape

M = TypeVar("M")  # a map that is being refined
F = TypeVar("F", bound=Fit)
C = TypeVar("C")  # coordinates, or a bent shape, from which the images of a map are computed


@dataclass(frozen=True, eq=False)
class Proposals(Generic[M]):
    """First maps of a model, ready to be refined."""

    contenders: Sequence[M]  # maps that may win
    n_tried: int  # number of maps from which contenders and rivals were selected
    rivals: Sequence[M] = ()  # maps that are refined for comparison, and may not win
    eligible: tuple[Candidate, ...] = ()  # all candidates of complete shapes that may win, best first
    runners_up: tuple[Candidate, ...] = ()  # all candidates that may not win, best first


@dataclass(frozen=True, eq=False)
class Match(Generic[M, C]):
    """The result of a search under a model, before it is summed up."""

    model: MatchingModel[M, C]
    proposals: Proposals[M]
    ranking: Ranking[M]

    @cached_property
    def coordinates(self) -> C:
        """Coordinates, or a bent shape, from which the images of the selected map are computed."""
        return self.model.coordinates(self.ranking.best)

    @cached_property
    def polished(self) -> tuple[SmoothPair, C]:
        """The finest level of both shapes, and the coordinates of the selected map there."""
        return self.model.polish(self)

    @cached_property
    def measured(self) -> Measured:
        """The selected map with its measures."""
        return self.model.measure(self)


class MatchingModel(ABC, Generic[M, C]):
    """A claim about two shapes, and the steps of a match under this claim.

    A model is built from one problem and serves only that; `match_under` calls its methods one after the other.
    """

    last_stage: ClassVar[str | None] = None
    """Stage in which coordinates are computed, for the timings; None if it is the refinement."""

    way: ClassVar[str] = "isometry"
    """Name of the strategy in `STRATEGIES` that makes the same claim, for the report."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.pair = problem  # the problem in the direction of the model's maps, in which a part is the source

    @property
    def priors(self) -> Priors:
        """The user's priors, in the direction of the problem."""
        return self.problem.priors

    @property
    def source(self) -> PreparedShape:
        """The shape whose vertices are mapped."""
        return self.pair.source

    @property
    def target(self) -> PreparedShape:
        """The shape onto which vertices are mapped."""
        return self.pair.target

    @abstractmethod
    def propose(self, timer: StageTimer) -> Proposals[M]:
        """Search first maps, and prepare the best for refinement."""

    @abstractmethod
    def refine(self, maps: Sequence[M]) -> list[M]:
        """Refine maps; hopeless maps may be dropped."""

    @abstractmethod
    def rank(self, maps: list[M], rivals: list[M], proposals: Proposals[M], timer: StageTimer) -> Ranking[M]:
        """Rank refined maps by cost; ``rivals`` are ranked, but may not win."""

    @abstractmethod
    def cost(self, fit: M) -> float:
        """Cost of a refined map, compared with others of this model; lower is better."""

    @abstractmethod
    def image(self, best: M) -> Int[BodyVertices, "n_s"]:
        """Approximate image of each vertex of the source's body, or −1."""

    def verified(self, best: M) -> Verification:
        """Verify a map, see `verify`; this cost decides between maps that tie."""
        return verifier_of(self.pair)(self.image(best))

    @abstractmethod
    def coordinates(self, best: M) -> C:
        """Compute coordinates, or bend a shape, to find the precise images under a map."""

    def polish(self, match: Match[M, C]) -> tuple[SmoothPair, C]:
        """Compute the coordinates of a map on a finer level; by default, those of the bodies."""
        return self.pair, match.coordinates

    @abstractmethod
    def measure(self, match: Match[M, C]) -> Measured:
        """Compute precise images from the coordinates, and measure the map."""

    @abstractmethod
    def sum_up(self, match: Match[M, C], measured: Measured, timer: StageTimer) -> Solution:
        """Sum up a measured map, with the evidence for it, expected errors and alternatives."""

    def complete(
        self, match: Match[M, C], measured: Measured, solution: Solution, timer: StageTimer
    ) -> Solution:
        """Do for the returned map what ``sum_up`` omits while strategies are tried."""
        return solution

    def require_suitable(self) -> None:
        """Raise an `IsomatchError` unless shapes, priors and settings suit the model."""
        self.require_priors()

    def require_sides(self) -> None:
        """Raise `SettingError` unless shapes have an inside, and the orientation is kept."""
        name, orientation = type(self).__name__, self.pair.config.orientation
        if not self.pair.oriented:
            raise SettingError(
                f"relation = {name}, but a shape is a graph or a point cloud, which has no inside to tell maps by; give "
                "meshes, or leave the relation out"
            )
        if orientation != "preserve":
            raise SettingError(
                f"relation = {name}, but orientation = {orientation!r}, and this relation finds only maps that preserve "
                "it; turn the faces of one shape inside out (faces[:, ::-1]) and leave orientation at 'preserve'"
            )

    def require_no_descriptors(self, shapes: str) -> None:
        """Raise `DescriptorError` if there are descriptors: ``shapes`` share no functions."""
        if self.priors.has_functions:
            raise DescriptorError(
                f"initial descriptors were given, but relation = {type(self).__name__} cannot use them: {shapes} cannot "
                "be aligned by functions; give landmarks or an initial map instead, or leave the relation out"
            )

    def require_priors(self) -> None:
        """Raise `SettingError` if only maps from priors may win, and there are none."""
        config = self.pair.config
        if config.hypotheses == "given" and not self.priors.any and config.start == "auto":
            raise SettingError(
                "hypotheses = 'given', but no landmarks, initial map or descriptors were given"
            )

    @property
    def searches_by_anchors(self) -> bool:
        """Whether a part or elastic map is searched by anchors, not only other starts or priors."""
        starts, config, priors = self.problem.starts, self.pair.config, self.priors
        only_given = config.hypotheses == "given"
        # landmarks are anchors, unless only given maps may win and a map of the whole shape is among them
        whole_map_given = not priors.only_landmarks or config.start == "pose"
        if len(priors.landmarks) and not (only_given and whole_map_given):
            return True
        return not only_given and (starts is None or starts_from_anchors in starts)

    def first_maps_handed_in(self) -> list[tuple[Int[BodyVertices, "_ 2"], str]]:
        """First maps of the user's starts, or none if only priors may win."""
        starts = () if self.pair.config.hypotheses == "given" else self.problem.starts or ()
        return first_maps_of([start for start in starts if start not in default_starts], self.problem)


class RefiningModel(MatchingModel[F, C]):
    """A model whose maps are `Fit` objects, refined by the refinement of the problem.

    Subclass `Isometry` to change a part of it, such as ``cost``.

    Examples
    --------
    An isometry whose cost is the spectral residual, used by ``match(…, relation=BySpectralResidual)``:

    >>> from isomatch.matching import Isometry
    >>> class BySpectralResidual(Isometry):
    ...     def cost(self, fit):
    ...         return fit.spectral_residual
    >>> issubclass(BySpectralResidual, MatchingModel)
    True
    """

    @property
    def refinement(self) -> Refinement:
        """The refinement of the match."""
        return self.problem.refinement

    @property
    def vertices(self) -> Int[BodyVertices, "r"]:
        """Vertices of the source's body whose images make a fit."""
        return self.pair.refinement_vertices

    def refine(self, fits: Sequence[F]) -> list[F]:
        """Refine maps by the refinement of the match, in rounds if it asks for these."""
        if self.refinement.in_rounds:
            return self.refine_jointly(fits)
        return parallel_map(self._refine_by_user, fits)

    def _refine_by_user(self, fit: F) -> F:
        """Refine a map by a refinement that ignores the model, and check and measure the result."""
        image = np.asarray(self.refinement(self.pair, fit))
        n_mapped, n_target = len(self.vertices), self.target.body.n_vertices
        expected = f"expected ({n_mapped},) vertices of a body of {n_target} vertices"
        if image.shape != (n_mapped,) or image.dtype.kind not in "iu":
            raise self._refusal(f"gave images of shape {image.shape} and type {image.dtype}; {expected}")
        if image.min() < 0 or image.max() >= n_target:
            raise self._refusal(f"gave images from {image.min()} to {image.max()}; {expected}")
        return self.measure_fit(fit, BodyVertices(image))

    def _refusal(self, how: str) -> SettingError:
        return SettingError(f"the refinement {type(self.refinement).__name__} {how}")

    def everywhere(self, fit: F, coordinates: Callable[[F], Embedding] | None = None) -> Embedding:
        """Coordinates of all vertices by the refinement; `SettingError` if arrays have wrong shapes.

        Unless the refinement has its own, they are ``coordinates`` of the fit, by default its `embedding`.
        """
        given = partial(coordinates or self.embedding, fit)
        embedding = Embedding(*self.refinement.everywhere(self.pair, fit, given))
        sizes = self.source.body.n_vertices, self.target.body.n_vertices
        shapes = tuple(np.shape(points) for points in embedding)
        if [shape[:1] for shape in shapes] != [(size,) for size in sizes] or shapes[0][1:] != shapes[1][1:]:
            raise self._refusal(
                f"gave coordinates of shapes {shapes[0]} and {shapes[1]}; expected one row for each of {sizes[0]} and "
                f"{sizes[1]} vertices, in the same columns"
            )
        return embedding

    def descriptor_distance(self, fit: F) -> Float[FloatArray, "r"]:
        """Descriptor distance of each mapped vertex and its image; nan where unknown."""
        of_source, of_target = self.balls
        if of_source is None or of_target is None:
            return np.full(len(self.vertices), np.nan)
        return of_source.at(self.vertices).descriptor_distance(of_target.at(fit.image), self._deviation)

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(*(balls for balls in self.balls if balls))

    @cached_property
    def balls(self) -> tuple[BallSignature | None, BallSignature | None]:
        """Ball signatures of source and target, computed side by side."""
        of_source, of_target = parallel_map(attrgetter("balls"), (self.source, self.target))
        return of_source, of_target

    def weigh(self, fits: Sequence[F], costs: Sequence[float], eligible: Sequence[bool]) -> list[float]:
        """Weigh costs by descriptor distances where maps differ, see ``weigh_costs``."""
        if not self.descriptor_weight:
            return list(costs)
        distances, weight = parallel_map(self.descriptor_distance, fits), self.descriptor_weight
        images = [fit.image for fit in fits]
        return weigh_costs(costs, images, distances, self.target.distance, eligible, weight)

    @property
    def descriptor_weight(self) -> float:
        """Weight of the descriptor distance in the ratio of two costs, see ``weigh_costs``."""
        return self.pair.config.selection.descriptor_weight

    @abstractmethod
    def refine_jointly(self, fits: Sequence[F]) -> list[F]:
        """Refine maps by joint coordinates: functions, signatures, positions and normals."""

    @abstractmethod
    def measure_fit(self, fit: F, image: Int[BodyVertices, "r"]) -> F:
        """Replace the images of a fit; measure spectral residual and score."""

    @abstractmethod
    def embedding(self, fit: F) -> Embedding:
        """Coordinates of all vertices of both bodies in which images are nearest points."""


def origin_of(problem: Problem, winner: Fit) -> str:
    """Origin of a map: "initial map" if the map agrees with the user's initial map."""
    agrees = winner.prior_error <= problem.config.outcome.contradiction
    return "initial map" if len(problem.priors.initial_pairs) and agrees else winner.origin
