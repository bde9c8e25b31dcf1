"""Vertices that a shape has no counterpart of: they are missing data, and stand where the mean of the others is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch.errors import NotConvergedError
from isomatch.statistics.procrustes import Scale, generalised_procrustes
from isomatch.statistics.shapes import CorrespondedShapes
from isomatch.values.arrays import FloatArray

TOLERANCE = 1e-6  # of the size of the mean: movement of a missing vertex in the last round
MOST_ROUNDS = 500  # each leaves less of the movement than the largest share of a shape that is missing


def filled(
    shapes: CorrespondedShapes, weights: FloatArray | None = None, scale: Scale = "keep"
) -> CorrespondedShapes:
    """Move the vertices that were not measured to where the mean of those that were is, seen from each shape.

    Parameters
    ----------
    shapes : CorrespondedShapes
        The m shapes. They are returned as they are if everything was measured.
    weights, scale
        As for `generalised_procrustes`.

    Returns
    -------
    CorrespondedShapes
        So aligned, a missing vertex lies on the mean: it adds no variance, and does not turn or shift its shape. One that
        no shape measured stays where the surfaces around it were continued.

    Raises
    ------
    NotConvergedError
        If these places still move after many rounds.

    Notes
    -----
    Alignment and means take turns until nothing moves, which is expectation maximisation for one mean and deviations of
    one size everywhere. A round takes the time of `generalised_procrustes`.

    Examples
    --------
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> moved = square + [0, 0, 5]
    >>> moved[2] += 7
    >>> measured = np.ones((2, 4), dtype=bool)
    >>> measured[1, 2] = False
    >>> shapes = CorrespondedShapes("ab", np.array([square, moved]), [[0, 1, 2], [0, 2, 3]], measured=measured)
    >>> filled(shapes).vertices[1, 2].round(3).tolist()
    [1.0, 1.0, 5.0]
    """
    measured = shapes.measured
    if measured is None:
        return shapes
    known = measured | ~measured.any(axis=0)
    count = known.sum(axis=0)[:, None]
    vertices = shapes.vertices.copy()
    for _ in range(MOST_ROUNDS):
        found = generalised_procrustes(vertices, weights, scale)
        mean = np.einsum("sn,sni->ni", known, found.aligned) / count
        back = (mean - found.translations[:, None]) @ found.rotations / found.scales[:, None, None]
        apart = np.abs(np.where(known[:, :, None], 0.0, back - vertices)).max(axis=(1, 2)) * found.scales
        vertices = np.where(known[:, :, None], vertices, back)
        if apart.max() <= TOLERANCE * np.sqrt(((mean - mean.mean(axis=0)) ** 2).sum(axis=1).mean()):
            return replace(shapes, vertices=vertices)
    raise NotConvergedError(
        f"the mean of shapes of which parts are missing still moves after {MOST_ROUNDS} rounds; leave out those of which "
        "little was measured"
    )


def measured_variances(aligned: FloatArray, shapes: CorrespondedShapes) -> FloatArray:
    """(n,) variance of each vertex of aligned shapes (m, n, 3), among those that measured it; nan of fewer than two."""
    known = shapes.measured
    if known is None:
        return np.asarray(((aligned - aligned.mean(axis=0)) ** 2).sum(axis=(0, 2)) / max(len(aligned) - 1, 1))
    count = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.einsum("sn,sni->ni", known, aligned) / count[:, None]
        squares = np.where(known, ((aligned - mean) ** 2).sum(axis=2), 0.0).sum(axis=0)
        return np.asarray(np.where(count > 1, squares / (count - 1), np.nan))
