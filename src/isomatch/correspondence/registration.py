"""Registration: a surface moved onto another one, smoothly in any space, or as rigidly as possible."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from scipy.linalg import solve

from isomatch._core.arrays import FloatArray, IntArray, single
from isomatch._core.cached import cached_method, cached_property
from isomatch._core.errors import SettingError
from isomatch._core.threads import parallel_map, row_product
from isomatch.correspondence.functional_maps import Embedding, SampledBasis
from isomatch.correspondence.nearest import SurfaceIndex
from isomatch.correspondence.rigid_energy import RigidEnergy
from isomatch.spectral import factorise_for_threads
from isomatch.surfaces import Mesh, PrecisePoints

NORMAL_UNIT = 0.1  # length of a normal appended to a position as coordinates, at surface area 1; chosen
ROTATION_FITS = 2  # fits of rotations, then positions, between two searches for nearest points; chosen
# ridge in `register_nonrigid`, over the number of equations; chosen above the rounding of single precision
RIDGE_PER_EQUATION = 1e-6


class RigidRegistration:
    """As-rigid-as-possible registrations of one surface, which share its Laplacian.

    With ``keeps``, the factors of each length are kept for further registrations with the same
    length, scale and held vertices, about 1 kB a vertex and length.

    Examples
    --------
    An octahedron is bent onto itself from positions that are a tenth smaller.

    >>> from isomatch.correspondence import VertexCells
    >>> faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    >>> octahedron = Mesh(np.concatenate([np.eye(3), -np.eye(3)]), faces)
    >>> index = SurfaceIndex(octahedron.faces, VertexCells.of(np.array([0]), np.zeros(6, dtype=int)))
    >>> bent = RigidRegistration(octahedron)(octahedron, index, 0.9 * octahedron.vertices, lengths=[10.0, 10.0])
    >>> bool(np.allclose(bent, octahedron.vertices, atol=1e-2))
    True
    """

    def __init__(self, source: Mesh, keeps: bool = False) -> None:
        self.source = source
        self.keeps = keeps

    @cached_property
    def _energy(self) -> RigidEnergy:
        return RigidEnergy.of_surface(self.source)

    def _new_solver(
        self, length: float, scale: float, held: tuple[int, ...]
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """Return the strengths (n,) of attraction to points, and the function that solves for positions."""
        # ∇E = 0 for the energy E of `__call__`, divided by ℓ², is (L + a / ℓ²) y = a p / ℓ² + Σ_j w_ij ½
        # (R_i + R_j) (x_i − x_j), with a = scale² areas. A held vertex has a = π ℓ², the area of a disc of
        # radius ℓ.
        pull = self._energy.areas * (scale / length) ** 2
        pull[list(held)] = np.pi
        return pull, factorise_for_threads(self._energy.stiffness, pull)

    _kept_solver = cached_method(_new_solver)

    def __call__(
        self,
        target: Mesh,
        index: SurfaceIndex,
        positions: FloatArray,
        lengths: Iterable[float],
        scale: float = 1.0,
        normal_unit: float = NORMAL_UNIT,
        held: tuple[IntArray, FloatArray] | None = None,
        most_scaled: float = 1.0,
    ) -> FloatArray:
        """Bend the source, ``scale`` times as large, onto the target, with as little change of lengths as possible.

        If a map crowds or spreads its images, as near a boundary, the bent surface keeps its own
        spacing. ``positions`` are the images (n_source, 3) under a map, in the units of both surfaces,
        and ``index`` is the index of the target. In a step of length ℓ, the source resists stretching
        over lengths up to ℓ: decreasing lengths first move large pieces, then small ones. ``held`` are
        vertices (l,) of the source and points (l, 3) that attract them, each as strongly as a disc of
        radius ℓ. Returns the source's vertices (n_source, 3), on the target or near it.

        Pieces may grow or shrink by the factor ``most_scaled`` at no cost: 1 keeps lengths, and
        more makes the registration as similar as possible, for shapes whose limbs differ in size.
        `SettingError` if a length is not above 0, or ``most_scaled`` is below 1.
        """
        # With vertices x_i that move to y_i, areas a_i, points p_i on the target, weights w of the tufted
        # intrinsic Delaunay triangulation and rotations R_i, each step of length ℓ lowers
        #   Σ_i a_i |y_i − p_i|² + ½ ℓ² Σ_i Σ_j w_ij |(y_i − y_j) − R_i (x_i − x_j)|²,
        # alternately in R and in y. The second sum is the energy of Sorkine & Alexa 2007 (`RigidEnergy`).
        # Between two steps p_i moves to the target's point nearest to y_i. A pull on one vertex decays within
        # the length ℓ, because (A + ℓ² L) y = A p is a screened Poisson equation. A step takes 25 ms for 5000
        # vertices: a factorisation, and n nearest points in six dimensions.
        lengths = tuple(lengths)
        if not most_scaled >= 1.0:
            raise SettingError(f"most_scaled = {most_scaled}; expected a number of at least 1")
        if not all(length > 0 for length in lengths):
            raise SettingError(f"lengths are {lengths}; expected numbers above 0")
        energy, before, turn = self._energy, scale * self.source.vertices, None
        wanted, moved = positions, positions
        vertices, points = held or (np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
        for step, length in enumerate(lengths):
            if step > 0:
                nearest = nearest_with_normals(self.source.moved(moved), target, index, normal_unit)
                wanted = nearest.interpolated(target.vertices)
            solver = self._kept_solver if self.keeps else self._new_solver
            pull, solve = solver(length, scale, tuple(vertices.tolist()))
            attraction = pull[:, None] * wanted
            attraction[vertices] = np.pi * points
            for _ in range(ROTATION_FITS):
                pulls, turn = energy.pulls(before, moved, turn, most_scaled)
                moved = np.ascontiguousarray(solve(attraction + pulls))
        return moved


def nearest_with_normals(
    queries: Mesh, surface: Mesh, index: SurfaceIndex, unit: float = NORMAL_UNIT
) -> PrecisePoints:
    """Find the point of a surface nearest to each vertex of a mesh, in space and in normals times a unit.

    It minimises ‖x − y‖² + unit² ‖n(x) − n(y)‖². Normals distinguish sheets that lie close
    together, such as both sides of a thin part. The default unit is for surfaces of area about 1.

    Examples
    --------
    The query between two sheets faces up and is nearer to the lower one, which faces down.

    >>> from isomatch.correspondence import VertexCells
    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> sheets = Mesh(np.concatenate([corners, corners - [0, 0, 0.02]]), [[0, 1, 2], [3, 5, 4]])
    >>> index = SurfaceIndex(sheets.faces, VertexCells.of(np.array([0]), np.zeros(6, dtype=int)))
    >>> query = Mesh(corners - [0, 0, 0.012], [[0, 1, 2]])
    >>> nearest_with_normals(query, sheets, index).corners[:, 0]
    array([0, 1, 2])
    >>> nearest_with_normals(query, sheets, index, unit=0.0).corners[:, 0]
    array([3, 4, 5])
    """
    return index.points(with_normals(surface, unit), with_normals(queries, unit))


def with_normals(mesh: Mesh, unit: float = NORMAL_UNIT) -> FloatArray:
    """Append vertex normals times a unit to the positions of a mesh, (n, 6); `nearest_with_normals`.

    Examples
    --------
    >>> with_normals(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), unit=0.5)[1]
    array([1. , 0. , 0. , 0. , 0. , 0.5])
    """
    return np.hstack([mesh.vertices, unit * mesh.vertex_normals])


def register_nonrigid(
    embedding: Embedding,
    source: SurfaceIndex,
    target: SurfaceIndex,
    displacements: SampledBasis,
    target_vertices: IntArray,
    steps: int,
) -> Embedding:
    """Move the source, in the space of an embedding, smoothly onto the fixed target.

    A displacement combines the functions (n_s, K) of ``displacements``, whose vertices are the
    source's samples; ``target_vertices`` (m_t,) are the target's. A step is O(m √n d + n K d).

    Examples
    --------
    A square is moved onto a copy shifted by 0.1. Displacements are constant: one step suffices.

    >>> from isomatch.correspondence import VertexCells
    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> index = SurfaceIndex(np.zeros((0, 3), dtype=int), VertexCells.of(np.array([0]), np.zeros(4, dtype=int)))
    >>> both, every = Embedding(square, square + [0.1, 0.0]), np.arange(4)
    >>> moved = register_nonrigid(both, index, index, SampledBasis(np.ones((4, 1)), every), every, steps=1)
    >>> moved.source.round(4)[:2].tolist()
    [[0.1, 0.0], [1.1, 0.0]]
    """
    # In each step the samples of either surface find their nearest points on the other surface. The
    # displacement u = Φ c that joins all these pairs (x, y) best, in the sum of |x + u(x) − y|², is
    # applied to the undisplaced source. As the surfaces come to coincide, the map between them
    # becomes smooth, and its two directions become inverse to each other, as in Ezuz, Solomon &
    # Ben-Chen, *Reversible Harmonic Maps between Discrete Surfaces*, TOG 2019. The normal equations
    # are (ΦᵀΦ + ridge) c = Φᵀ (y − x), with the rows of Φ at x.
    fixed = embedding.target
    functions, source_vertices = displacements.functions, displacements.vertices
    moved, at_samples = embedding.source, single(displacements.at_samples)
    for _ in range(steps):
        searches = (target, fixed, moved[source_vertices]), (source, moved, fixed[target_vertices])
        forth, back = parallel_map(lambda search: search[0].points(*search[1:]), searches)
        # At a sample s of the source, u(s) is the nearest target point minus s; at the source point nearest
        # to a sample t of the target, u is t minus that source point.
        design = np.vstack([at_samples, back.interpolated(functions)])
        from_source = forth.interpolated(fixed) - embedding.source[source_vertices]
        to_target = fixed[target_vertices] - back.interpolated(embedding.source)
        wanted = np.vstack([from_source, to_target])
        ridge = RIDGE_PER_EQUATION * len(design) * np.eye(design.shape[1])
        gram = (design.T @ design).astype(np.float64) + ridge
        coefficients = solve(gram, (design.T @ wanted).astype(np.float64), assume_a="pos")
        moved = embedding.source + row_product(functions, coefficients)
    return Embedding(moved, fixed)
