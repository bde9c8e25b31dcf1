"""Gradients of eigenfunctions: scalars that isometries preserve, and pseudo-scalars whose sign a reflection changes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray

ComplexArray: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.complex128]]


def gradient_fields(mesh: Mesh, functions: FloatArray) -> ComplexArray:
    """Gradients of q functions (n, q) at the vertices, as complex numbers in a frame of each tangent plane: (n, q).

    Notes
    -----
    On a triangle of area A and normal N, A ∇f = ½ Σ_c f_c N × e_c, where e_c is the edge opposite to corner c. The
    gradient at a vertex is the mean over its triangles, weighted by area. It is linear in f, and the product
    z̄_f z_g = ⟨∇f, ∇g⟩ + i ⟨∇f × ∇g, N⟩ does not depend on the frame. Every isometry preserves its real part; its
    imaginary part changes sign with the orientation.
    """
    normals = mesh.vertex_normals
    along = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across = np.cross(normals, along)
    corner = mesh.vertices[mesh.faces]  # (m, 3, 3)
    opposite = np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1)
    doubled = np.cross(opposite[:, 0], opposite[:, 1])
    length = np.linalg.norm(doubled, axis=1, keepdims=True)
    unit = np.divide(doubled, length, out=np.zeros_like(doubled), where=length > 0)
    integrals = 0.5 * np.einsum("mcx,mcq->mxq", np.cross(unit[:, None], opposite), functions[mesh.faces])
    corners = mesh.faces.ravel(), np.repeat(np.arange(mesh.n_faces), 3)
    around = csr_array((np.ones(len(corners[0])), corners), shape=(mesh.n_vertices, mesh.n_faces))
    areas = np.maximum(around @ length / 2, 1e-300)
    gradients = (around @ integrals.reshape(mesh.n_faces, -1) / areas).reshape(mesh.n_vertices, 3, -1)
    turned: ComplexArray = np.einsum("nx,nxq->nq", along + 1j * across, gradients)
    return turned


def invariants(fields: ComplexArray, values: FloatArray) -> FloatArray:
    """Products of the gradients of successive functions, divided by the roots of their eigenvalues: (n, 2 (q − 1)).

    First the scalars ⟨∇φ_a, ∇φ_a+1⟩ / √(λ_a λ_a+1), then the pseudo-scalars ⟨∇φ_a × ∇φ_a+1, N⟩ / √(λ_a λ_a+1).
    """
    scaled = fields / np.sqrt(values)
    products = scaled[:, :-1].conj() * scaled[:, 1:]
    return np.hstack([products.real, products.imag])
