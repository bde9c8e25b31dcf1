"""Smoothness of a map: its Dirichlet energy."""

from __future__ import annotations

import numpy as np

from isomatch._core.errors import MapError
from isomatch.correspondence import Correspondence
from isomatch.surfaces import Mesh


def dirichlet_energy(source: Mesh, target: Mesh, correspondence: Correspondence) -> float:
    """Dirichlet energy ``½ ∫ |∇f|²`` of the precise images, divided by the target's area.

    Parameters
    ----------
    source, target : Mesh
        The surfaces.
    correspondence : Correspondence
        Map source → target. Source faces with a corner without an image, or without area, are left out.

    Returns
    -------
    float
        1 for a conformal bijection, such as an isometry, at any scale; 0 for a constant map. More for a map that
        stretches or that is discontinuous.

    Raises
    ------
    MapError
        If the map does not fit the shapes.

    Notes
    -----
    The energy of the piecewise linear map: a face with angles α and opposite image edges e contributes ``¼ Σ cot α |e|²``
    (Pinkall & Polthier, *Computing Discrete Minimal Surfaces and Their Conjugates*, 1993). Linear time.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> double = Mesh(2 * square.vertices, square.faces)
    >>> dirichlet_energy(square, double, Correspondence([1, 2, 3, 0], 4))
    1.0
    """
    if correspondence.shape != (source.n_vertices, target.n_vertices):
        raise MapError(
            f"{correspondence!r} does not fit {source!r} and {target!r}; give the shapes that the map was made for"
        )
    images = correspondence @ target.vertices  # images of the source's vertices, nan where unmatched
    kept = correspondence.matched[source.sound_faces].all(axis=1) & (source.face_areas > 0)
    faces = source.faces[kept]
    edges, mapped = (
        np.roll(x[faces], -1, axis=1) - np.roll(x[faces], 1, axis=1) for x in (source.vertices, images)
    )
    # (faces, corners, xyz); the edges run round the face, so that two successive ones enclose the angle π − α
    cosines = -np.einsum("fcx,fcx->fc", np.roll(edges, 1, axis=1), np.roll(edges, -1, axis=1))
    cotangents = cosines / (2 * source.face_areas[kept, None])
    energy = 0.25 * (cotangents * (mapped**2).sum(axis=2)).sum()
    return float(energy) / target.area
