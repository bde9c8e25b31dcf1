"""Landmarks that hold: a map is bent smoothly around them, until their images are the vertices they were given."""

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
    """Bend a map so that landmarks of the user hold, but for a tolerance in √area of the target."""
    bent_map, target = solution.map, pair.target
    moved, alone = np.zeros(len(landmarks)), np.ones(len(landmarks), dtype=bool)
    for source_part, target_part in product(components_of(pair.source), components_of(target)):
        warp = _LandmarkWarp(source_part, target_part, bent_map)
        on_both = warp.holds(landmarks)
        if on_both.any():
            bent_map, moved[on_both] = warp.bend(UserVertices(landmarks[on_both]), tolerance)
            alone &= ~on_both
    rows, images = landmarks[alone].T
    bent_map = _with_images(bent_map, UserVertices(rows), PrecisePoints.at_vertices(images))
    notes = [f"{len(landmarks)} landmarks are held, {(moved > tolerance).sum()} of them by bending the map"]
    if moved.max() > tolerance:
        notes[0] += f" by up to {moved.max():.3f} √area"
    if alone.any():
        named = some(landmarks[alone, 0])
        notes.append(
            f"landmarks at source vertices {named} lie on nothing that is matched to where they lead: they hold alone, "
            "and the map around them was not bent"
        )
    ends = target.body_vertex[np.column_stack([bent_map.vertices[landmarks[:, 0]], landmarks[:, 1]])]
    apart = target.distance(*ends[(ends >= 0).all(axis=1)].T)
    error = float(apart.mean()) if len(apart) else np.nan
    # the other measures are those of the map before
    quality = replace(solution.quality, landmark_error=error, matched=float(bent_map.matched.mean()))
    return replace(
        solution,
        map=bent_map,
        quality=quality,
        evidence=held_evidence(solution.evidence, quality, pair.config.outcome.contradiction),
        notes=(*solution.notes, *notes),
    )


class _LandmarkWarp:
    """The map between two bodies in full, and how it is bent."""

    def __init__(self, source: PreparedShape, target: PreparedShape, map_: Correspondence) -> None:
        self._source, self._target, self._map = source, target, map_
        self._source_vertex, self._target_vertex = ((x.detail or x).body_vertex for x in (source, target))
        corners = self._target_vertex[map_.faces]
        self._mapped = (self._source_vertex >= 0) & map_.matched & (corners >= 0).all(axis=1)
        self._images = PrecisePoints(corners, map_.barycentric)

    def holds(self, landmarks: Int[UserVertices, "m 2"]) -> Bool[BoolArray, "m"]:
        """Tell which landmarks have an image on the target's body, and should."""
        return np.asarray(self._mapped[landmarks[:, 0]] & (self._target_vertex[landmarks[:, 1]] >= 0))

    def bend(
        self, landmarks: Int[UserVertices, "m 2"], tolerance: float
    ) -> tuple[Correspondence, Float[FloatArray, "m"]]:
        """Return the map that moves the images of landmarks to their targets, and how far they were, in √area."""
        body, coordinates = _full_body(self._target), _coordinates(self._target)
        axes = slice(None if isinstance(body, Graph) else 3)
        rows, wanted = landmarks[:, 0], self._target_vertex[landmarks[:, 1]]
        shift = coordinates[wanted] - _at(self._images, rows).interpolated(coordinates)
        gap = np.linalg.norm(shift[:, axes], axis=1)
        shift[gap <= tolerance] = 0.0
        if not shift.any():
            return self._map, gap
        weights = _weights(self._source, self._source_vertex[rows], gap.max())
        touched = np.flatnonzero(self._mapped)
        touched = np.union1d(touched[weights[self._source_vertex[touched]].any(axis=1)], rows)
        goals = _at(self._images, touched).interpolated(coordinates)
        goals += weights[self._source_vertex[touched]] @ shift
        nearest = cKDTree(coordinates).query(goals)[1]
        faces = body.faces if isinstance(body, Mesh) else self._target.faces
        points = nearest_points(coordinates, goals, faces, nearest)
        at = np.searchsorted(touched, rows)
        left = np.linalg.norm((coordinates[wanted] - points.interpolated(coordinates)[at])[:, axes], axis=1)
        held = np.maximum(gap, left) > tolerance
        points.corners[at[held]] = wanted[held, None]
        user_vertex = (self._target.detail or self._target).user_vertex
        images = PrecisePoints(user_vertex[points.corners], points.barycentric)
        return _with_images(self._map, UserVertices(touched), images), gap


def _with_images(map_: Correspondence, rows: Int[UserVertices, "m"], images: PrecisePoints) -> Correspondence:
    """Give some source vertices other images."""
    vertices, faces, weights = map_.vertices.copy(), map_.faces.copy(), map_.barycentric.copy()
    vertices[rows], faces[rows], weights[rows] = images.corners[:, 0], images.corners, images.barycentric
    return replace(map_, vertices=vertices, faces=faces, barycentric=weights)


def _at(points: PrecisePoints, rows: IntArray) -> PrecisePoints:
    return PrecisePoints(points.corners[rows], points.barycentric[rows])


def _full_body(shape: PreparedShape) -> Surface:
    """Return the body at the user's resolution."""
    return shape.detail.transfer.fine if shape.detail else shape.body


def _carry_to_full(
    shape: PreparedShape, values: Float[FloatArray, "n_body q"]
) -> Float[FloatArray, "n_full q"]:
    """Carry values to the body in full."""
    return shape.detail.transfer.on_coarse.interpolated(values) if shape.detail else values


def _coordinates(shape: PreparedShape) -> Float[FloatArray, "n_full q"]:
    """Coordinates of the vertices of the body in full: positions if there are any, and functions of unit gradient."""
    body = _full_body(shape)
    n = len(shape.laplace.values) if isinstance(body, Graph) else HELD_LANDMARKS.n_functions
    smooth = _carry_to_full(shape, shape.laplace.vectors[:, 1:n] / np.sqrt(shape.laplace.values[1:n]))
    return (
        smooth
        if isinstance(body, Graph)
        else np.hstack([body.vertices, HELD_LANDMARKS.function_weight * smooth])
    )


def _weights(shape: PreparedShape, at: Int[IntArray, "m"], gap: float) -> Float[FloatArray, "n_full m"]:
    """Weights with which vertices follow landmarks: 1 at one, 0 at the others, and far away."""
    # Shifts are interpolated by heat kernels of the source, of width w: h(i, l) = Σ_j e^{−λ_j w² / 2} φ_j(i) φ_j(l),
    # each column over its peak: W = h H⁺ with H the kernel among the landmarks, so W is 1 at one and 0 at the others.
    # Then W ≥ 0 and Σ W ≤ 1 are forced: no vertex moves farther than a landmark. The bump is so wide that a gap is
    # spread over a slope that turns no face over, but no wider than landmarks are apart.
    phi, spectrum = shape.laplace.vectors, shape.laplace.values
    places = _at(shape.detail.transfer.on_coarse, at) if shape.detail else PrecisePoints.at_vertices(at)
    nearest = places.corners[:, 0]
    width = np.clip(HELD_LANDMARKS.width_per_shift * gap, HELD_LANDMARKS.min_width, HELD_LANDMARKS.max_width)
    if len(at) > 1:
        apart = shape.distances_between(nearest)[~np.eye(len(at), dtype=bool)]
        width = min(width, max(apart.min(), 0.5 * HELD_LANDMARKS.min_width))
    heat = (phi * np.exp(-0.5 * width**2 * spectrum)) @ places.interpolated(phi).T
    kernel = _carry_to_full(shape, heat)
    kernel /= kernel[at].diagonal()
    among = kernel[at]
    invert_map = np.linalg.pinv(
        among, rcond=HELD_LANDMARKS.min_singular_value / float(np.linalg.norm(among, 2))
    )
    weights: FloatArray = np.maximum(kernel @ invert_map - HELD_LANDMARKS.min_weight, 0.0) / (
        1 - HELD_LANDMARKS.min_weight
    )
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1.0)
    return weights
