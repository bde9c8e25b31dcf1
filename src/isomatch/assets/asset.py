"""A surface with all that its file carries, and its mesh for matching."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from isomatch.assets.attribute import Attribute, Domain, Kind, require_lengths
from isomatch.assets.frame import Frame
from isomatch.assets.parts import Part, placed, turned, unplaced
from isomatch.assets.polygons import Polygons, Renumbering
from isomatch.errors import DescriptorError, MeshError, some
from isomatch.surfaces import Mesh, welded
from isomatch.values.arrays import FloatArray, IntArray, numbers_of
from isomatch.values.cached import cached_property


@dataclass(frozen=True, eq=False, repr=False)
class Asset:
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
    notes : tuple of str
        What a reader left out, supposed or replaced, a sentence for each.
    frame : Frame, optional
        The space of the coordinates, where the file tells it.

    Raises
    ------
    MeshError
        If the positions have the wrong shape, or the parts do not add up. Polygons that refer to no point are refused by
        the mesh and what belongs to it, and `repair` removes them.
    DescriptorError
        If an attribute has another number of rows, or two have the same name.

    Examples
    --------
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> asset = Asset(square + [[0, 0, 0]], Polygons([0, 1, 2, 3], [4]))
    >>> asset.mesh, asset.vertex_of_point.tolist()
    (Mesh(4 vertices, 2 faces), [0, 1, 2, 3, 0])
    """

    points: FloatArray
    polygons: Polygons
    attributes: tuple[Attribute, ...] = ()
    parts: tuple[Part, ...] = ()
    document: object = None
    notes: tuple[str, ...] = ()
    frame: Frame | None = None

    def __post_init__(self) -> None:
        points = numbers_of(self.points, "points", MeshError)
        if points.ndim != 2 or points.shape[1] != 3:
            raise MeshError(f"points have shape {points.shape}, expected (n, 3): one row x, y, z per point")
        points.flags.writeable = False
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "polygons", self.polygons.at(points))
        object.__setattr__(self, "attributes", tuple(self.attributes))
        sums = sum(part.n_points for part in self.parts), sum(part.n_polygons for part in self.parts)
        if self.parts and sums != (len(points), len(self.polygons)):
            raise MeshError(
                f"parts of {sums} points and polygons; there are {len(points)}, {len(self.polygons)}"
            )
        require_lengths(
            self.attributes,
            {"point": len(points), "corner": len(self.polygons.corners), "face": len(self.polygons)},
        )

    def __repr__(self) -> str:
        names = ", ".join(attribute.name for attribute in self.attributes) or "no attributes"
        return f"{type(self).__name__}({len(self.points)} points, {len(self.polygons)} polygons; {names})"

    @classmethod
    def of_mesh(cls, mesh: Mesh, attributes: Iterable[Attribute] = ()) -> Asset:
        """Make an asset of a mesh and values on it."""
        return cls(mesh.vertices, Polygons.of_triangles(mesh.faces), tuple(attributes))

    def attribute(self, name: str, domain: Domain | None = None) -> Attribute:
        """Return an attribute by its name, and its domain if several have that name.

        Raises
        ------
        DescriptorError
            If there is none; the message lists those that there are.
        """
        for attribute in self.attributes:
            if attribute.name == name and domain in (None, attribute.domain):
                return attribute
        known = ", ".join(f"{a.name!r} of {a.domain}s" for a in self.attributes) or "none"
        raise DescriptorError(f"no attribute {name!r}{f' of {domain}s' if domain else ''}; there are {known}")

    def of_kind(self, kind: Kind) -> tuple[Attribute, ...]:
        """Return the attributes of one kind, in their order."""
        return tuple(attribute for attribute in self.attributes if attribute.kind == kind)

    def with_attributes(self, *attributes: Attribute) -> Asset:
        """Return the same with more attributes; one of the same name and domain is replaced."""
        new = {(attribute.name, attribute.domain) for attribute in attributes}
        kept = tuple(a for a in self.attributes if (a.name, a.domain) not in new)
        return replace(self, attributes=kept + attributes)

    def without_attributes(self, *names: str) -> Asset:
        """Return the same without the attributes of these names."""
        return replace(self, attributes=tuple(a for a in self.attributes if a.name not in names))

    @cached_property
    def mesh(self) -> Mesh:
        """The surface for matching: triangles between welded points, where the file puts them.

        Points at exactly the same position are one vertex, so that seams are closed. Its faces are those of
        ``polygons.triangles``, in order; vertices are numbered by the first of their points.
        """
        return Mesh(self.placed_points[self.point_of_vertex], self.vertex_of_point[self.polygons.triangles])

    @cached_property
    def _welded(self) -> tuple[IntArray, IntArray]:
        self.require_points()
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

    @property
    def with_note_of_uncut(self) -> Asset:
        """The same with a note, if some polygons that are not convex could not be cut along their outline."""
        uncut = self.polygons.uncut
        if not len(uncut):
            return self
        note = f"the outlines of polygons {some(uncut)} cross themselves or have no area; they are cut as if convex"
        return replace(self, notes=(*self.notes, note))

    def require_points(self) -> None:
        """Raise `MeshError` if a polygon refers to no point."""
        corners = self.polygons.corners
        outside = np.flatnonzero((corners < 0) | (corners >= len(self.points)))
        if len(outside):
            raise MeshError(
                f"polygons {some(np.unique(self.polygons.of_corner[outside]))} refer to points outside "
                f"0…{len(self.points) - 1}; remove them, or export the file again"
            )

    def renumbered(self, rows: Renumbering) -> Asset:
        """Return other points and polygons made of those that there are, with all values on them."""
        index = {"point": rows.point_index, "corner": rows.corner_index, "face": rows.polygon_index}
        parts = self.parts
        if parts:
            part_of_polygon = np.repeat(np.arange(len(parts)), [part.n_polygons for part in parts])
            n_points = np.bincount(self.part_of_point[rows.point_index], minlength=len(parts)).tolist()
            n_polygons = np.bincount(part_of_polygon[rows.polygon_index], minlength=len(parts)).tolist()
            parts = tuple(
                replace(part, n_points=n, n_polygons=m)
                for part, n, m in zip(parts, n_points, n_polygons)
                if n
            )
        after = replace(
            self,
            points=self.points[rows.point_index],
            polygons=rows.polygons,
            attributes=tuple(attribute.at(index[attribute.domain]) for attribute in self.attributes),
            parts=parts,
        )
        if isinstance(self.document, RenumberedDocument):
            return replace(after, document=self.document.renumbered(self, after, rows))
        return after

    def moved(self, vertices: ArrayLike) -> Asset:
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
        return replace(self, points=unplaced(positions[self.vertex_of_point], self.parts))

    @cached_property
    def placed_points(self) -> FloatArray:
        """(n, 3) positions after the transforms of the parts: where the surface is."""
        return placed(self.points, self.parts) if self._is_transformed else self.points

    @cached_property
    def placed(self) -> Asset:
        """The same without transforms: points, normals, tangents and shape keys where the surface is."""
        if not self._is_transformed:
            return self
        attributes = tuple(self._turned(attribute) for attribute in self.attributes)
        return replace(self, points=self.placed_points, attributes=attributes, parts=(), document=None)

    def from_placed(self, attribute: Attribute) -> Attribute:
        """Turn an attribute of `placed` back, if it is normals, tangents or a shape key, to what it is in the parts."""
        return self._turned(attribute, back=True)

    @property
    def _is_transformed(self) -> bool:
        return any(part.transform is not None for part in self.parts)

    def _turned(self, attribute: Attribute, back: bool = False) -> Attribute:
        if attribute.kind not in ("normal", "key") and not attribute.is_tangent:
            return attribute
        corners = self.polygons.corners
        points = {"corner": corners, "face": corners[self.polygons.starts]}
        part_of = self.part_of_point[points.get(attribute.domain, slice(None))]
        is_key = attribute.kind == "key"
        along = is_key or attribute.is_tangent
        return attribute.with_values(
            turned(attribute.values, part_of, self.parts, tangents=along, back=back, unit=not is_key)
        )

    @cached_property
    def part_of_point(self) -> IntArray:
        """(n,) index of the part of each point; 0 where the file does not have several."""
        counts = [part.n_points for part in self.parts] or [len(self.points)]
        return np.repeat(np.arange(len(counts)), counts)


@runtime_checkable
class RenumberedDocument(Protocol):
    """The document of a format that refers to points or polygons by their numbers."""

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> object:
        """Return the document of the asset after, of which the attributes correspond to those before, in order."""
        ...
