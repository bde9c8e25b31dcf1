"""The user's hints on shapes of several components: what of them concerns two of these."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from isomatch.correspondence import UNMATCHED
from isomatch.matching.hints import (
    FEWEST_POINTS,
    Hints,
    checked_descriptors,
    checked_initial_map,
    checked_landmarks,
)
from isomatch.matching.pair import ShapePair
from isomatch.shapes import PreparedShape, components_of
from isomatch.values.arrays import FloatArray, IntArray


class ComponentHints:
    """The user's hints, and what of them concerns two components."""

    def __init__(
        self,
        pair: ShapePair,
        landmarks: ArrayLike | None,
        initial_map: ArrayLike | None,
        initial_descriptors: tuple[ArrayLike, ArrayLike] | None,
    ) -> None:
        self.pair = pair
        self.functions: tuple[FloatArray, FloatArray] | None = None
        sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
        none = np.zeros((0, 2), dtype=np.int64)
        self.landmarks = none if landmarks is None else checked_landmarks(landmarks, *sizes)
        self.image = np.full(sizes[0], UNMATCHED)
        if initial_map is not None:
            self.image = checked_initial_map(initial_map, *sizes)
        if initial_descriptors is not None:
            self.functions = checked_descriptors(initial_descriptors, *sizes)
        rows = np.flatnonzero(self.image != UNMATCHED)
        self.joins = np.concatenate([self.landmarks, np.column_stack([rows, self.image[rows]])])
        joined = [self._inside(ShapePair(*sides, pair.config), self.joins) for sides in product(*self.sides)]
        self.joined = np.reshape([len(rows) for rows in joined], [len(side) for side in self.sides])
        if len(self.joins) and self.joined.max() < FEWEST_POINTS:
            Hints.of(pair, landmarks, initial_map, None)  # refuses them

    @property
    def sides(self) -> tuple[tuple[PreparedShape, ...], tuple[PreparedShape, ...]]:
        """Components of source and target."""
        return components_of(self.pair.source), components_of(self.pair.target)

    def _inside(self, pair: ShapePair, joins: IntArray) -> IntArray:
        """Those pairs of the users' vertices that lie on two components."""
        here = pair.source.body_vertex[joins[:, 0]] >= 0
        return joins[here & (pair.target.body_vertex[joins[:, 1]] >= 0)]

    def on(self, pair: ShapePair) -> Hints:
        """Hints on two components; none where too little is known of them."""
        landmarks = self.landmarks_on(pair)
        initial_pairs = self._inside(pair, np.column_stack([np.arange(len(self.image)), self.image]))
        initial_pairs = initial_pairs[initial_pairs[:, 1] != UNMATCHED]
        image = np.full(len(self.image), UNMATCHED)
        image[initial_pairs[:, 0]] = initial_pairs[:, 1]
        functions = self.functions
        if functions is not None and pair.source.body is not self.pair.source.body:
            parts = zip((pair.source, pair.target), functions)
            if not all(np.isfinite(shape.restrict(values)).all() for shape, values in parts):
                functions = None
        return Hints.of(
            pair,
            landmarks if len(landmarks) else None,
            image if len(initial_pairs) >= FEWEST_POINTS else None,
            functions,
        )

    def landmarks_on(self, pair: ShapePair) -> IntArray:
        """Landmarks on two components, if they are enough to be used."""
        landmarks = self._inside(pair, self.landmarks)
        return landmarks if len(landmarks) >= FEWEST_POINTS else landmarks[:0]
