"""Whether a map preserves the orientation of the faces."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import SampledBasis
from isomatch.shapes.smooth_shape import SmoothShape
from isomatch.surfaces import vertex_normals
from isomatch.values.arrays import IntArray


def orientation_of(
    source: SmoothShape, basis: SampledBasis, target: SmoothShape, target_vertex: IntArray, k: int
) -> float:
    """Mean cosine between the normals of the smoothed target and those of its copy drawn on the source.

    Parameters
    ----------
    source, target : SmoothShape
        The shapes.
    basis : SampledBasis
        The source's Laplace–Beltrami functions and the m vertices that are mapped.
    target_vertex : (m,) array of int
        Their images.
    k : int
        Functions of the smoothed target.

    Returns
    -------
    float
        Near 1 the map preserves the orientation of the faces, near −1 it reverses it. 0 where a shape has no triangles.
    """
    mesh, onto = source.triangles, target.triangles
    if mesh is None or onto is None:
        return 0.0
    k = min(k, basis.functions.shape[1], len(target.laplace.values))
    copy = basis.functions[:, :k] @ basis.fit(onto.vertices[target_vertex], k)
    drawn = vertex_normals(copy, mesh.faces)[basis.vertices]
    smooth = target.smoothed(k)[1][target_vertex]
    return float(np.einsum("ij,ij->i", drawn, smooth).mean())
