"""The left–right map of a shape with two mirrored sides."""

from __future__ import annotations

import numpy as np

from isomatch.errors import MapError
from isomatch.matching import Outcome, match
from isomatch.statistics.procrustes import aligned_to
from isomatch.statistics.shapes import CorrespondedShapes
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import IntArray

MOST_TRIED = 5  # shapes of which none is certain; further ones hardly are


def left_right_map(mesh: Mesh, *, seed: int = 0) -> IntArray:
    """Find the vertex on the other side that corresponds to each vertex, by matching a shape to its mirror image.

    Parameters
    ----------
    mesh : Mesh
        A shape that is nearly symmetric, such as the mean of a model.
    seed : int
        Draws the starts of the search.

    Returns
    -------
    (n,) array of int
        For `CorrespondedShapes.mirrored`.

    Raises
    ------
    MapError
        If the match cannot be trusted, or leaves vertices unmatched.
    """
    result = match(mesh, reflected(mesh), seed=seed)
    if result.outcome is not Outcome.CONVERGED or not result.map.matched.all():
        raise MapError(
            f"the left–right map is not certain ({result.outcome.value}: {result.outcome.advice}); give it as a file"
        )
    return result.map.vertices


def left_right_of_shapes(shapes: CorrespondedShapes, mean: Mesh, *, seed: int = 0) -> tuple[IntArray, str]:
    """Find the left–right map of shapes in one topology: of their mean, or of one of them if that is not certain.

    Bodies in many poses have a mean with short limbs, which is nearer to its mirror image as it stands than any map from
    left to right brings it.

    Parameters
    ----------
    shapes : CorrespondedShapes
        The shapes. Of those that are measured everywhere, the five nearest to the mean are tried.
    mean : Mesh
        Their mean.
    seed : int
        Draws the starts of the searches.

    Returns
    -------
    (n,) array of int
        See `left_right_map`.
    str
        Name of the shape that it is the map of; empty for the mean.

    Raises
    ------
    MapError
        If none is certain: for the reason that the mean is not.
    """
    try:
        return left_right_map(mean, seed=seed), ""
    except MapError as error:
        uncertain = error
    uniform = np.full(shapes.n_vertices, 1 / shapes.n_vertices)
    apart = [
        np.linalg.norm(aligned_to(mean.vertices, shape, uniform) - mean.vertices) for shape in shapes.vertices
    ]
    lacks = np.zeros((len(shapes), 1), dtype=bool) if shapes.measured is None else ~shapes.measured
    nearest = [int(i) for i in np.argsort(apart, kind="stable") if not lacks[i].any()]
    for i in nearest[:MOST_TRIED]:
        try:
            return left_right_map(shapes.mesh(i), seed=seed), shapes.names[i]
        except MapError:
            continue
    raise uncertain
