"""Smoothness of a map: its Dirichlet energy, its conformal distortion, and the edges that it tears."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import Correspondence
from isomatch.errors import MapError
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray


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
    return _energy_and_area(source, target, correspondence)[0] / target.area


def conformal_distortion(source: Mesh, target: Mesh, correspondence: Correspondence) -> float:
    """Dirichlet energy divided by the area of the images, minus 1: at least 0, and 0 for a conformal map.

    Parameters
    ----------
    source, target, correspondence
        As for `dirichlet_energy`.

    Returns
    -------
    float
        Unlike the energy, it does not depend on folds or on what is left uncovered; ``nan`` if the images have no area.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> oblong = Mesh([2, 1, 1] * square.vertices, square.faces)
    >>> conformal_distortion(square, oblong, Correspondence([0, 1, 2, 3], 4))  # (2 + 1/2) / 2 − 1
    0.25
    """
    energy, area = _energy_and_area(source, target, correspondence)
    return energy / area - 1 if area else np.nan


def torn_edges(source: Mesh, target: Mesh, correspondence: Correspondence, factor: float = 2.0) -> float:
    """Share of source edges that the map stretches by more than a factor.

    Parameters
    ----------
    source, target : Mesh
        The surfaces. Lengths on each are divided by its √area, so that scale does not count.
    correspondence : Correspondence
        Map source → target. Edges with an end without an image are left out.
    factor : float
        Largest stretch allowed. The distance of two images is measured along a straight line, which is enough to find the
        jumps between neighbours.

    Returns
    -------
    float
        From 0, for a continuous map, to 1; ``nan`` if no edge has two images.

    Raises
    ------
    MapError
        If the map does not fit the shapes.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> torn_edges(square, square, Correspondence([0, 2, 1, 3], 4), factor=1.2)  # two sides become diagonals
    0.4
    """
    images = _images(source, target, correspondence) / np.sqrt(target.area)
    i, j = source.edges[correspondence.matched[source.edges].all(axis=1)].T
    if not len(i):
        return np.nan
    lengths, mapped = (np.linalg.norm(x[i] - x[j], axis=1) for x in (source.vertices, images))
    return float((mapped > factor * lengths / np.sqrt(source.area)).mean())


def _energy_and_area(source: Mesh, target: Mesh, correspondence: Correspondence) -> tuple[float, float]:
    """Dirichlet energy of the images, and their area, in squared units of the target."""
    images = _images(source, target, correspondence)
    kept = correspondence.matched[source.sound_faces].all(axis=1) & (source.face_areas > 0)
    faces = source.faces[kept]
    edges, mapped = (
        np.roll(x[faces], -1, axis=1) - np.roll(x[faces], 1, axis=1) for x in (source.vertices, images)
    )
    # (faces, corners, xyz); the edges run round the face, so that two successive ones enclose the angle π − α
    cosines = -np.einsum("fcx,fcx->fc", np.roll(edges, 1, axis=1), np.roll(edges, -1, axis=1))
    cotangents = cosines / (2 * source.face_areas[kept, None])
    energy = 0.25 * (cotangents * (mapped**2).sum(axis=2)).sum()
    return float(energy), Mesh(np.nan_to_num(images), faces).area


def _images(source: Mesh, target: Mesh, correspondence: Correspondence) -> FloatArray:
    """(n_source, 3) precise images; nan where unmatched."""
    if correspondence.shape != (source.n_vertices, target.n_vertices):
        raise MapError(
            f"{correspondence!r} does not fit {source!r} and {target!r}; give the shapes that the map was made for"
        )
    return correspondence @ target.vertices
