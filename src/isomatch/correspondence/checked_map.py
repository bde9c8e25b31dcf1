"""Validation of the arrays of a map: a target vertex for each source vertex, and precise images in triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from isomatch.errors import MapError, some
from isomatch.surfaces import PrecisePoints
from isomatch.values.arrays import AnyArray, FloatArray, IntArray, array_of, numbers_of

UNMATCHED = -1


def checked_map(
    vertices: ArrayLike, n_target: int, faces: ArrayLike | None, barycentric: ArrayLike | None
) -> tuple[IntArray, PrecisePoints]:
    """Check the arrays of a map; return its target vertices (n_source,) and precise images, see `Correspondence`.

    Raises
    ------
    MapError
        If they do not describe a map.
    """
    indices = array_of(vertices, "the vertices of a map", MapError)
    if indices.ndim != 1 or (indices.size and indices.dtype.kind not in "iu"):
        raise MapError(
            f"a map needs one integer target vertex for each source vertex, not {indices.dtype} of shape {indices.shape}"
        )
    if n_target < 0:
        raise MapError(f"n_target = {n_target} is not a number of target vertices")
    bad = np.flatnonzero((indices < UNMATCHED) | (indices >= n_target))
    if len(bad):
        raise MapError(
            f"source vertices {some(bad)} are mapped outside the target's vertices 0…{n_target - 1}; "
            "indices count from 0, and −1 means unmatched"
        )
    image = np.array(indices, dtype=np.int64)
    if (faces is None) != (barycentric is None):
        raise MapError("faces and barycentric describe the precise image together; give both or neither")
    if faces is None or barycentric is None:
        return image, PrecisePoints.at_vertices(image)
    weights = numbers_of(barycentric, "barycentric weights", MapError)
    return image, _precise(array_of(faces, "faces", MapError), weights, image, n_target)


def _precise(faces: AnyArray, weights: FloatArray, image: IntArray, n_target: int) -> PrecisePoints:
    """Check that corners and weights are precise images of the matched vertices, and return them."""
    if faces.shape != (len(image), 3) or weights.shape != (len(image), 3):
        raise MapError("faces and barycentric must both have one row of three for each source vertex")
    if faces.size and faces.dtype.kind not in "iu":
        raise MapError(f"faces have type {faces.dtype}, expected integers: three target vertices each")
    held = image >= 0
    rows = slice(None) if held.all() else held  # which spares copies
    if faces[rows].min(initial=0) < 0 or faces[rows].max(initial=-1) >= n_target:
        raise MapError(f"faces name vertices outside the target's 0…{n_target - 1}")
    smallest = weights[rows].min(initial=0.0)
    with np.errstate(invalid="ignore"):
        sums = weights[rows, 0] + weights[rows, 1] + weights[rows, 2]
    if smallest < -1e-9 or not (np.abs(sums - 1) <= 1e-6).all():
        raise MapError("barycentric weights must be numbers that are not negative and sum to 1 in each row")
    corners = faces.astype(np.int64)
    corners[~held], weights[~held] = UNMATCHED, (1.0, 0.0, 0.0)
    return PrecisePoints(corners, weights)
