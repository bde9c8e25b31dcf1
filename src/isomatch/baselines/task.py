"""What a baseline starts from, and how its map becomes the same kind of result as that of `match`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import FloatArray, IntArray
from isomatch.errors import LandmarkError, MapError
from isomatch.matching.clock import Clock
from isomatch.matching.config import Settings
from isomatch.matching.initial import checked_descriptors, checked_initial_map, checked_landmarks
from isomatch.matching.nearest import Coordinates, nearest_in_cells
from isomatch.matching.pair import Pair, prepared_pair
from isomatch.matching.precise import interpolation, nearest_points
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.quality import outcome_of, quality_of
from isomatch.matching.result import MatchResult
from isomatch.surfaces import Surface

FEWEST_POINTS = 3  # corresponding points that can start anything
NOT_JUDGED = (
    "a baseline tries no other map: misfit and rival are not defined, and symmetric maps go unnoticed"
)


@dataclass(frozen=True, eq=False)
class Task:
    """Two prepared shapes, and what is known of their map, in vertices of the bodies.

    Parameters
    ----------
    pair : Pair
        The shapes.
    landmarks : (m, 2) array of int, optional
        As given, in the users' indices.
    points : (m, 2) array of int
        Landmarks on both bodies, source and target; none if not given.
    known : (q, 2) array of int
        Source vertices and their images in the initial map; none if not given.
    functions : (n_s, q) and (n_t, q) arrays of float
        Given descriptors; none if not given.
    seed : int
        Seed of the preparation.
    clock : Clock
        Times the stages.
    """

    pair: Pair
    landmarks: IntArray | None
    points: IntArray
    known: IntArray
    functions: tuple[FloatArray, FloatArray]
    seed: int
    clock: Clock = field(repr=False)

    @classmethod
    def of(
        cls,
        source: Surface | PreparedShape,
        target: Surface | PreparedShape,
        landmarks: ArrayLike | None,
        initial_map: ArrayLike | None,
        initial_descriptors: tuple[ArrayLike, ArrayLike] | None,
        seed: int,
    ) -> Task:
        """Prepare the shapes, if they are not, and check the hints as `match` does.

        Raises
        ------
        MeshError
            If a surface cannot be used.
        LandmarkError
            If a hint does not fit the shapes, or leaves fewer than 3 points on both bodies.
        SettingError
            If the shapes were prepared with different settings.
        """
        clock = Clock()
        clock.start("prepare")
        pair, _ = prepared_pair(source, target, None, seed)
        a, b = pair.source.shape, pair.target.shape
        sizes = a.mesh.n_vertices, b.mesh.n_vertices
        pairs = None if landmarks is None else checked_landmarks(landmarks, *sizes)
        start = None if initial_map is None else checked_initial_map(initial_map, *sizes)
        functions = np.zeros((sizes[0], 0)), np.zeros((sizes[1], 0))
        if initial_descriptors is not None:
            functions = checked_descriptors(initial_descriptors, *sizes)
        return cls(
            pair,
            pairs,
            _on_bodies(a, b, pairs, "landmarks"),
            _on_bodies(
                a, b, None if start is None else np.column_stack([np.arange(sizes[0]), start]), "initial map"
            ),
            (functions[0][a.mesh_vertex], functions[1][b.mesh_vertex]),
            seed,
            clock,
        )

    def functions_at_most(self, wanted: int) -> int:
        """Give the number of Laplace–Beltrami functions wanted, or as many as both shapes have."""
        return min(wanted, *(len(side.shape.laplace.values) for side in (self.pair.source, self.pair.target)))

    def result(self, coordinates: Coordinates, config: Settings, origin: str) -> MatchResult:
        """Map every source vertex to the nearest point of the target in common coordinates, and measure the map.

        The outcome rests on residual, stretch and orientation alone, by the bounds of `match`.
        """
        self.clock.start("points")
        source, target = self.pair.source.shape, self.pair.target.shape
        image = nearest_in_cells(*coordinates, target.cells)
        corners, barycentric = nearest_points(*coordinates, target.faces, image)
        self.clock.start("quality")
        pull_back = interpolation(corners, barycentric, target.body.n_vertices)
        quality = quality_of(self.pair, image, pull_back, [], self.landmarks)
        notes = (
            f"{side}: {note}" for side, s in (("source", source), ("target", target)) for note in s.notes
        )
        return MatchResult(
            map=source.lifted(target, image, corners, barycentric),
            outcome=outcome_of(quality, source, target, config.orientation),
            quality=quality,
            alternatives=(),
            timings=self.clock.stop(),
            notes=(*notes, NOT_JUDGED),
            engine=source.distances.engine,
            origin=origin,
            config=config,
            seed=self.seed,
        )


def _on_bodies(source: PreparedShape, target: PreparedShape, pairs: IntArray | None, what: str) -> IntArray:
    """Rows of pairs that have an image and lie on both bodies, in body vertices."""
    if pairs is None:
        return np.zeros((0, 2), dtype=np.int64)
    rows = pairs[pairs[:, 1] >= 0]
    rows = np.column_stack([source.body_vertex[rows[:, 0]], target.body_vertex[rows[:, 1]]])
    rows = rows[(rows >= 0).all(axis=1)]
    if len(rows) < FEWEST_POINTS:
        raise (LandmarkError if what == "landmarks" else MapError)(
            f"{what}: only {len(rows)} points of the main components of both shapes are joined; at least {FEWEST_POINTS} "
            "are needed there"
        )
    return rows
