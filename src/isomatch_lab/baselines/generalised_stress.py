"""Generalised stress: how much the distances of points on the target's triangles differ from those on the source.

Distances are those of the distance bases, d(x, y) = Σ_c sign_c x_c y_c in the descriptors, divided on each shape by
their average. Between vertices of the target the descriptors are interpolated, so d is linear in the barycentric
coordinates of either point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch.correspondence import Embedding, PrecisePoints, faces_around_vertices, nearest_in_triangle
from isomatch.loading.compiled import compiled
from isomatch.matching import ShapePair
from isomatch.values.arrays import FloatArray, IntArray

SETTLED = 1e-4  # the descent ends when a sweep lowers the stress by less than this share


@dataclass(frozen=True, eq=False)
class Placement:
    """Vertices of the source and their places on the target.

    Parameters
    ----------
    vertices : (m,) array of int
        Source body vertices.
    corners : (m, 3) array of int
        Target body vertices of the triangle that holds each place.
    barycentric : (m, 3) array of float
        Their weights: not negative, sum 1.
    """

    vertices: IntArray
    corners: IntArray
    barycentric: FloatArray

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
        """(m, q) values at the places, from those of the target's vertices, (n_t, q)."""
        places: FloatArray = PrecisePoints(self.corners, self.barycentric).interpolation(len(values)) @ values
        return places


def distances_to(pair: ShapePair, points: Placement) -> Embedding:
    """Distances of all source vertices to the points, (n_s, m), and of all target vertices to the places, (n_t, m).

    Where distances are preserved, the image of a source vertex is the nearest point of the target in these coordinates.
    """
    source, target = pair.source.points, pair.target.points
    return Embedding(
        source.coordinates @ source.signed()[points.vertices].T,
        target.coordinates @ points.interpolated(target.signed()).T,
    )


def placed(pair: ShapePair, vertices: IntArray, anchors: Placement) -> Placement:
    """Place source vertices anywhere on the target where their distances to known places are preserved best."""
    of_source, of_target = distances_to(pair, anchors)
    return Placement(vertices, *pair.target.index.points(of_target, of_source[vertices]))


def relative_stress(pair: ShapePair, points: Placement) -> float:
    """√(Σ (d_target − d_source)² / Σ d_source²) over all pairs of points."""
    of_source, of_target = distances_to(pair, points)
    wanted = of_source[points.vertices]
    off = ~np.eye(len(wanted), dtype=bool)
    misfit = (points.interpolated(of_target) - wanted)[off]
    return float(np.linalg.norm(misfit) / np.linalg.norm(wanted[off]))


def descended(
    pair: ShapePair, points: Placement, n_held: int, n_sweeps: int
) -> tuple[Placement, tuple[float, ...]]:
    """Move one point at a time to where it fits the others best, within its triangle and on across the edges.

    Parameters
    ----------
    pair : ShapePair
        The two shapes.
    points : Placement
        First places of m points.
    n_held : int
        Number of leading points that do not move.
    n_sweeps : int
        Maximum number of sweeps over all points.

    Returns
    -------
    points : Placement
        Final places.
    stresses : tuple of float
        Relative stress at the start and after each sweep; it never increases.

    Notes
    -----
    Bronstein, Bronstein & Kimmel 2006: with all other points fixed, the stress is a convex quadratic function of the
    barycentric coordinates in each triangle, so it can be minimised exactly there. The minimum is a nearest point, with
    the m − 1 distances to the others as coordinates. The triangles around the corner of largest weight are tried, and
    this is repeated until none is better. O(m² k) for a sweep.
    """
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
        if stresses[-1] >= (1 - SETTLED) * stresses[-2]:
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
