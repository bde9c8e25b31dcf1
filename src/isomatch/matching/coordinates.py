"""Coordinates in which images are nearest points: what a map known at some vertices makes of functions and positions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from isomatch._core.arrays import BodyVertices, FloatArray, Int, IntArray, single
from isomatch._core.threads import parallel_map, row_product
from isomatch.correspondence import Embedding, nearest_of_few, register_nonrigid
from isomatch.matching.smooth_pair import SmoothPair
from isomatch.surfaces import PrecisePoints, vertex_normals

# of the registration that ends the smooth refinement; lab/benchmarks.md, smoothness
SMOOTH_REGISTRATION_STEPS = 8

EVERYWHERE = slice(None)
S = TypeVar("S")
M = TypeVar("M")


def iterated(
    image: M,
    steps: Iterable[S],
    coordinates: Callable[[M, S], Embedding],
    nearest: Callable[[Embedding, S], tuple[IntArray, M]],
) -> tuple[M, float]:
    """Alternate coordinates and nearest points; returns the images and the mean distance of the nearest vertices."""
    spectral_residual = np.inf
    for step in steps:
        embedding = coordinates(image, step)
        row, image = nearest(embedding, step)
        spectral_residual = float(np.linalg.norm(embedding.target[row] - embedding.source, axis=1).mean())
    return image, spectral_residual


def refined_images(
    pair: SmoothPair, image: Int[BodyVertices, "r"], side: float, sizes: tuple[int, ...], with_positions: bool
) -> tuple[Int[BodyVertices, "r"], float]:
    """Refine the images of the refinement vertices in joint coordinates of more and more functions."""
    # Without positions, all but the last images are vertices among n_refine samples of the target. With them, images are
    # points of its triangles. Such points follow the coordinates continuously, where nearest vertices jump: where
    # coordinates are disturbed by 1e-9, fewer final images move (decisions.md, rounding).
    # side: 1 preserves the orientation of the faces, −1 reverses it
    samples = pair.target.sample_vertices[: pair.target.config.n_refine]
    steps = [(min(k, pair.n_functions), with_positions or k == sizes[-1]) for k in sizes]

    def coordinates(points: PrecisePoints, step: tuple[int, bool]) -> Embedding:
        k, everywhere = step
        onto = EVERYWHERE if everywhere else samples
        turned = side if with_positions else 0.0
        return joint_coordinates(pair, points, k, turned, pair.refinement_vertices, onto)

    def nearest(embedding: Embedding, step: tuple[int, bool]) -> tuple[IntArray, PrecisePoints]:
        if with_positions:
            points = pair.target.index.points(embedding.target, embedding.source)
            return points.corners[:, 0], points
        if step[1]:
            row = image = pair.target.index.vertices(embedding.target, embedding.source)
        else:
            row = nearest_of_few(embedding.target, embedding.source)
            image = samples[row]
        return row, PrecisePoints.at_vertices(image)

    points, spectral_residual = iterated(PrecisePoints.at_vertices(image), steps, coordinates, nearest)
    return BodyVertices(points.corners[:, 0]), spectral_residual


def registered(pair: SmoothPair, image: Int[BodyVertices, "r"], side: float, smooth: bool) -> Embedding:
    """Coordinates of all vertices of both bodies under a map, with all functions, after registration."""
    settings, k = pair.config.refining, pair.n_functions
    everywhere = np.arange(pair.source.body.n_vertices)
    embedding = joint_coordinates(pair, PrecisePoints.at_vertices(image), k, side, everywhere)
    steps = settings.registration_steps
    # signatures recognise points; the smooth variant does without: positions, normals and spectrum make a smoother map
    if smooth:
        steps = SMOOTH_REGISTRATION_STEPS
        signatures = np.s_[k : k + pair.signatures.source.shape[1]]
        embedding = Embedding(*(np.delete(x, signatures, axis=1) for x in embedding))
    source, target = pair.source, pair.target
    samples = target.sample_vertices[: target.config.n_refine]
    return register_nonrigid(embedding, source.index, target.index, pair.spectra.source, samples, steps)


def joint_coordinates(
    pair: SmoothPair,
    image: PrecisePoints,
    k: int,
    side: float,
    source_vertex: Int[IntArray, "q"],
    onto_vertex: IntArray | slice = EVERYWHERE,
) -> Embedding:
    """Coordinates of some vertices of both bodies under a map of the refinement vertices; images are nearest.

    Spectral coordinates of the first k functions, signatures, and unless ``side`` is 0 positions and normals. O(n K²).
    """
    # With f the map of the refinement vertices R, and Φ the Laplace–Beltrami functions (K columns):
    #   F = arg min ‖Φ_s[R, :k] F − Φ_t[f, :k]‖   (k, k): the functional map (Ovsjanikov et al. 2012), target → source;
    #   c = arg min ‖Φ_s[R, :k] c − x_t[f]‖       (k, 3): the target's positions as functions on the source.
    # The indicator of a vertex has its row of Φ as coefficients and F carries that of f(i) to that of i, so
    #   Φ_s[i] against Φ_t[f(i)] Fᵀ   is the spectral embedding, grown from k to k + 5 as in ZoomOut (Melzi et al. 2019);
    # positions and normals are further columns of the same embedding, as in Smooth Shells (Eisenberger et al. 2020):
    #   Φ_s c against Φ_t Φ_t⁺ x_t, the target drawn on the source against the target, both smoothed to k functions,
    #   and the normals of both. Both are the target's own, so the pose of neither shape matters; side = −1 turns the
    #   normals of the copy, which a mirror image turns inside out.
    # Units: 1/√k makes the mean square of the spectral columns independent of k; signatures have their own weight.
    settings, source, target = pair.config.refining, pair.source, pair.target
    basis, onto = pair.spectra.source, target.triangles
    with_positions = side != 0 and source.triangles is not None and onto is not None
    unit, weight = 1 / settings.position_unit, settings.normal_weight
    functional_map = basis.fit(image.interpolated(target.laplace.vectors[:, :k]), k) / np.sqrt(k)

    def of_source() -> FloatArray:
        phi = source.functions[:, :k]
        columns = [phi[source_vertex] * np.float32(1 / np.sqrt(k)), pair.signatures.source[source_vertex]]
        if with_positions:
            # Φ_s c: (n_s, k) @ (k, 3)
            drawn = row_product(phi, basis.fit(image.interpolated(target.mesh_body.vertices), k))
            normals = vertex_normals(drawn, source.faces)[source_vertex]
            columns += [single(unit * drawn[source_vertex]), single(side * weight * normals)]
        return np.hstack(columns)

    def of_target() -> FloatArray:
        phi = target.functions[onto_vertex, :k]
        # (n_t, k) @ (k, k)
        columns = [row_product(phi, functional_map.T), pair.signatures.target[onto_vertex]]
        if with_positions:
            smooth, normals = (x[onto_vertex] for x in target.smoothed(k))
            columns += [single(unit * smooth), single(weight * normals)]
        return np.hstack(columns)

    return Embedding(*parallel_map(lambda half: half(), (of_source, of_target)))
