"""The energy of an as-rigid-as-possible deformation: changes of edges, up to local rotations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.correspondence.poses import nearest_rotation
from isomatch.spectral import stiffness_and_masses
from isomatch.surfaces import Mesh

MAX_TURNS = 20  # largest number of corrections of one rotation in `improve_rotations`; chosen
MIN_TURN_ANGLE = 1e-4  # radians; a correction of a rotation by a smaller angle is the last one; chosen
MIN_DENOMINATOR = 1e-30  # areas and lengths in a denominator are raised to this, so that none is 0; chosen
EDGE_FACTOR = 2 / 3  # factor in the weight of an edge; 2/3 gives equilateral triangles cotangent weights
MAX_EDGE_WEIGHT = 20.0  # larger edge weights, as of short edges of slivers, are lowered to this; chosen
# Conjugate gradients end once the residual, over the first residual, is at most this; chosen: the next step
# starts from the result.
MAX_RESIDUAL_RATIO = 1e-2
MAX_ITERATIONS = 100  # largest number of iterations of conjugate gradients; chosen


@dataclass(frozen=True, eq=False)
class RigidEnergy:
    """½ Σ_i Σ_j w_ij |(y_i − y_j) − R_i (x_i − x_j)|² of vertices x_i that move to y_i."""

    # Sorkine & Alexa, *As-Rigid-As-Possible Surface Modeling*, SGP 2007. Each vertex i has a rotation R_i,
    # which its edges e_ij = x_i − x_j should follow: e'_ij = y_i − y_j ≈ R_i e_ij. The energy is lowered
    # alternately in the rotations and in y. Local step: given y, each R_i is the rotation that maximises
    #   Σ_j w_ij e'_ij · R_i e_ij = tr(R_i Σ_i),  Σ_i = Σ_j w_ij e_ij e'_ijᵀ,
    # Kabsch's rotation for Σ_iᵀ. Global step: given the rotations, the derivative by y_i, where
    # each edge counts from both ends,
    #   ∂E/∂y_i = 2 Σ_j w_ij (e'_ij − ½ (R_i + R_j) e_ij),
    # vanishes for all i if L y = p with the *pulls* p_i = Σ_j w_ij ½ (R_i + R_j) e_ij.
    stiffness: csc_array  # the matrix L (n, n): −w_ij off the diagonal, rows sum to 0
    areas: FloatArray  # the areas (n,) of the vertices in squared units of the surface
    start: IntArray  # vertex i has the neighbours neighbours[start[i]:start[i + 1]], (n + 1,)
    neighbours: IntArray  # the vertex j at the end of each edge from a vertex i, (e,)
    weights: FloatArray  # the weight w_ij of each edge in ``neighbours``, (e,)

    @classmethod
    def of_surface(cls, mesh: Mesh) -> RigidEnergy:
        """Take the weights of the tufted intrinsic Delaunay triangulation, independent of the triangles."""
        return cls._of(*stiffness_and_masses(mesh))

    @classmethod
    def of_edges(cls, mesh: Mesh) -> RigidEnergy:
        """Weight each edge of the mesh by its area over its squared length: even slivers keep their shape."""
        # w_ij = ⅔ √(a_i a_j) / |x_i − x_j|², at most MAX_EDGE_WEIGHT. In a grid of equilateral triangles with
        # edges of length h, a vertex has a third of six triangles of area √3 h² / 4, which is √3 h² / 2:
        # w = 1 / √3 = ½ (cot 60° + cot 60°), the cotangent weight.
        areas = np.maximum(mesh.vertex_areas, MIN_DENOMINATOR)
        i, j = mesh.edges.T
        lengths = np.maximum(mesh.edge_lengths, MIN_DENOMINATOR)
        weights = np.minimum(EDGE_FACTOR * np.sqrt(areas[i] * areas[j]) / lengths**2, MAX_EDGE_WEIGHT)
        links = coo_array((weights, (i, j)), shape=(len(areas),) * 2)
        links = (links + links.T).tocsr()
        return cls._of(csc_array(diags_array(links.sum(axis=1)) - links), areas)

    @classmethod
    def _of(cls, stiffness: csc_array, areas: FloatArray) -> RigidEnergy:
        links = coo_array(stiffness)
        is_edge = links.row != links.col  # L_ij = −w_ij off the diagonal
        row, column, value = (array[is_edge] for array in (links.row, links.col, links.data))
        order = np.lexsort((column, row))
        start = np.append(0, np.cumsum(np.bincount(row, minlength=len(areas))))
        return cls(stiffness, areas, start, column[order].astype(np.int64), -value[order])

    def pulls(
        self, before: FloatArray, moved: FloatArray, turn: FloatArray | None, most_scaled: float = 1.0
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the pulls (n, 3), and the best rotations (n, 3, 3), sought near ``turn`` if given."""
        # The edges around a vertex are allowed to grow or shrink by the factor ``most_scaled`` at no cost.
        covariances, pulls = np.zeros((len(self.areas), 3, 3)), np.zeros(before.shape)
        _covariances(before, moved, self.start, self.neighbours, self.weights, covariances)
        if turn is None:
            rotations = scaled = nearest_rotation(covariances).transpose(0, 2, 1)
        else:
            rotations = scaled = improve_rotations(turn, covariances)
        if most_scaled > 1.0:
            # As similar as possible: R_i becomes s_i R_i. Σ_j w_ij |e'_ij − s R_i e_ij|² is least at
            # s_i = tr(R_i Σ_i) / Σ_j w_ij |e_ij|², which is clipped to 1 / most_scaled … most_scaled.
            owner = np.repeat(np.arange(len(before)), np.diff(self.start))
            squares = self.weights * ((before[owner] - before[self.neighbours]) ** 2).sum(axis=1)
            squares = np.maximum(np.bincount(owner, squares, len(before)), MIN_DENOMINATOR)
            scales = np.einsum("nij,nji->n", rotations, covariances) / squares
            scaled = rotations * np.clip(scales, 1.0 / most_scaled, most_scaled)[:, None, None]
        _sum_pulls(before, scaled, self.start, self.neighbours, self.weights, pulls)
        return pulls, rotations

    def solve(self, diagonal: FloatArray, right: FloatArray, start: FloatArray) -> FloatArray:
        """Solve (L + diag(d)) y = b (n, 3), d > 0, approximately from a guess, by conjugate gradients."""
        # Iterations end when the residual is a hundredth of the first one: enough if the next step starts
        # from the result. An iteration takes time linear in the number of edges. Small d, as for bending over
        # long lengths, needs more iterations.
        y = start.copy()
        _conjugate_gradients(self.start, self.neighbours, self.weights, diagonal, right, y)
        return y

    def scale(self, before: FloatArray, moved: FloatArray, pulls: FloatArray) -> float:
        """Compute the best factor to enlarge the surface at rest, given the `pulls`: (y · p) / (x · L x)."""
        # Σ_i Σ_j w_ij |e'_ij − s R_i e_ij|² is least at s = Σ w e' · R e / Σ w |e|², sums over all i and j.
        # As each edge counts from both ends, with e_ji = −e_ij, the numerator is 2 Σ_i y_i · p_i, and the
        # denominator 2 x · L x.
        return float((moved * pulls).sum() / max((before * (self.stiffness @ before)).sum(), MIN_DENOMINATOR))


@compiled()
def _conjugate_gradients(
    start: IntArray,
    neighbours: IntArray,
    weights: FloatArray,
    diagonal: FloatArray,
    right: FloatArray,
    y: FloatArray,
) -> None:
    """Improve y for three right-hand sides at once, preconditioned by the diagonal of the matrix."""
    # Hestenes & Stiefel 1952 for A y = b with A = L + diag(d) and the preconditioner M = diag(A). With
    # r = b − A y and z = M⁻¹ r, and r' and z' of the step before, directions are
    # s ← z + ((r · z) / (r' · z')) s and steps y ← y + ((r · z) / (s · A s)) s, until r · z of each column is
    # at most MAX_RESIDUAL_RATIO² of the first one.
    n = len(y)
    total, residual, step, product = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    first, before, now, along, share = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(n):
        total[i] = diagonal[i]
        for e in range(start[i], start[i + 1]):
            total[i] += weights[e]
    _multiply_columns(start, neighbours, weights, total, y, product)
    for i in range(n):
        for c in range(3):
            residual[i, c] = right[i, c] - product[i, c]
    for iteration in range(MAX_ITERATIONS):
        now[:] = 0.0
        for i in range(n):
            for c in range(3):
                now[c] += residual[i, c] ** 2 / total[i]
        is_near = True
        for c in range(3):
            if iteration == 0:
                first[c] = now[c]
            is_near &= now[c] <= MAX_RESIDUAL_RATIO**2 * first[c]
        if is_near:
            break
        for c in range(3):
            share[c] = now[c] / before[c] if iteration > 0 and before[c] > 0.0 else 0.0
            before[c] = now[c]
        for i in range(n):
            for c in range(3):
                step[i, c] = residual[i, c] / total[i] + share[c] * step[i, c]
        _multiply_columns(start, neighbours, weights, total, step, product)
        along[:] = 0.0
        for i in range(n):
            for c in range(3):
                along[c] += product[i, c] * step[i, c]
        for c in range(3):
            share[c] = now[c] / along[c] if along[c] > 0.0 else 0.0
        for i in range(n):
            for c in range(3):
                y[i, c] += share[c] * step[i, c]
                residual[i, c] -= share[c] * product[i, c]


@compiled(inline="always")
def _multiply_columns(
    start: IntArray,
    neighbours: IntArray,
    weights: FloatArray,
    total: FloatArray,
    x: FloatArray,
    product: FloatArray,
) -> None:
    """Set the product of L + diag(d), given its diagonal ``total``, and the three columns of x."""
    for i in range(len(x)):
        a, b, c = total[i] * x[i, 0], total[i] * x[i, 1], total[i] * x[i, 2]
        for e in range(start[i], start[i + 1]):
            j, weight = neighbours[e], weights[e]
            a -= weight * x[j, 0]
            b -= weight * x[j, 1]
            c -= weight * x[j, 2]
        product[i, 0], product[i, 1], product[i, 2] = a, b, c


@compiled()
def _covariances(
    before: FloatArray,
    after: FloatArray,
    start: IntArray,
    neighbours: IntArray,
    weights: FloatArray,
    covariances: FloatArray,
) -> None:
    """Set the covariances (n, 3, 3) of the edges around each vertex before and after a deformation."""
    covariances[:] = 0.0
    for i in range(len(before)):
        for e in range(start[i], start[i + 1]):
            j, weight = neighbours[e], weights[e]
            for row in range(3):
                edge = weight * (before[i, row] - before[j, row])
                for column in range(3):
                    covariances[i, row, column] += edge * (after[i, column] - after[j, column])


@compiled()
def _sum_pulls(
    before: FloatArray,
    turn: FloatArray,
    start: IntArray,
    neighbours: IntArray,
    weights: FloatArray,
    pulls: FloatArray,
) -> None:
    """Set the sums (n, 3) of w_ij times the edges around each vertex, rotated by the mean of R_i and R_j."""
    pulls[:] = 0.0
    for i in range(len(before)):
        for e in range(start[i], start[i + 1]):
            j, weight = neighbours[e], 0.5 * weights[e]
            for row in range(3):
                for column in range(3):
                    edge = before[i, column] - before[j, column]
                    pulls[i, row] += weight * (turn[i, row, column] + turn[j, row, column]) * edge


@compiled()
def improve_rotations(turn: FloatArray, covariances: FloatArray) -> FloatArray:
    """Turn rotations (n, 3, 3) that nearly maximise the trace of R Σ until they maximise it."""
    # Müller, Bender, Chentanez & Macklin, *A Robust Method to Extract the Rotational Part of
    # Deformations*, MIG 2016. A small turn by the vector ω changes tr(R Σ) by tr([ω]× m) = ω · a, m
    # = R Σ, with a the axial vector of the skew part of m: the trace grows fastest around a, and is
    # greatest where a = 0, so that m is symmetric. Around the unit axis n its second derivative is
    # n · m n − tr m. Newton's step for the angle would be |a| / (tr m − n · m n); without the last
    # term, as here, it is shorter and does not overshoot.
    rotations, step, r, m = turn.copy(), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for i in range(len(turn)):
        _multiply(rotations[i], covariances[i], m)
        for _ in range(MAX_TURNS):
            # m = R Σ is symmetric where its trace is largest. The axial vector of its skew part is
            # the axis of the missing turn; its length over the trace is roughly the angle.
            x, y, z = m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]
            size = np.sqrt(x * x + y * y + z * z)
            angle = size / (abs(m[0, 0] + m[1, 1] + m[2, 2]) + MIN_DENOMINATOR)
            if angle < MIN_TURN_ANGLE:
                break
            # Rodrigues' formula for the turn: cos(angle) I + sin(angle) [axis]× + (1 − cos(angle)) axis axisᵀ
            x, y, z, sine, rest = x / size, y / size, z / size, np.sin(angle), 1 - np.cos(angle)
            step[0, 0], step[1, 1], step[2, 2] = rest * x * x, rest * y * y, rest * z * z
            for k in range(3):
                step[k, k] += 1 - rest
            step[0, 1], step[1, 0] = rest * x * y - sine * z, rest * x * y + sine * z
            step[2, 0], step[0, 2] = rest * z * x - sine * y, rest * z * x + sine * y
            step[1, 2], step[2, 1] = rest * y * z - sine * x, rest * y * z + sine * x
            for row in range(3):
                for column in range(3):
                    r[row, column] = rotations[i, row, column]
            _multiply(step, r, rotations[i])
            _multiply(rotations[i], covariances[i], m)
    return rotations


@compiled()
def _multiply(a: FloatArray, b: FloatArray, product: FloatArray) -> None:
    for row in range(3):
        for column in range(3):
            total = 0.0
            for k in range(3):
                total += a[row, k] * b[k, column]
            product[row, column] = total
