"""Faces that a deformation turns over, against the rotation of the surface around them; and how they are turned back."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, eye_array

from isomatch.correspondence.rotation import nearest_rotation
from isomatch.surfaces import Mesh
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

ROUNDS, REFITTED = 60, 10  # of turning back; rounds after which rotations are fitted again
TURNED_WEIGHT = 30.0  # of a face that is turned over, beside the others at its corners


def turned_faces(mesh: Mesh, moved: FloatArray, rotations: FloatArray | None = None) -> BoolArray:
    """Find the faces that are turned over against the rotation of the surface around them.

    Where a thin wall has two sides, the nearest point of another surface may belong to either. So a face is not compared
    with that surface, but with its own neighbourhood.

    Parameters
    ----------
    mesh : Mesh
        The surface with m faces at rest.
    moved : (n, 3) array of float
        Where its vertices are.
    rotations : (n, 3, 3) array of float, optional
        Rotation of the surface around each vertex; by default `neighbourhood_rotations`.

    Returns
    -------
    (m,) array of bool

    Examples
    --------
    The middle of a square, moved over one of its sides, turns the face at that side over.

    >>> corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0]]
    >>> square = Mesh(corners, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> moved = square.vertices.copy()
    >>> moved[4] = [1.0, -0.5, 0.0]
    >>> turned_faces(square, moved)
    array([ True, False, False, False])
    """
    if rotations is None:
        rotations = neighbourhood_rotations(mesh, moved)
    return _are_turned(mesh, mesh.faces, moved, rotations)


def neighbourhood_rotations(mesh: Mesh, moved: FloatArray) -> FloatArray:
    """Fit a rotation to each vertex and the two rings around it.

    Parameters
    ----------
    mesh : Mesh
        The surface with n vertices at rest.
    moved : (n, 3) array of float
        Where its vertices are.

    Returns
    -------
    (n, 3, 3) array of float
        R_i, which minimises Σ_j |y_j − ȳ − R_i (x_j − x̄)|² over vertices j at most two edges away from i. 20 µs each.

    Examples
    --------
    >>> wedge = Mesh([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> neighbourhood_rotations(wedge, wedge.vertices[:, [1, 2, 0]])[0].round(6) + 0.0
    array([[0., 1., 0.],
           [0., 0., 1.],
           [1., 0., 0.]])
    """
    return _rotations(mesh, moved, _two_rings(mesh))


def is_mirrored(mesh: Mesh, moved: FloatArray) -> bool:
    """Whether a deformation is more like a mirror image than like a rotation around most vertices.

    Parameters
    ----------
    mesh : Mesh
        The surface with n vertices at rest.
    moved : (n, 3) array of float
        Where its vertices are.

    Notes
    -----
    A rotation fits to the singular values s₁ + s₂ ± s₃ of the covariance of a neighbourhood, with the sign of its
    determinant, and a mirror image with the other sign. The sum of ± s₃ decides; what is flat does not count.

    Examples
    --------
    >>> wedge = Mesh([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> is_mirrored(wedge, wedge.vertices[:, [1, 2, 0]]), is_mirrored(wedge, wedge.vertices[:, [1, 0, 2]])
    (False, True)
    """
    covariances = _covariances(mesh, moved, _two_rings(mesh))
    least = np.linalg.svd(covariances, compute_uv=False)[:, 2]
    return bool((np.sign(np.linalg.det(covariances)) * least).sum() < 0)


def turned_back(mesh: Mesh, moved: FloatArray, scale: float) -> tuple[FloatArray, BoolArray]:
    """Move the corners of faces that are turned over until few are.

    Parameters
    ----------
    mesh : Mesh
        The surface with n vertices at rest.
    moved : (n, 3) array of float
        Where its vertices are.
    scale : float
        How many times as large the surface is there as at rest.

    Returns
    -------
    moved : (n, 3) array of float
        The same but for the corners of faces that were turned over, which move by about an edge.
    turned : (m,) array of bool
        Faces that are turned over there.

    Notes
    -----
    Each face would lie around its centre as it lies at rest, but for the rotation of its neighbourhood. Corners move to
    the mean of where their faces would have them, in which faces that are turned over count thirty times: the global step
    of Bouaziz et al., *Projective Dynamics*, SIGGRAPH 2014, for few vertices. Most such faces are slivers, which turn
    over for any noise.

    Examples
    --------
    >>> corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0]]
    >>> square = Mesh(corners, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> moved = square.vertices.copy()
    >>> moved[4] = [1.0, -0.5, 0.0]
    >>> turned_back(square, moved, 1.0)[1].any()
    np.False_
    """
    moved, around = moved.copy(), _two_rings(mesh)
    rotations = _rotations(mesh, moved, around)
    moving = np.zeros(mesh.n_vertices, dtype=bool)
    moving[mesh.faces[turned_faces(mesh, moved, rotations)]] = True
    for i in range(1, ROUNDS + 1):
        corners = mesh.faces[np.logical_or.reduce(moving[mesh.faces.T])]
        over = _are_turned(mesh, corners, moved, rotations)
        if not over.any():
            break
        moving[corners[over]] = True
        rows, local = np.unique(corners, return_inverse=True)
        weight = np.where(over, TURNED_WEIGHT, 1.0)
        before, after = mesh.vertices[corners], moved[corners]  # (f, 3 corners, 3)
        offsets = scale * (before - before.mean(axis=1, keepdims=True))
        wanted = np.einsum("fij,fkj->fki", rotations[corners[:, 0]], offsets)
        wanted += after.mean(axis=1, keepdims=True)
        total, *sums = (
            np.bincount(local.ravel(), np.repeat(weight, 3) * values)
            for values in (np.ones(corners.size), *wanted.reshape(-1, 3).T)
        )
        held = moving[rows]
        moved[rows[held]] = np.stack(sums, axis=1)[held] / total[held, None]
        if i % REFITTED == 0:
            rotations[rows] = _rotations(mesh, moved, around[rows])
    return moved, turned_faces(mesh, moved, _rotations(mesh, moved, around))


def _are_turned(mesh: Mesh, faces: IntArray, moved: FloatArray, rotations: FloatArray) -> BoolArray:
    expected = np.einsum("fij,fj->fi", rotations[faces[:, 0]], Mesh(mesh.vertices, faces).face_cross)
    over: BoolArray = np.einsum("fi,fi->f", expected, Mesh(moved, faces).face_cross) < 0
    return over


def _two_rings(mesh: Mesh) -> csr_array:
    """(n, n) ones where vertices are at most two edges apart."""
    ends = mesh.edges
    both = np.ones(2 * len(ends)), (ends.ravel(), ends[:, ::-1].ravel())
    ring = csr_array(both, shape=(mesh.n_vertices,) * 2) + eye_array(mesh.n_vertices)
    around = csr_array(ring @ ring)
    around.data[:] = 1.0
    return around


def _rotations(mesh: Mesh, moved: FloatArray, around: csr_array) -> FloatArray:
    """Best rotations (r, 3, 3) of the vertices that each row (r, n) of ones marks."""
    return nearest_rotation(_covariances(mesh, moved, around)).transpose(0, 2, 1)


def _covariances(mesh: Mesh, moved: FloatArray, around: csr_array) -> FloatArray:
    """Covariances (r, 3, 3), Σ_j (x_j − x̄) (y_j − ȳ)ᵀ, of the vertices that each row (r, n) of ones marks."""
    count = around.sum(axis=1)[:, None]
    before, after = mesh.vertices - mesh.vertices.mean(axis=0), moved - moved.mean(axis=0)
    products = around @ (before[:, :, None] * after[:, None]).reshape(-1, 9)
    sums = around @ before, around @ after
    covariances: FloatArray = (
        products.reshape(-1, 3, 3) - sums[0][:, :, None] * sums[1][:, None] / count[:, None]
    )
    return covariances
