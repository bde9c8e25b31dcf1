"""The left–right map of a shape with two mirrored sides."""

from __future__ import annotations

from isomatch.errors import MapError
from isomatch.matching import Outcome, match
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import IntArray


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
