"""Landmarks that hold: a map is bent smoothly until their images are their targets."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import Bool, BoolArray, Float, FloatArray, Int, IntArray, UserVertices
from isomatch._core.errors import some
from isomatch.correspondence import Correspondence, nearest_points
from isomatch.matching.assessment.evidence import Solution, held_evidence
from isomatch.matching.parameters import HELD_LANDMARKS
from isomatch.matching.problem import Problem
from isomatch.shapes import PreparedShape, components_of
from isomatch.surfaces import Graph, Mesh, PrecisePoints, Surface


def pin_landmarks(
    pair: Problem, solution: Solution, landmarks: Int[UserVertices, "m 2"], tolerance: float
) -> Solution:
    """Bend a map so that landmarks of the user hold, up to a tolerance in √area of the target."""
    bent_map, target = solution.map, pair.target
    moved, is_alone = np.zeros(len(landmarks)), np.ones(len(landmarks), dtype=bool)
    for source_part, target_part in product(components_of(pair.source), components_of(target)):
        warp = _LandmarkWarp(source_part, target_part, bent_map)
        on_both = warp.holds(landmarks)
        if on_both.any():
            bent_map, moved[on_both] = warp.bend(UserVertices(landmarks[on_both]), tolerance)
            is_alone &= ~on_both
    rows, images = landmarks[is_alone].T
    bent_map = _with_images(bent_map, UserVertices(rows), PrecisePoints.at_vertices(images))
    notes = [f"{len(landmarks)} landmarks are held, {(moved > tolerance).sum()} of them by bending the map"]
    if moved.max() > tolerance:
        notes[0] += f" by up to {moved.max():.3f} √area"
    if is_alone.any():
        named = some(landmarks[is_alone, 0])
        notes.append(
            f"landmarks at source vertices {named} lie on nothing that is matched to where they lead: they hold alone, "
            "and the map around them was not bent"
        )
    ends = target.body_vertex[np.column_stack([bent_map.vertices[landmarks[:, 0]], landmarks[:, 1]])]
    errors = target.distance(*ends[(ends >= 0).all(axis=1)].T)
    error = float(errors.mean()) if len(errors) else np.nan
    # other measures than these two are not updated: they describe the map before it was bent
    quality = replace(solution.quality, landmark_error=error, matched=float(bent_map.matched.mean()))
    return replace(
        solution,
        map=bent_map,
        quality=quality,
        evidence=held_evidence(solution.evidence, quality, pair.config.outcome.contradiction),
        notes=(*solution.notes, *notes),
    )


class _LandmarkWarp:
    """Bends the map between two bodies at full resolution."""

    def __init__(self, source: PreparedShape, target: PreparedShape, map_: Correspondence) -> None:
        self._source, self._target, self._map = source, target, map_
        self._source_vertex, self._target_vertex = ((x.detail or x).body_vertex for x in (source, target))
        corners = self._target_vertex[map_.faces]
        self._mapped = (self._source_vertex >= 0) & map_.matched & (corners >= 0).all(axis=1)
        self._images = PrecisePoints(corners, map_.barycentric)

    def holds(self, landmarks: Int[UserVertices, "m 2"]) -> Bool[BoolArray, "m"]:
        """Which landmarks lie on both bodies and have an image."""
        return np.asarray(self._mapped[landmarks[:, 0]] & (self._target_vertex[landmarks[:, 1]] >= 0))

    def bend(
        self, landmarks: Int[UserVertices, "m 2"], tolerance: float
    ) -> tuple[Correspondence, Float[FloatArray, "m"]]:
        """Move images of landmarks to their targets; return map and former errors in √area."""
        body, coordinates = _full_body(self._target), _coordinates(self._target)
        axes = slice(None if isinstance(body, Graph) else 3)
        rows, goal_vertices = landmarks[:, 0], self._target_vertex[landmarks[:, 1]]
        shift = coordinates[goal_vertices] - _select(self._images, rows).interpolated(coordinates)
        gap = np.linalg.norm(shift[:, axes], axis=1)
        shift[gap <= tolerance] = 0.0
        if not shift.any():
            return self._map, gap
        weights = _weights(self._source, self._source_vertex[rows], gap.max())
        touched = np.flatnonzero(self._mapped)
        touched = np.union1d(touched[weights[self._source_vertex[touched]].any(axis=1)], rows)
        goals = _select(self._images, touched).interpolated(coordinates)
        goals += weights[self._source_vertex[touched]] @ shift
        nearest = cKDTree(coordinates).query(goals)[1]
        faces = body.faces if isinstance(body, Mesh) else self._target.faces
        points = nearest_points(coordinates, goals, faces, nearest)
        numbers = np.searchsorted(touched, rows)
        remaining = (coordinates[goal_vertices] - points.interpolated(coordinates)[numbers])[:, axes]
        is_off = np.maximum(gap, np.linalg.norm(remaining, axis=1)) > tolerance
        points.corners[numbers[is_off]] = goal_vertices[is_off, None]
        user_vertex = (self._target.detail or self._target).user_vertex
        images = PrecisePoints(user_vertex[points.corners], points.barycentric)
        return _with_images(self._map, UserVertices(touched), images), gap


def _with_images(map_: Correspondence, rows: Int[UserVertices, "m"], images: PrecisePoints) -> Correspondence:
    """Replace the images of some source vertices."""
    vertices, faces, weights = map_.vertices.copy(), map_.faces.copy(), map_.barycentric.copy()
    vertices[rows], faces[rows], weights[rows] = images.corners[:, 0], images.corners, images.barycentric
    return replace(map_, vertices=vertices, faces=faces, barycentric=weights)


def _select(points: PrecisePoints, rows: IntArray) -> PrecisePoints:
    return PrecisePoints(points.corners[rows], points.barycentric[rows])


def _full_body(shape: PreparedShape) -> Surface:
    """Return the body at the user's resolution."""
    return shape.detail.transfer.fine if shape.detail else shape.body


def _carry_to_full(
    shape: PreparedShape, values: Float[FloatArray, "n_body q"]
) -> Float[FloatArray, "n_full q"]:
    """Interpolate values to the body at full resolution."""
    return shape.detail.transfer.on_coarse.interpolated(values) if shape.detail else values


def _coordinates(shape: PreparedShape) -> Float[FloatArray, "n_full q"]:
    """Coordinates of the full body: positions if there are any, and functions of unit gradient."""
    body = _full_body(shape)
    n = len(shape.laplace.values) if isinstance(body, Graph) else HELD_LANDMARKS.n_functions
    smooth = _carry_to_full(shape, shape.laplace.vectors[:, 1:n] / np.sqrt(shape.laplace.values[1:n]))
    if isinstance(body, Graph):
        return smooth
    return np.hstack([body.vertices, HELD_LANDMARKS.function_weight * smooth])


def _weights(
    shape: PreparedShape, landmarks: Int[IntArray, "m"], gap: float
) -> Float[FloatArray, "n_full m"]:
    """Weight with which each vertex follows each landmark: 1 at the landmark, 0 far from it and at other landmarks."""
    # Shifts are interpolated by heat kernels of width w on the source,
    #     h(i, l) = Σ_j e^{−λ_j w² / 2} φ_j(i) φ_j(l),
    # where φ_j and λ_j are the Laplace–Beltrami functions and eigenvalues, and each column l is divided by
    # its value at landmark l. With H the kernel between landmarks, column l of W = h H⁺ is 1 at landmark l
    # and 0 at the other landmarks. W ≥ 0 and Σ_l W(i, l) ≤ 1 are enforced, so that no vertex moves farther
    # than a landmark. The width w grows with the gap, so that no face turns over, but is at most the distance
    # between landmarks.
    phi, spectrum = shape.laplace.vectors, shape.laplace.values
    points = PrecisePoints.at_vertices(landmarks)
    if shape.detail:
        points = _select(shape.detail.transfer.on_coarse, landmarks)
    nearest = points.corners[:, 0]
    width = np.clip(HELD_LANDMARKS.width_per_shift * gap, HELD_LANDMARKS.min_width, HELD_LANDMARKS.max_width)
    if len(landmarks) > 1:
        distances = shape.distances_between(nearest)[~np.eye(len(landmarks), dtype=bool)]
        width = min(width, max(distances.min(), 0.5 * HELD_LANDMARKS.min_width))
    heat = (phi * np.exp(-0.5 * width**2 * spectrum)) @ points.interpolated(phi).T
    kernel = _carry_to_full(shape, heat)
    kernel /= kernel[landmarks].diagonal()
    among = kernel[landmarks]
    inverse = np.linalg.pinv(among, rcond=HELD_LANDMARKS.min_singular_value / float(np.linalg.norm(among, 2)))
    least = HELD_LANDMARKS.min_weight
    weights: FloatArray = np.maximum(kernel @ inverse - least, 0.0) / (1 - least)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1.0)
    return weights
