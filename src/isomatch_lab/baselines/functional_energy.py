"""The quadratic energy of a functional map that preserves functions and commutes with operators; its minimiser."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve

from isomatch.bases import LaplaceBasis
from isomatch.runtime.memory import require_memory
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray

RIDGE = 1e-9  # of the mean diagonal entry; decides where the energy is flat


class FunctionalEnergy:
    """Sum of squares in the entries of F (k_s, k_t), functions of the target to the source.

    Every term is added with its weight; `minimiser` solves the normal equations of all k_s k_t entries at once.
    """

    def __init__(self, k_source: int, k_target: int) -> None:
        n = k_source * k_target
        require_memory(
            32.0 * n**2,
            f"the energy of a functional map of {k_source} × {k_target}",
            "ask for fewer functions",
        )
        self._shape = k_source, k_target
        self._hessian, self._gradient = np.zeros((n, n)), np.zeros((k_source, k_target))

    def preserve(self, of_source: FloatArray, of_target: FloatArray, weight: float) -> None:
        """Add the mean over q functions of ‖F b − a‖², with coefficients a (k_s, q) and b (k_t, q)."""
        share = weight / max(of_target.shape[1], 1)
        self._hessian += np.kron(np.eye(self._shape[0]), share * of_target @ of_target.T)
        self._gradient += share * of_source @ of_target.T

    def commute(self, of_source: FloatArray, of_target: FloatArray, weight: float) -> None:
        """Add the mean over q operators of ‖F B − A F‖², with A (q, k_s, k_s) and B (q, k_t, k_t).

        Σ_ab (Σ_j F_aj B_jb − Σ_i A_ai F_ib)²: the mixed part couples F_aj with F_ib by A_ai B_jb.
        """
        share = weight / max(len(of_target), 1)
        size = self._hessian.shape
        mixed = np.tensordot(of_source, of_target, (0, 0)).transpose(0, 2, 1, 3).reshape(size)  # (a, i, j, b)
        square_target = np.einsum("fjb,flb->jl", of_target, of_target, optimize=True)
        square_source = np.einsum("fai,fal->il", of_source, of_source, optimize=True)
        self._hessian += share * (
            np.kron(np.eye(self._shape[0]), square_target)
            + np.kron(square_source, np.eye(self._shape[1]))
            - mixed
            - mixed.T
        )

    def penalise(self, entries: FloatArray, weight: float) -> None:
        """Add Σ p_ij F_ij², with penalties (k_s, k_t)."""
        self._hessian[np.diag_indices_from(self._hessian)] += weight * entries.ravel()

    def minimiser(self, known: FloatArray | None = None) -> FloatArray:
        """Return the F of least energy; O((k_s k_t)³). Entries of ``known`` (k_s, k_t) other than nan are prescribed."""
        entries = np.full(self._shape, np.nan) if known is None else known.copy()
        free = np.isnan(entries).ravel()
        rows = self._hessian[free]
        right = self._gradient.ravel()[free] - rows[:, ~free] @ entries.ravel()[~free]
        hessian = rows[:, free]
        diagonal = np.diag_indices_from(hessian)
        hessian[diagonal] += RIDGE * hessian[diagonal].mean()
        entries[np.isnan(entries)] = solve(hessian, right, assume_a="pos", check_finite=False)
        return entries


def products(basis: LaplaceBasis, coefficients: FloatArray) -> FloatArray:
    """Multiplication by each of q functions (k, q) as an operator on the first k functions: (q, k, k).

    Notes
    -----
    Φᵀ A diag(f) Φ of Nogneng & Ovsjanikov, *Informative Descriptor Preservation via Commutativity for Surface Matching*,
    Eurographics 2017.
    """
    phi = basis.vectors[:, : len(coefficients)]
    weighted = (phi @ coefficients) * basis.weights[:, None]  # (n, q)
    return np.array([phi.T @ (column[:, None] * phi) for column in weighted.T])


def orientations(basis: LaplaceBasis, mesh: Mesh, coefficients: FloatArray) -> FloatArray:
    """Operators g ↦ ⟨∇f × ∇g, n⟩ of q functions f (k, q): (q, k, k); a reflection changes their sign.

    Notes
    -----
    Ren, Poulenard, Wonka & Ovsjanikov, *Continuous and Orientation-Preserving Correspondences via Functional Maps*,
    SIGGRAPH Asia 2018. On a triangle (a, b, c) the integral of ⟨∇f × ∇g, n⟩ is half of
    (f_b − f_a)(g_c − g_a) − (f_c − f_a)(g_b − g_a) = g_a (f_c − f_b) + g_b (f_a − f_c) + g_c (f_b − f_a),
    whatever its shape.
    """
    phi = basis.vectors[:, : len(coefficients)]
    functions = phi @ coefficients
    corners = phi[mesh.faces]  # (m, 3, k)
    tested = corners.mean(axis=1).T / 2
    across = np.roll(functions[mesh.faces], 1, axis=1) - np.roll(
        functions[mesh.faces], -1, axis=1
    )  # (m, 3, q)
    return np.array(
        [tested @ np.einsum("mc,mck->mk", across[..., q], corners) for q in range(across.shape[2])]
    )
