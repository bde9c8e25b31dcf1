"""From a map between the points of two files, which are doubled at seams, to one between the welded surfaces."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence.checked_map import UNMATCHED
from isomatch.correspondence.correspondence import Correspondence
from isomatch.values.arrays import IntArray


def welded_map(given: Correspondence, source_vertex: IntArray, target_vertex: IntArray) -> Correspondence:
    """Return the map between vertices into which the points of both sides are welded.

    A vertex has the image of the first of its points that has one.

    Parameters
    ----------
    given : Correspondence
        Between the points.
    source_vertex, target_vertex : (n_source,), (n_target,) array of int
        Vertex of each point; every vertex has one.

    Returns
    -------
    Correspondence
        Between the vertices. O(n log n).

    Examples
    --------
    >>> welded_map(Correspondence([-1, 1, 2], n_target=3), np.array([0, 1, 0]), np.array([0, 0, 1])).vertices
    array([1, 0])
    """
    matched_first = np.argsort(~given.matched, kind="stable")
    rows = matched_first[np.unique(source_vertex[matched_first], return_index=True)[1]]
    vertex = np.append(target_vertex, UNMATCHED)
    n_target = int(target_vertex.max(initial=-1)) + 1
    return Correspondence(
        vertex[given.vertices[rows]], n_target, vertex[given.faces[rows]], given.barycentric[rows]
    )
