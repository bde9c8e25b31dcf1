"""Generalised multidimensional scaling (GMDS): its stress, and points moved over the target until it is least."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting
from isomatch._core.threads import serial_blas
from isomatch.correspondence import Embedding, PrecisePoints, faces_around_vertices, nearest_in_triangle
from isomatch.matching import MatchResult, Problem, first_map
from isomatch.settings import Orientation
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Surface
from isomatch_lab.baselines.task import Task

MIN_POINTS = 3  # smallest number of points whose distances to another point fix its place


@dataclass(frozen=True)
class GmdsConfig(Settings):
    """Settings of `gmds`.

    Parameters
    ----------
    levels : tuple of int
        Farthest point samples of the source that are placed at each resolution, increasing; at most as many as `prepare`
        draws.
    n_sweeps : int
        Maximum number of sweeps over the points at each resolution.
    orientation : {"preserve", "reverse", "any"}
        Orientation of the automatic start, and the one that the outcome expects; the stress does not depend on it.
    """

    levels: tuple[int, ...] = (10, 25, 50, 100)
    n_sweeps: int = setting(100, least=1)
    orientation: Orientation = "preserve"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.levels or self.levels[0] < MIN_POINTS or sorted(set(self.levels)) != list(self.levels):
            raise SettingError(
                f"levels = {self.levels!r} are not increasing numbers of points, the first at least {MIN_POINTS}"
            )


def gmds(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: GmdsConfig | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match by generalised multidimensional scaling: samples of the source placed on the target with least stress.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`; the target must be a mesh. Landmarks take part as points that do not move. The samples start from
        the initial map, else the landmarks, else the descriptors, else the best automatic hypothesis of `match`.
    config : GmdsConfig, optional
        Settings.

    Returns
    -------
    MatchResult
        ``.map`` is the `Correspondence` source → target, and the last note gives the stress of the samples; the outcome
        depends on residual, stretch and orientation.

    Raises
    ------
    MeshError, LandmarkError, MapError, DescriptorError, SettingError
        As `match` does; a `SettingError` also if the target has no triangles.

    Notes
    -----
    Bronstein, Bronstein & Kimmel, *Generalized multidimensional scaling*, PNAS 2006: least-squares stress is minimised
    over positions in triangles, one point at a time, from few points to many. Reconstructed: distances come from
    the distance bases, in units of their average, where the paper interpolates a full matrix from fast marching; the
    automatic start; the placement of new points by their distances to earlier ones; and the extension to all
    vertices, by the least-squares functional map of half as many Laplace–Beltrami functions as there are points. About
    0.2 s for 5 000 vertices after preparation, and 1 s for an automatic start.
    """
    config = config or GmdsConfig()
    with serial_blas():
        task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
        points, stresses, origin = placement(task, config)
        k = task.functions_at_most(len(points.vertices) // 2)
        values = points.interpolated(task.pair.target.laplace.vectors[:, :k])
        functional_map = task.functional_map_from(points.vertices, values)
        result = task.spectral_result(functional_map, config, origin)
    note = f"relative stress of {len(points.vertices)} points: {stresses[-1]:.4f}"
    return replace(result, notes=(*result.notes, note))


def placement(task: Task, config: GmdsConfig) -> tuple[Placement, tuple[float, ...], str]:
    """Place landmarks and samples with least stress; also the stresses of the last descent, and the start's origin."""
    pair = task.pair
    if pair.target.triangles is None:
        raise SettingError("points are placed on triangles, and the target has none; give a mesh")
    task.timer.start("start")
    anchored_at, origin = _start(task, config)
    task.timer.start("stress")
    held = Placement.at_vertices(task.priors.landmarks)
    samples = pair.source.column_vertices[~np.isin(pair.source.column_vertices, held.vertices)]
    points, anchors = held, Placement.at_vertices(anchored_at)
    stresses: tuple[float, ...] = ()
    for first, last in pairwise((0, *config.levels)):
        points = points.joined(place_points(pair, samples[first:last], anchors))
        points, stresses = descend_stress(pair, points, len(held.vertices), config.n_sweeps)
        anchors = points
    return points, stresses, origin


def _start(task: Task, config: GmdsConfig) -> tuple[IntArray, str]:
    """Source vertices and their first images (q, 2), and where they come from."""
    pair, samples = task.pair, task.pair.source.column_vertices
    if len(task.priors.initial_pairs):
        at_samples = task.priors.initial_pairs[np.isin(task.priors.initial_pairs[:, 0], samples)]
        return at_samples if len(at_samples) >= MIN_POINTS else task.priors.initial_pairs, "initial map"
    if len(task.priors.landmarks):
        return task.priors.landmarks, "landmarks"
    image, origin = first_map(pair, samples, config.orientation)
    return np.column_stack([samples, image]), origin


MIN_STRESS_DECREASE = 1e-4  # share of the stress; the descent ends when a sweep lowers it by less; chosen


@dataclass(frozen=True, eq=False)
class Placement:
    """Vertices of the source and their places on the target."""

    vertices: IntArray  # (m,) source body vertices
    corners: IntArray  # (m, 3) target body vertices of the triangle that holds each place
    barycentric: FloatArray  # (m, 3) weights of the corners: not negative, sum 1

    @classmethod
    def at_vertices(cls, pairs: IntArray) -> Placement:
        """Place source vertices on target vertices, (m, 2)."""
        weights = np.tile([1.0, 0.0, 0.0], (len(pairs), 1))
        return cls(pairs[:, 0], np.repeat(pairs[:, 1:], 3, axis=1), weights)

    def joined(self, other: Placement) -> Placement:
        """Append other points."""
        mine, others = vars(self), vars(other)
        return Placement(**{name: np.concatenate([mine[name], others[name]]) for name in mine})

    def interpolated(self, values: FloatArray) -> FloatArray:
        """(m, q) values at the places, interpolated from values at the target's vertices, (n_t, q)."""
        places: FloatArray = PrecisePoints(self.corners, self.barycentric).interpolation(len(values)) @ values
        return places


def distances_to(pair: Problem, points: Placement) -> Embedding:
    """Distances of all source vertices to the points, (n_s, m), and of all target vertices to the places, (n_t, m)."""
    source, target = pair.source.points, pair.target.points
    return Embedding(
        source.coordinates @ source.signed()[points.vertices].T,
        target.coordinates @ points.interpolated(target.signed()).T,
    )


def place_points(pair: Problem, vertices: IntArray, anchors: Placement) -> Placement:
    """Place source vertices anywhere on the target where their distances to known places are preserved best."""
    of_source, of_target = distances_to(pair, anchors)
    return Placement(vertices, *pair.target.index.points(of_target, of_source[vertices]))


def relative_stress(pair: Problem, points: Placement) -> float:
    """√(Σ (d_target − d_source)² / Σ d_source²) over all pairs of points."""
    of_source, of_target = distances_to(pair, points)
    wanted = of_source[points.vertices]
    off = ~np.eye(len(wanted), dtype=bool)
    spectral_residual = (points.interpolated(of_target) - wanted)[off]
    return float(np.linalg.norm(spectral_residual) / np.linalg.norm(wanted[off]))


def descend_stress(
    pair: Problem, points: Placement, n_held: int, n_sweeps: int
) -> tuple[Placement, tuple[float, ...]]:
    """Move one of m points at a time, but the held first ones, to where it fits best; and the stress after each sweep."""
    # Bronstein, Bronstein & Kimmel 2006: with all other points fixed, the stress is a convex quadratic function of the
    # barycentric coordinates in each triangle, so it can be minimised exactly there. The minimum is a nearest point,
    # with the m − 1 distances to the others as coordinates. The triangles around the corner of largest weight are
    # tried, and this is repeated until none is better: the stress never increases. O(m² k) for a sweep
    target = pair.target
    start, order = faces_around_vertices(target.faces, target.body.n_vertices)
    corners, barycentric = points.corners.copy(), points.barycentric.copy()
    cloud, signs = np.ascontiguousarray(target.points.coordinates), target.points.signs
    wanted = distances_to(pair, points).source[points.vertices]
    np.fill_diagonal(wanted, 0.0)
    placed = replace(points, corners=corners, barycentric=barycentric)
    stresses = [relative_stress(pair, placed)]
    for _ in range(n_sweeps):
        inner = placed.interpolated(cloud * signs)
        _sweep(cloud, signs, inner, wanted, n_held, target.faces, start, order, corners, barycentric)
        stresses.append(relative_stress(pair, placed))
        if stresses[-1] >= (1 - MIN_STRESS_DECREASE) * stresses[-2]:
            break
    return placed, tuple(stresses)


@compiled()
def _sweep(
    cloud: FloatArray,
    signs: FloatArray,
    inner: FloatArray,
    wanted: FloatArray,
    n_held: int,
    faces: IntArray,
    start: IntArray,
    order: IntArray,
    corners: IntArray,
    barycentric: FloatArray,
) -> None:
    for i in range(n_held, len(corners)):
        inner[i] = 0.0  # the distance of a point to itself does not count
        least = np.inf
        at = barycentric[i]
        gap = inner @ (
            at[0] * cloud[corners[i, 0]] + at[1] * cloud[corners[i, 1]] + at[2] * cloud[corners[i, 2]]
        )
        gap -= wanted[i]
        stress = gap @ gap
        while stress < least:
            least = stress
            a = corners[i, np.argmax(at)]
            origin = inner @ cloud[a]
            p = wanted[i] - origin
            for incident in order[start[a] : start[a + 1]]:
                face, corner = incident // 3, incident % 3
                b, c = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
                u, v = inner @ cloud[b] - origin, inner @ cloud[c] - origin
                s, t, gain = nearest_in_triangle(u @ u, u @ v, v @ v, u @ p, v @ p)
                if p @ p + gain < stress * (1.0 - 1e-9):
                    stress = p @ p + gain
                    corners[i] = a, b, c
                    barycentric[i] = 1.0 - s - t, s, t
        place = at[0] * cloud[corners[i, 0]] + at[1] * cloud[corners[i, 1]] + at[2] * cloud[corners[i, 2]]
        inner[i] = signs * place
