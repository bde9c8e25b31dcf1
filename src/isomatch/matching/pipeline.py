"""The stages of a match that anyone can replace: starts, a relation, a refinement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import DescriptorError, SettingError
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import parallel_map
from isomatch.correspondence import Embedding, SpectralPair
from isomatch.descriptors import deviation_of
from isomatch.matching.assessment.evidence import Solution
from isomatch.matching.maps import Fit
from isomatch.matching.problem import ShapePair
from isomatch.matching.proposals.anchors import starts_from_anchors
from isomatch.matching.proposals.priors import Priors
from isomatch.matching.proposals.starts import Start, default_starts, first_maps_of, name_of
from isomatch.matching.selection import weighed
from isomatch.shapes import PreparedShape


class Refinement(ABC):
    """Makes a better map of one: subclass it, implement ``__call__``, and hand an instance to `match`.

    Several threads call it at once, so it keeps nothing between calls. A refinement takes part in every relation, in
    the model selection and in the map returned. `check_refinement` tells whether it keeps the laws of one.

    Examples
    --------
    One step of spectral upsampling:

    >>> class Upsampled(Refinement):
    ...     def __call__(self, relation, fit):
    ...         spectra = relation.spectra
    ...         return relation.measured(fit, spectra.image(spectra.grown(fit.image, (20, 40))))
    >>> Upsampled().searches_further
    True
    """

    searches_further: ClassVar[bool] = True
    """Whether parts are told from wholes, elastic maps sought, and runners-up of priors searched."""
    polishes: ClassVar[bool] = False
    """Whether the map of a large mesh is polished by joint coordinates on a finer level, and not only carried there."""

    @abstractmethod
    def __call__(self, relation: Relation, fit: Fit) -> Fit:
        """Refine one map: ``fit.image``, vertices of the target's body for ``relation.vertices``.

        Return ``relation.measured(fit, image)``.
        """

    def refine_and_select(self, relation: Relation, fits: Sequence[Fit]) -> list[Fit]:
        """Refine several maps; those that are hopeless may be given up on the way."""
        return parallel_map(lambda fit: self(relation, fit), fits)

    def again(self, relation: Relation, fit: Fit) -> Fit:
        """Refine a map that was refined and then moved."""
        return self(relation, fit)

    def everywhere(self, relation: Relation, fit: Fit) -> Embedding:
        """Coordinates of all vertices of both bodies in which images are nearest points; not asked for of a part."""
        return relation.embedding(fit)

    @property
    def smooth(self) -> bool:
        """Whether a smooth map is preferred to one that recognises every point."""
        return False


class Relation(ABC):
    """What is assumed of two shapes, and how a map under this assumption is found, measured and verified.

    `on` binds a relation to a pair. Subclass `Isometry` to change a part of it, such as ``score``.

    Examples
    --------
    An isometry whose maps are scored by their spectral residual alone, handed to `match` as
    ``relation=BySpectralResidual()``:

    >>> from isomatch.matching import Isometry
    >>> class BySpectralResidual(Isometry):
    ...     def score(self, fit):
    ...         return fit.spectral_residual
    >>> isinstance(BySpectralResidual(), Relation)
    True
    """

    way: ClassVar[str] = "isometry"
    """The row of `WAYS` that claims the same, for the report."""

    pair: ShapePair
    priors: Priors
    stages: Stages
    _claim: Self | None = None  # what was bound; None if nothing was

    def on(self, pair: ShapePair, priors: Priors, stages: Stages | None = None) -> Self:
        """Return the relation between the shapes of a pair, of which something may be known."""
        claim = self if self._claim is None else self._claim  # without what was computed for another pair
        bound = copy(claim)
        bound._claim = claim
        bound.pair, bound.priors, bound.stages = pair, priors, Stages() if stages is None else stages
        return bound

    @property
    def refinement(self) -> Refinement:
        """The refinement of the match."""
        return self.stages.refinement

    @property
    def source(self) -> PreparedShape:
        """The shape whose vertices are mapped."""
        return self.pair.source

    @property
    def target(self) -> PreparedShape:
        """The shape onto which they are mapped."""
        return self.pair.target

    @property
    def vertices(self) -> Int[BodyVertices, "r"]:
        """Vertices of the source's body that a fit maps."""
        return self.pair.refinement_vertices

    @property
    def spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases, for maps from these vertices to all vertices of the target's body."""
        return self.pair.spectra

    def refine_and_select(self, fits: Sequence[Fit]) -> list[Fit]:
        """Refine maps by the refinement of the match; `SettingError` if it gives none, or one that was not measured."""
        if not fits:
            return []
        refined = self.refinement.refine_and_select(self, fits)
        if not refined:
            raise self._refused(f"gave up all of {len(fits)} maps; keep the best one")
        for fit in refined:
            self.require_measured(fit, type(fits[0]))
        return refined

    def require_measured(self, fit: object, kind: type[Fit]) -> None:
        """Raise `SettingError` unless a refinement gave a fit that the relation has measured."""
        if not isinstance(fit, kind) or not fit.is_measured:
            what = "a map" if isinstance(fit, Fit) else f"an object of type {type(fit).__name__}"
            how = "return relation.measured(fit, image)"
            raise self._refused(f"gave {what} that this relation has not measured; {how}")

    def _refused(self, how: str) -> SettingError:
        return SettingError(f"the refinement {type(self.refinement).__name__} {how}")

    def everywhere(self, fit: Fit) -> Embedding:
        """Coordinates of all vertices by the refinement of the match; `SettingError` if they are of other vertices."""
        embedding = Embedding(*self.refinement.everywhere(self, fit))
        sizes = self.source.body.n_vertices, self.target.body.n_vertices
        shapes = tuple(np.shape(points) for points in embedding)
        if [shape[:1] for shape in shapes] != [(size,) for size in sizes] or shapes[0][1:] != shapes[1][1:]:
            raise self._refused(
                f"gave coordinates of shapes {shapes[0]} and {shapes[1]}; expected one row for each of {sizes[0]} and "
                f"{sizes[1]} vertices, in the same columns"
            )
        return embedding

    def require_images(self, image: IntArray) -> None:
        """Raise `SettingError` unless an array holds a vertex of the target's body for each vertex that is mapped."""
        image, n_mapped, n_target = np.asarray(image), len(self.vertices), self.target.body.n_vertices
        expected = f"expected ({n_mapped},) vertices of a body of {n_target} vertices"
        if image.shape != (n_mapped,) or image.dtype.kind not in "iu":
            raise self._refused(f"gave images of shape {image.shape} and type {image.dtype}; {expected}")
        if image.min() < 0 or image.max() >= n_target:
            raise self._refused(f"gave images from {image.min()} to {image.max()}; {expected}")

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
        if self.priors.functions[0].shape[1]:
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
        starts, config, priors = self.stages.starts, self.pair.config, self.priors
        only_given = config.hypotheses == "given"
        if len(priors.landmarks) and not (
            only_given and (not priors.only_landmarks or config.start == "pose")
        ):
            return True
        return not only_given and (starts is None or starts_from_anchors in starts)

    def first_maps_handed_in(self) -> list[tuple[Int[BodyVertices, "_ 2"], str]]:
        """Collect the first maps of a user's starts, for a part or an elastic map; none if only priors may win."""
        starts = () if self.pair.config.hypotheses == "given" else self.stages.starts or ()
        return first_maps_of([start for start in starts if start not in default_starts], self.pair)

    def origin_of(self, winner: Fit) -> str:
        """Where a map came from: the initial map, if it agrees with that."""
        agrees = winner.prior_error <= self.pair.config.outcome.contradiction
        return "initial map" if len(self.priors.initial_pairs) and agrees else winner.origin

    def descriptor_distance(self, fit: Fit) -> Float[FloatArray, "r"]:
        """Descriptor distance in space of the vertices and their images, see `BallSignature`; nan where unknown."""
        here, there = self.source.balls, self.target.balls
        if here is None or there is None:
            return np.full(len(self.vertices), np.nan)
        return here.at(self.vertices).descriptor_distance(there.at(fit.image), self._deviation)

    @cached_property
    def _deviation(self) -> FloatArray:
        return deviation_of(*(shape.balls for shape in (self.source, self.target) if shape.balls))

    def weighed(self, fits: Sequence[Fit], costs: Sequence[float], eligible: Sequence[bool]) -> list[float]:
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
    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Refine maps as isomatch does: by joint coordinates of functions, signatures, positions and normals."""

    def refined_again(self, fit: Fit) -> Fit:
        """Refine a map that was refined and then moved."""
        return self.refined([fit])[0]

    @abstractmethod
    def measured(self, fit: Fit, image: Int[IntArray, "r"]) -> Fit:
        """Measure the map that a fit has become: spectral residual and score of the images."""

    @abstractmethod
    def embedding(self, fit: Fit) -> Embedding:
        """Coordinates of all vertices of both bodies in which images under a map are nearest points."""

    @abstractmethod
    def solution(self, timer: StageTimer) -> Solution:
        """Find the map, and the evidence for it."""


class Joint(Refinement):
    """Spectral upsampling joint with signatures, positions and normals, then registration.

    Examples
    --------
    One that takes its last steps twice:

    >>> class Twice(Joint):
    ...     def refine_and_select(self, relation, fits):
    ...         return [self.again(relation, fit) for fit in super().refine_and_select(relation, fits)]
    >>> from isomatch.matching import check_refinement
    >>> check_refinement(Twice())
    """

    polishes: ClassVar[bool] = True

    def __call__(self, relation: Relation, fit: Fit) -> Fit:
        """Refine one map."""
        return relation.refined([fit])[0]

    def refine_and_select(self, relation: Relation, fits: Sequence[Fit]) -> list[Fit]:
        """Refine several maps in stages, after each of which hopeless ones are given up."""
        return relation.refined(fits)

    def again(self, relation: Relation, fit: Fit) -> Fit:
        """Take the last steps once more."""
        return relation.refined_again(fit)


@dataclass(frozen=True)
class Stages:
    """The stages of a match: a refinement, starts (by default `default_starts`), a relation (by default any that fits).

    Examples
    --------
    >>> from isomatch.matching import default_starts
    >>> Stages(starts=default_starts[:1]).refinement.searches_further
    True
    >>> Stages(relation="isometry")
    Traceback (most recent call last):
    isomatch.SettingError: relation = 'isometry' is no Relation; give an instance of a subclass
    """

    refinement: Refinement = field(default_factory=Joint)
    starts: Sequence[Start] | None = None
    relation: Relation | None = None

    def __post_init__(self) -> None:
        for name, kind in (("refinement", Refinement), ("relation", Relation)):
            value: Any = getattr(self, name)
            if not (isinstance(value, kind) or (value is None and name == "relation")):
                raise SettingError(
                    f"{name} = {value!r} is no {kind.__name__}; give an instance of a subclass"
                )
        if callable(self.starts):
            raise SettingError(f"starts = {name_of(self.starts)} is one start; give a list of them")
        if self.starts is not None:
            object.__setattr__(self, "starts", tuple(self.starts))
            if not all(map(callable, self.starts)):
                raise SettingError("starts hold something that cannot be called with a pair of shapes")
