"""`Surface`: everything that can be matched, and its mirror image."""

from __future__ import annotations

from typing import TypeAlias, overload

from isomatch._core.errors import MeshError
from isomatch.surfaces.graph import Graph
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.point_cloud import PointCloud

Surface: TypeAlias = Mesh | PointCloud | Graph
"""Any of the three: a space with geodesic distances that can be matched."""


@overload
def reflected(surface: Mesh) -> Mesh: ...
@overload
def reflected(surface: Surface) -> Surface: ...
def reflected(surface: Surface) -> Surface:
    """Reflect a surface, x → −x. Vertices and faces keep their numbers, and the outside of a mesh stays outside.

    Examples
    --------
    >>> reflected(Mesh([[1, 0, 0], [2, 0, 0], [1, 1, 0]], [[0, 1, 2]])).faces.tolist()
    [[2, 1, 0]]
    """
    if isinstance(surface, Graph):
        raise MeshError("a graph has no positions, so it has no mirror image")
    vertices = surface.vertices * [-1.0, 1.0, 1.0]
    if isinstance(surface, Mesh):
        return Mesh(vertices, surface.faces[:, ::-1])
    return PointCloud(vertices, surface.n_neighbours)
