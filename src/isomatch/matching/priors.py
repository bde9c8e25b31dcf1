"""Priors of the user: landmarks, another method's map, functions; on the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, UserVertices, array_of, numbers_of
from isomatch._core.errors import DescriptorError, LandmarkError, MapError, some
from isomatch.correspondence import UNMATCHED, Embedding
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Surface

# landmarks, initial map and initial descriptors, as given to `match`
UserPriors = tuple[ArrayLike | None, ArrayLike | None, tuple[ArrayLike, ArrayLike] | None]

# stand for the landmarks if none are given, as vertices of the bodies and of the users' shapes
_NOTHING = np.zeros((0, 2), dtype=np.int64)
NO_LANDMARKS, NO_USER_LANDMARKS = BodyVertices(_NOTHING), UserVertices(_NOTHING)
NO_FUNCTIONS = np.zeros((0, 0)), np.zeros((0, 0))  # stands for the functions on both shapes if none are given
MIN_POINTS = 3  # least number of landmarks, or of pairs of an initial map; chosen: fewer determine no map


@dataclass(frozen=True, eq=False)
class Priors:
    """What the user knows of a map, in vertices of the bodies; empty arrays by default.

    Parameters
    ----------
    landmarks : (m, 2) array of int
        Landmarks on both bodies: source vertex, target vertex.
    initial_pairs : (q, 2) array of int
        Source vertices and their images in the initial map.
    functions : (n_s, k) and (n_t, k) arrays of float
        Functions on source and target that should correspond.
    notes : tuple of str
        Say which priors were left out.
    user_landmarks : (m, 2) array of int
        The landmarks in the users' vertices.
    """

    landmarks: Int[BodyVertices, "m 2"] = field(default_factory=lambda: NO_LANDMARKS)
    initial_pairs: Int[BodyVertices, "q 2"] = field(default_factory=lambda: NO_LANDMARKS)
    functions: tuple[Float[FloatArray, "n_s k"], Float[FloatArray, "n_t k"]] = NO_FUNCTIONS
    notes: tuple[str, ...] = ()
    user_landmarks: Int[UserVertices, "_ 2"] = field(default_factory=lambda: NO_USER_LANDMARKS)

    @classmethod
    def of(
        cls,
        source: PreparedShape,
        target: PreparedShape,
        landmarks: ArrayLike | None = None,
        initial_map: ArrayLike | None = None,
        initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> Self:
        """Check what was given to `match`.

        Raises
        ------
        LandmarkError, MapError, DescriptorError
            If it does not fit the shapes, or leaves fewer than 3 points on both bodies.
        """
        sizes = source.surface.n_vertices, target.surface.n_vertices
        points, user_landmarks, initial_pairs = NO_LANDMARKS, NO_USER_LANDMARKS, NO_LANDMARKS
        notes: list[str] = []
        if landmarks is not None:
            pairs = checked_landmarks(landmarks, *sizes)
            user_landmarks, points = _on_bodies(source, target, pairs)
            if len(points) < MIN_POINTS:
                raise LandmarkError(
                    f"only {len(points)} landmarks lie on the main component of both shapes; at least {MIN_POINTS} "
                    "are needed there"
                )
            if len(points) < len(pairs):
                notes.append(
                    f"{len(pairs) - len(points)} of {len(pairs)} landmarks lie off the main components and are left out"
                )
            first = np.sort(np.unique(points, axis=0, return_index=True)[1])
            points, user_landmarks = BodyVertices(points[first]), UserVertices(user_landmarks[first])
            if len(points) < MIN_POINTS:
                raise LandmarkError(
                    f"the landmarks fall on {len(points)} vertices of the resolution that is matched, at least "
                    f"{MIN_POINTS} are needed; give landmarks farther apart, or set resolution = 'full'"
                )
        if initial_map is not None:
            image = checked_initial_map(initial_map, *sizes)
            pairs = UserVertices(np.column_stack([np.arange(sizes[0]), image])[image != UNMATCHED])
            # Of vertices that a coarser body merges into one, the pair of the vertex nearest to it is kept,
            # or the first pair.
            is_farther = source.user_vertex[source.body_vertex[pairs[:, 0]]] != pairs[:, 0]
            order = np.argsort(is_farther, kind="stable")
            _, joined = _on_bodies(source, target, UserVertices(pairs[order]))
            initial_pairs = BodyVertices(joined[np.unique(joined[:, 0], return_index=True)[1]])
            if len(initial_pairs) < MIN_POINTS:
                raise MapError(
                    f"the initial map joins only {len(initial_pairs)} vertices of the main components of both shapes; at "
                    f"least {MIN_POINTS} are needed to start anything"
                )
        functions: tuple[FloatArray, FloatArray] = np.zeros((sizes[0], 0)), np.zeros((sizes[1], 0))
        if initial_descriptors is not None:
            functions = checked_descriptors(initial_descriptors, *sizes)
        functions_on_bodies = source.restrict(functions[0]), target.restrict(functions[1])
        for side, values in zip(("source", "target"), functions_on_bodies):
            if not np.isfinite(values).all():
                raise DescriptorError(
                    f"{side} descriptors hold values that are not finite on the main component; only vertices that are "
                    "not matched may have nan"
                )
        return cls(points, initial_pairs, functions_on_bodies, tuple(notes), user_landmarks)

    @property
    def turned(self) -> Self:
        """The priors of the map in the other direction."""
        return replace(
            self,
            landmarks=BodyVertices(self.landmarks[:, ::-1]),
            initial_pairs=BodyVertices(self.initial_pairs[:, ::-1]),
            functions=self.functions[::-1],
            user_landmarks=UserVertices(self.user_landmarks[:, ::-1]),
        )

    @property
    def has_functions(self) -> bool:
        """Whether descriptors were given."""
        return bool(self.functions[0].shape[1])

    @property
    def only_landmarks(self) -> bool:
        """Whether there is neither an initial map nor descriptors."""
        return not len(self.initial_pairs) and not self.has_functions

    @property
    def any(self) -> bool:
        """Whether there are any priors."""
        return bool(len(self.landmarks)) or not self.only_landmarks


def _on_bodies(
    source: PreparedShape, target: PreparedShape, pairs: Int[UserVertices, "_ 2"]
) -> tuple[Int[UserVertices, "m 2"], Int[BodyVertices, "m 2"]]:
    """Keep the pairs that lie on both bodies: as vertices of the user, and of the bodies."""
    on_bodies = np.column_stack([source.body_vertex[pairs[:, 0]], target.body_vertex[pairs[:, 1]]])
    kept = (on_bodies >= 0).all(axis=1)
    return UserVertices(pairs[kept]), BodyVertices(on_bodies[kept])


def checked_landmarks(landmarks: ArrayLike, n_source: int, n_target: int) -> Int[UserVertices, "m 2"]:
    """Return landmarks as an integer array after checking type, shape, range and repetition."""
    pairs = array_of(landmarks, "landmarks", LandmarkError)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise LandmarkError(
            f"landmarks have shape {pairs.shape} and type {pairs.dtype}; expected one row "
            "(source vertex, target vertex) of two integers for each landmark"
        )
    if len(pairs) < MIN_POINTS:
        raise LandmarkError(
            f"{len(pairs)} landmarks do not fix an alignment; give at least {MIN_POINTS}, better 5 at extremities"
        )
    for column, (side, n) in enumerate((("source", n_source), ("target", n_target))):
        bad = pairs[(pairs[:, column] < 0) | (pairs[:, column] >= n), column]
        if len(bad):
            raise LandmarkError(
                f"landmarks name {side} vertices {some(bad)}, outside 0…{n - 1}; indices count from 0, "
                "and the first column belongs to the source"
            )
        values, counts = np.unique(pairs[:, column], return_counts=True)
        if (counts > 1).any():
            raise LandmarkError(f"landmarks use {side} vertices {some(values[counts > 1])} more than once")
    return UserVertices(pairs.astype(np.int64))


def checked_initial_map(
    initial_map: ArrayLike, n_source: int, n_target: int
) -> Int[UserVertices, "n_source"]:
    """Return an initial map as an integer array after checking type, length and range."""
    image = array_of(getattr(initial_map, "vertices", initial_map), "the rows of the initial map", MapError)
    if getattr(initial_map, "n_target", n_target) != n_target:
        raise MapError(
            f"the initial map {initial_map!r} leads to another target, which has {n_target} vertices here"
        )
    if image.shape != (n_source,) or image.dtype.kind not in "iu":
        raise MapError(
            f"initial map has shape {image.shape} and type {image.dtype}; expected one integer target vertex for "
            f"each of the {n_source} source vertices"
        )
    bad = np.flatnonzero((image < UNMATCHED) | (image >= n_target))
    if len(bad):
        raise MapError(
            f"initial map sends source vertices {some(bad)} outside the target's vertices 0…{n_target - 1}; is it "
            "the map of the other direction?"
        )
    return UserVertices(image.astype(np.int64))


def checked_descriptors(
    descriptors: Sequence[ArrayLike], n_source: int, n_target: int, what: str = "initial descriptors"
) -> tuple[Float[FloatArray, "n_source q"], Float[FloatArray, "n_target q"]]:
    """Return descriptors as arrays of numbers after checking them."""
    if len(descriptors) != 2:
        raise DescriptorError(f"{what} are {len(descriptors)} arrays; expected two, of source and target")
    source, target = (numbers_of(values, what, DescriptorError) for values in descriptors)
    if source.ndim != 2 or target.ndim != 2 or source.shape[1:] != target.shape[1:]:
        raise DescriptorError(
            f"{what} have shapes {source.shape} and {target.shape}; expected (n_source, q), (n_target, q)"
        )
    if not source.shape[1]:
        raise DescriptorError(f"{what} have no columns; give at least one function of each shape")
    for side, values, n in (("source", source, n_source), ("target", target, n_target)):
        if len(values) != n:
            raise DescriptorError(f"{what} of the {side} have {len(values)} rows for {n} vertices")
    return source, target


def known_functions(
    source: PreparedShape,
    target: PreparedShape,
    functions: tuple[ArrayLike, ArrayLike] | None,
    config: Config,
) -> Embedding | None:
    """Check and weigh functions given to `match`; `DescriptorError` if they do not fit."""
    if functions is None:
        return None
    sides = (numbers_of(values, "functions", DescriptorError) for values in functions)
    columns = tuple(values[:, None] if values.ndim == 1 else values for values in sides)
    surfaces = source.surface, target.surface
    values = checked_descriptors(columns, surfaces[0].n_vertices, surfaces[1].n_vertices, what="functions")
    for side, known in zip(("source", "target"), values):
        if np.isinf(known).any() or np.isnan(known).all(axis=0).any():
            raise DescriptorError(
                f"functions: values of the {side} are infinite, or one function is known at no vertex; give finite "
                "numbers, and nan where nothing is known"
            )
    both = np.concatenate(values)  # standardised together, so that a value means the same on both shapes
    weight = config.refining.function_weight / np.sqrt(both.shape[1])
    mean, deviation = np.nanmean(both, axis=0), np.nanstd(both, axis=0)
    unit = weight / np.where(deviation > 0, deviation, 1.0)
    return Embedding(*map(_fill_unknown, ((x - mean) * unit for x in values), surfaces))


def _fill_unknown(values: Float[FloatArray, "n q"], surface: Surface) -> Float[FloatArray, "n q"]:
    """Copy unknown values from the nearest vertex along edges that has one; 0 if there is none."""
    filled = values.copy()
    for column in filled.T:
        unknown = np.isnan(column)
        if unknown.any():
            distance, nearest = distance_along_edges_to_nearest(surface, np.flatnonzero(~unknown), weld=True)
            reached = np.isfinite(distance)
            column[unknown & ~reached] = 0.0
            column[unknown & reached] = column[nearest[unknown & reached]]
    return filled
