"""A surface with all that its file carries, and its mesh for matching."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import FloatArray, IntArray, numbers_of
from isomatch._cached import cached_property
from isomatch.assets.contents import Contents
from isomatch.assets.library_meshes import to_meshio, to_open3d, to_pyvista, to_trimesh
from isomatch.assets.objects import contents_of
from isomatch.errors import MeshError, some
from isomatch.surfaces import Mesh, welded


@dataclass(frozen=True, eq=False, repr=False)
class Asset(Contents):
    """A surface with all that its file carries: polygons, attributes, parts and the rest of its document.

    Values at the vertices of `mesh` go back to the points with `vertex_of_point`, and to corners with
    `vertex_of_corner`.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Positions as in the file, in its order and units, before any transform of a part.
    polygons : Polygons
        Triangles, quads and other polygons, in the order of the file.
    attributes : tuple of Attribute
        Values on points, corners and faces.
    parts : tuple of Part
        The meshes of a file that has several or puts them somewhere; empty otherwise.
    document : object, optional
        What else the format holds, for writing the same format again.

    Raises
    ------
    MeshError
        If the positions have the wrong shape, a polygon refers to no point, or the parts do not add up.
    DescriptorError
        If an attribute has another number of rows, or two have the same name.

    Examples
    --------
    >>> from isomatch.surfaces import Polygons
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> asset = Asset(square + [[0, 0, 0]], Polygons([0, 1, 2, 3], [4]))
    >>> asset.mesh, asset.vertex_of_point.tolist()
    (Mesh(4 vertices, 2 faces), [0, 1, 2, 3, 0])
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        corners = self.polygons.corners
        outside = np.flatnonzero((corners < 0) | (corners >= len(self.points)))
        if len(outside):
            raise MeshError(
                f"polygons {some(np.unique(self.polygons.of_corner[outside]))} refer to points outside "
                f"0…{len(self.points) - 1}; remove them, or export the file again"
            )

    @classmethod
    def from_contents(cls, found: Contents) -> Self:
        """Make an asset of what a file or an object holds."""
        return cls(found.points, found.polygons, found.attributes, found.parts, found.document)

    @classmethod
    def from_object(cls, given: object) -> Self:
        """Make an asset of a mesh of another library, with its attributes.

        Parameters
        ----------
        given : object
            A ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh`` or ``open3d.geometry.TriangleMesh``.

        Raises
        ------
        MeshError
            If it is none of these.
        """
        return cls.from_contents(contents_of(given))

    @cached_property
    def mesh(self) -> Mesh:
        """The surface for matching: triangles between welded points, where the file puts them.

        Points at exactly the same position are one vertex, so that seams are closed. Its faces are those of
        ``polygons.triangles``, in order; vertices are numbered by the first of their points.
        """
        return Mesh(self.placed_points[self.point_of_vertex], self.vertex_of_point[self.polygons.triangles])

    @cached_property
    def _welded(self) -> tuple[IntArray, IntArray]:
        return welded(self.placed_points)

    @property
    def vertex_of_point(self) -> IntArray:
        """(n,) the vertex of `mesh` that each point is welded into."""
        return self._welded[1]

    @property
    def point_of_vertex(self) -> IntArray:
        """(n_vertices,) the first point of each vertex of `mesh`."""
        return self._welded[0]

    @property
    def vertex_of_corner(self) -> IntArray:
        """(c,) the vertex of `mesh` at each corner of the polygons."""
        return self.vertex_of_point[self.polygons.corners]

    def moved(self, vertices: ArrayLike) -> Self:
        """Return the same asset with the vertices of its mesh at other positions; all else stays.

        Parameters
        ----------
        vertices : (n_vertices, 3) array_like of float
            New positions of the vertices of `mesh`, where the file puts them.

        Raises
        ------
        MeshError
            If the positions have the wrong shape.
        """
        positions = numbers_of(vertices, "vertices", MeshError)
        if positions.shape != self.mesh.vertices.shape:
            raise MeshError(f"positions have shape {positions.shape}, expected {self.mesh.vertices.shape}")
        points: FloatArray = positions[self.vertex_of_point]
        for part, rows in self.rows_of_parts():
            if part.transform is not None:
                matrix = np.linalg.pinv(np.array(part.transform))
                points[rows] = points[rows] @ matrix[:3, :3].T + matrix[:3, 3]
        return replace(self, points=points)

    def to_trimesh(self) -> Any:
        """Make a ``trimesh.Trimesh`` of triangles; points are split where texture coordinates have seams.

        Raises
        ------
        MissingDependencyError
            If the package is not installed; the message names the extra. So do the other conversions.
        """
        return to_trimesh(self)

    def to_pyvista(self) -> Any:
        """Make a ``pyvista.PolyData`` with all polygons; points are split where values of corners differ."""
        return to_pyvista(self)

    def to_meshio(self) -> Any:
        """Make a ``meshio.Mesh`` with all polygons; points are split where values of corners differ."""
        return to_meshio(self)

    def to_open3d(self) -> Any:
        """Make an ``open3d.geometry.TriangleMesh`` of triangles with colours, normals and texture coordinates."""
        return to_open3d(self)
