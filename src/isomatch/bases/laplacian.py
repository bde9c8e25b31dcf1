"""The Laplacian of whatever has one: meshes and point clouds."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import robust_laplacian
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from isomatch._arrays import FloatArray
from isomatch.errors import MeshError, SettingError
from isomatch.geodesics import MetricSpace
from isomatch.surfaces import Graph, Mesh, PointCloud

Surface: TypeAlias = Mesh | PointCloud
"""What has a Laplacian."""


def require_surface(surface: MetricSpace) -> Surface:
    """Return a surface that has a Laplacian as it is; `SettingError` for all others."""
    if isinstance(surface, Mesh | PointCloud):
        return surface
    raise SettingError(
        f"a {type(surface).__name__} has no Laplacian, which this method needs; use method='nystrom'"
    )


def laplacian(surface: Surface | Graph) -> tuple[csc_array, FloatArray]:
    """Stiffness L (n, n), which has no scale, and masses (n,) in squared mesh units.

    The tufted intrinsic Delaunay Laplacian of Sharp & Crane, *A Laplacian for Nonmanifold Triangle Meshes*, SGP 2020.
    On a graph, edge weights are the geometric mean of the masses at the ends over the squared length, times a constant
    that makes it the five-point Laplacian on a square grid.
    """
    if isinstance(surface, Graph):
        return _graph_laplacian(surface), surface.vertex_areas
    if isinstance(surface, Mesh):
        stiffness, mass = robust_laplacian.mesh_laplacian(surface.vertices, surface.faces)
    else:
        stiffness, mass = robust_laplacian.point_cloud_laplacian(surface.vertices)
    masses = np.asarray(mass.diagonal(), dtype=np.float64)
    if not (masses > 0).all():
        raise MeshError(
            f"{int((masses <= 0).sum())} vertices have no area, so the Laplacian is undefined there; "
            "call repair(mesh)"
        )
    return csc_array(stiffness), masses


def _graph_laplacian(graph: Graph) -> csc_array:
    i, j = graph.edges.T
    lengths = np.maximum(graph.edge_lengths, 1e-6 * graph.edge_lengths.mean())
    degree = 2 * len(i) / graph.n_vertices
    conductance = 4 / degree * np.sqrt(graph.vertex_areas[i] * graph.vertex_areas[j]) / lengths**2
    adjacency = coo_array((conductance, (i, j)), shape=(graph.n_vertices,) * 2)
    adjacency = adjacency + adjacency.T
    return csc_array(diags_array(adjacency.sum(axis=1)) - adjacency)


def factorised(stiffness: csc_array, diagonal: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Factorise H + diag(d), symmetric and definite; return what solves with it."""
    solve: Callable[[FloatArray], FloatArray] = splu(
        csc_array(stiffness + diags_array(diagonal)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).solve
    return solve
