"""Joint coordinates: functions, signatures and positions in which images are nearest points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from isomatch._core.arrays import BodyVertices, FloatArray, Int, IntArray, single
from isomatch._core.cached import cached_property
from isomatch._core.threads import parallel_map, row_product
from isomatch.correspondence import Embedding, SpectralPair, nearest_of_few, register_nonrigid
from isomatch.settings import Config
from isomatch.shapes import SmoothShape
from isomatch.surfaces import PrecisePoints, vertex_normals


@dataclass(frozen=True, eq=False)
class SmoothPair:
    """Two bodies with their smooth functions."""

    source: SmoothShape
    target: SmoothShape
    config: Config
    functions: Embedding | None = None  # weighted values, at the users' vertices, of functions known on both

    @cached_property
    def refinement_vertices(self) -> Int[BodyVertices, "r"]:
        """Source vertices whose images refinements compute."""
        return BodyVertices(self.source.sample_vertices[: self.source.config.n_refine])

    @cached_property
    def signatures(self) -> Embedding:
        """Point signatures that both shapes have, and known functions."""
        both = self.source.signatures, self.target.signatures
        n_common = min(signatures.shape[1] for signatures in both)
        return Embedding(
            *(single(np.hstack([x[:, :n_common], functions])) for x, functions in zip(both, self.known))
        )

    @cached_property
    def known(self) -> Embedding:
        """The known functions on the bodies, without columns if there are none."""
        if self.functions is None:
            return Embedding(*(np.zeros((shape.body.n_vertices, 0)) for shape in (self.source, self.target)))
        source, target = self.functions
        return Embedding(self.source.restrict(source), self.target.restrict(target))

    @cached_property
    def spectra(self) -> SpectralPair:
        """The Laplace–Beltrami bases, for maps from refinement vertices to target vertices."""
        return SpectralPair(
            self.source.sampled_basis(self.source.config.n_refine),
            self.target.laplace.vectors,
            self.target.index.vertices,
        )

    @property
    def n_functions(self) -> int:
        """Number of Laplace–Beltrami functions that both shapes have."""
        return min(len(self.source.laplace.values), len(self.target.laplace.values))

    @property
    def oriented(self) -> bool:
        """Whether both shapes have an inside, so that normals and curvature can be compared."""
        return self.source.triangles is not None and self.target.triangles is not None


SMOOTH_REGISTRATION_STEPS = 8  # number of registration steps that end "smooth": lab/benchmarks.md, smoothness

# stands for all vertices where a function takes an array of vertices
ALL_VERTICES = slice(None)
S = TypeVar("S")
M = TypeVar("M")


def iterate_images(
    image: M,
    steps: Iterable[S],
    coordinates: Callable[[M, S], Embedding],
    nearest: Callable[[Embedding, S], tuple[IntArray, M]],
) -> tuple[M, float]:
    """Alternate coordinates and nearest points; return images, and the mean distance of vertices from images."""
    spectral_residual = np.inf
    for step in steps:
        embedding = coordinates(image, step)
        row, image = nearest(embedding, step)
        spectral_residual = float(np.linalg.norm(embedding.target[row] - embedding.source, axis=1).mean())
    return image, spectral_residual


def refine_images(
    pair: SmoothPair, image: Int[BodyVertices, "r"], side: float, sizes: tuple[int, ...], with_positions: bool
) -> tuple[Int[BodyVertices, "r"], float]:
    """Refine the images of the refinement vertices in joint coordinates of more and more functions.

    ``side`` is 1 for a map that preserves the orientation of the faces, and −1 for one that reverses it.
    """
    # Without positions, images are samples of the target, and any of its vertices in the last step. With
    # positions, images are points of its triangles. Points follow the coordinates continuously, while nearest
    # vertices jump: if coordinates are disturbed by 1e-9, fewer final images move (decisions.md, rounding).
    samples = pair.target.sample_vertices[: pair.target.config.n_refine]
    steps = [(min(k, pair.n_functions), with_positions or k == sizes[-1]) for k in sizes]

    def coordinates(points: PrecisePoints, step: tuple[int, bool]) -> Embedding:
        k, to_all_vertices = step
        onto = ALL_VERTICES if to_all_vertices else samples
        position_side = side if with_positions else 0.0
        return joint_coordinates(pair, points, k, position_side, pair.refinement_vertices, onto)

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

    points, spectral_residual = iterate_images(PrecisePoints.at_vertices(image), steps, coordinates, nearest)
    return BodyVertices(points.corners[:, 0]), spectral_residual


def register_map(pair: SmoothPair, image: Int[BodyVertices, "r"], side: float, smooth: bool) -> Embedding:
    """Joint coordinates of all vertices of both bodies, after registration."""
    settings, k = pair.config.refining, pair.n_functions
    all_vertices = np.arange(pair.source.body.n_vertices)
    embedding = joint_coordinates(pair, PrecisePoints.at_vertices(image), k, side, all_vertices)
    steps = settings.registration_steps
    # Signatures match details; without signatures, positions, normals and functions make a smoother map.
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
    onto_vertex: IntArray | slice = ALL_VERTICES,
) -> Embedding:
    """Joint coordinates of some vertices of both bodies, from a map of the refinement vertices.

    They are spectral coordinates of the first k functions, signatures, and, unless ``side`` is 0, positions and
    normals. O(n K²).
    """
    # Let f be the map of the refinement vertices R, Φ_s and Φ_t the Laplace–Beltrami functions of source and
    # target (K columns each), and x_t the positions of the target's vertices.
    #   F = arg min ‖Φ_s[R, :k] F − Φ_t[f, :k]‖   (k, k): functional map (Ovsjanikov et al. 2012)
    #   c = arg min ‖Φ_s[R, :k] c − x_t[f]‖       (k, 3): target positions on the source
    # The indicator of a vertex has its row of Φ as coefficients, and F carries the row of f(i) to the row of
    # i. So the spectral coordinates of i and f(i), for k grown by 5 as in ZoomOut (Melzi et al. 2019), are
    #   Φ_s[i]  and  Φ_t[f(i)] Fᵀ.
    # Positions and normals are further columns, as in Smooth Shells (Eisenberger et al. 2020):
    #   Φ_s c  and  Φ_t Φ_t⁺ x_t,
    # which are a copy of the target drawn on the source, and the target, both smoothed to k functions. As
    # both come from the target, the pose of the source does not matter. A map that reverses the orientation
    # turns the copy inside out, so side = −1 reverses the normals of the copy. The factor 1/√k makes the mean
    # square of the spectral columns independent of k.
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
        # Φ_t Fᵀ: (n_t, k) @ (k, k)
        columns = [row_product(phi, functional_map.T), pair.signatures.target[onto_vertex]]
        if with_positions:
            smooth, normals = (x[onto_vertex] for x in target.smoothed(k))
            columns += [single(unit * smooth), single(weight * normals)]
        return np.hstack(columns)

    return Embedding(*parallel_map(lambda half: half(), (of_source, of_target)))
