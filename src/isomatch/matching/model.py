"""A model: what is claimed of two shapes, and how maps under the claim are found, refined, scored and measured."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Generic, TypeVar

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int
from isomatch._core.cached import cached_property
from isomatch._core.errors import DescriptorError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding
from isomatch.descriptors import deviation_of
from isomatch.matching.assessment.evidence import Solution
from isomatch.matching.assessment.measured import Measured
from isomatch.matching.maps import Candidate, Fit
from isomatch.matching.priors import Priors
from isomatch.matching.problem import Problem, Refinement
from isomatch.matching.proposals.anchors import starts_from_anchors
from isomatch.matching.proposals.starts import default_starts, first_maps_of
from isomatch.matching.selection import Ranking, weighed
from isomatch.matching.verify import Verification, verifier_of
from isomatch.shapes import PreparedShape

M = TypeVar("M")  # a map on its way
F = TypeVar("F", bound=Fit)
C = TypeVar("C")  # coordinates, or what else images are read off


@dataclass(frozen=True, eq=False)
class Proposals(Generic[M]):
    """First maps of a model, begun so that they can be refined."""

    begun: Sequence[M]  # those that contend
    n_tried: int  # number of maps of which they are the best
    rivals: Sequence[M] = ()  # those that contend, but may not win
    eligible: tuple[Candidate, ...] = ()  # all candidates of complete shapes that may win, best first
    runners_up: tuple[Candidate, ...] = ()  # all that may not


@dataclass(frozen=True, eq=False)
class Match(Generic[M, C]):
    """What was found under a model, before it is summed up."""

    model: MatchingModel[M, C]
    proposals: Proposals[M]
    ranking: Ranking[M]

    @cached_property
    def coordinates(self) -> C:
        """What the images of the map selected are read off."""
        return self.model.coordinates(self.ranking.best)

    @cached_property
    def measured(self) -> Measured:
        """The map selected, measured."""
        return self.model.measure(self)


class MatchingModel(ABC, Generic[M, C]):
    """What is claimed of two shapes, and how maps under this claim are proposed, refined, ranked, measured and summed up.

    A model is built from a problem, and serves that alone; `match_under` calls its methods one after the other.
    """

    last_stage: ClassVar[str | None] = None
    """The stage in which coordinates are made, for the timings; None if it is the refinement."""

    way: ClassVar[str] = "isometry"
    """The row of `STRATEGIES` that claims the same, for the report."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.pair = problem  # in the direction of the maps: a part comes first

    @property
    def priors(self) -> Priors:
        """What is known of the map, in the direction asked for."""
        return self.problem.priors

    @property
    def source(self) -> PreparedShape:
        """The shape whose vertices are mapped."""
        return self.pair.source

    @property
    def target(self) -> PreparedShape:
        """The shape onto which they are mapped."""
        return self.pair.target

    @abstractmethod
    def propose(self, timer: StageTimer) -> Proposals[M]:
        """Search first maps, and begin those that contend."""

    @abstractmethod
    def refine(self, maps: Sequence[M]) -> list[M]:
        """Refine maps; those that are hopeless may be given up on the way."""

    @abstractmethod
    def rank(self, maps: list[M], rivals: list[M], proposals: Proposals[M], timer: StageTimer) -> Ranking[M]:
        """Select among refined maps, least cost first; ``rivals`` are ranked, but may not win."""

    @abstractmethod
    def cost(self, fit: M) -> float:
        """Return what a refined map costs among others of this model; lower is better."""

    @abstractmethod
    def image(self, best: M) -> Int[BodyVertices, "n_s"]:
        """Vertex of the target's body for each of the source's, −1 where it has none, without the last precision."""

    def verified(self, best: M) -> Verification:
        """Verify a map on the shapes as they are, see `verify`: what ties by rank is told apart by this cost."""
        return verifier_of(self.pair)(self.image(best))

    @abstractmethod
    def coordinates(self, best: M) -> C:
        """Make what images under a map are read off."""

    @abstractmethod
    def measure(self, match: Match[M, C]) -> Measured:
        """Read precise images off the coordinates, and measure the map."""

    @abstractmethod
    def sum_up(self, match: Match[M, C], measured: Measured, timer: StageTimer) -> Solution:
        """Sum up a measured map, with the evidence for it, expected errors and alternatives."""

    def complete(self, match: Match[M, C], solution: Solution, timer: StageTimer) -> Solution:
        """Do for a map that is returned what was left undone while other strategies were to be tried."""
        return solution

    def require_suitable(self) -> None:
        """Raise an `IsomatchError` unless the shapes, the priors and the settings suit the model."""
        self.require_priors()

    def require_sides(self) -> None:
        """Raise `SettingError` unless the shapes have an inside and an outside, which the map should preserve."""
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
        """Raise `DescriptorError` if descriptors were given: such ``shapes`` have no functions in common."""
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
        """Whether a part or an elastic map is searched by anchors: not if only other starts or priors lead to it."""
        # landmarks lead through anchors, in any case but where a whole map is given and nothing else may win
        starts, config, priors = self.problem.starts, self.pair.config, self.priors
        only_given = config.hypotheses == "given"
        if len(priors.landmarks) and not (
            only_given and (not priors.only_landmarks or config.start == "pose")
        ):
            return True
        return not only_given and (starts is None or starts_from_anchors in starts)

    def first_maps_handed_in(self) -> list[tuple[Int[BodyVertices, "_ 2"], str]]:
        """Collect the first maps of a user's starts, for a part or an elastic map; none if only priors may win."""
        starts = () if self.pair.config.hypotheses == "given" else self.problem.starts or ()
        return first_maps_of([start for start in starts if start not in default_starts], self.problem)


class RefiningModel(MatchingModel[F, C]):
    """A model whose maps are `Fit` objects, which the refinement of the problem makes better.

    Subclass `Isometry` to change a part of it, such as ``cost``.

    Examples
    --------
    An isometry whose maps cost their spectral residual alone, handed to `match` as
    ``relation=BySpectralResidual``:

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
        """Vertices of the source's body that a fit maps."""
        return self.pair.refinement_vertices

    def refine(self, fits: Sequence[F]) -> list[F]:
        """Refine maps by the refinement of the match; in rounds of the model, those that are hopeless are given up."""
        return self.refined(fits) if self.refinement.in_rounds else parallel_map(self._refined_by_user, fits)

    def refine_again(self, fit: F) -> F:
        """Refine a map that was refined and then moved."""
        return self.refined_again(fit) if self.refinement.in_rounds else self._refined_by_user(fit)

    def _refined_by_user(self, fit: F) -> F:
        """Refine a map by a refinement that knows nothing of the model, and measure it."""
        image = np.asarray(self.refinement(self.pair, fit))
        n_mapped, n_target = len(self.vertices), self.target.body.n_vertices
        expected = f"expected ({n_mapped},) vertices of a body of {n_target} vertices"
        if image.shape != (n_mapped,) or image.dtype.kind not in "iu":
            raise self._refused(f"gave images of shape {image.shape} and type {image.dtype}; {expected}")
        if image.min() < 0 or image.max() >= n_target:
            raise self._refused(f"gave images from {image.min()} to {image.max()}; {expected}")
        return self.measured(fit, BodyVertices(image))

    def _refused(self, how: str) -> SettingError:
        return SettingError(f"the refinement {type(self.refinement).__name__} {how}")

    def everywhere(self, fit: F) -> Embedding:
        """Coordinates of all vertices by the refinement of the match; `SettingError` if they are of other vertices."""
        embedding = Embedding(*self.refinement.everywhere(self.pair, fit, partial(self.embedding, fit)))
        sizes = self.source.body.n_vertices, self.target.body.n_vertices
        shapes = tuple(np.shape(points) for points in embedding)
        if [shape[:1] for shape in shapes] != [(size,) for size in sizes] or shapes[0][1:] != shapes[1][1:]:
            raise self._refused(
                f"gave coordinates of shapes {shapes[0]} and {shapes[1]}; expected one row for each of {sizes[0]} and "
                f"{sizes[1]} vertices, in the same columns"
            )
        return embedding

    def descriptor_distance(self, fit: F) -> Float[FloatArray, "r"]:
        """Descriptor distance in space of the vertices and their images, see `BallSignature`; nan where unknown."""
        here, there = self.source.balls, self.target.balls
        if here is None or there is None:
            return np.full(len(self.vertices), np.nan)
        return here.at(self.vertices).descriptor_distance(there.at(fit.image), self._deviation)

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(*(shape.balls for shape in (self.source, self.target) if shape.balls))

    def weighed(self, fits: Sequence[F], costs: Sequence[float], eligible: Sequence[bool]) -> list[float]:
        """Weigh the costs of maps by their descriptor distance where they differ, see `weighed`."""
        if not self.descriptor_weight:
            return list(costs)
        distances, weight = parallel_map(self.descriptor_distance, fits), self.descriptor_weight
        images = [fit.image for fit in fits]
        return weighed(costs, images, distances, self.target.distance, eligible, weight)

    @property
    def descriptor_weight(self) -> float:
        """How much the descriptor distance weighs in the ratio of two costs, see `weighed`."""
        return self.pair.config.selection.descriptor_weight

    @abstractmethod
    def refined(self, fits: Sequence[F]) -> list[F]:
        """Refine maps as isomatch does: by joint coordinates of functions, signatures, positions and normals."""

    def refined_again(self, fit: F) -> F:
        """Refine a map that was refined and then moved."""
        return self.refined([fit])[0]

    @abstractmethod
    def measured(self, fit: F, image: Int[BodyVertices, "r"]) -> F:
        """Measure the map that a fit has become: spectral residual and score of the images."""

    @abstractmethod
    def embedding(self, fit: F) -> Embedding:
        """Coordinates of all vertices of both bodies in which images under a map are nearest points."""


def origin_of(problem: Problem, winner: Fit) -> str:
    """Where a map came from: the initial map, if it agrees with that."""
    agrees = winner.prior_error <= problem.config.outcome.contradiction
    return "initial map" if len(problem.priors.initial_pairs) and agrees else winner.origin
