"""What a surface file holds: points, polygons, attributes, and the rest of its document."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from isomatch._arrays import FloatArray, IntArray, numbers_of
from isomatch._cached import cached_property
from isomatch.assets.attribute import Attribute, Domain, Kind, require_lengths
from isomatch.assets.polygons import Polygons
from isomatch.errors import DescriptorError, MeshError
from isomatch.surfaces import Mesh


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a @ b, rounded alike on every machine, so that hashes of what is placed are the same."""
    total: FloatArray = a[:, :1] * b[0]
    for i in range(1, len(b)):
        total = total + a[:, i, None] * b[i]
    return total


@dataclass(frozen=True)
class Part:
    """One of several meshes in a file, whose points and polygons follow those of the parts before.

    Parameters
    ----------
    name : str
        Its name in the file.
    n_points, n_polygons : int
        Numbers of points and polygons of this part.
    transform : (4, 4) nested tuple of float, optional
        Where the file puts it: a matrix that is multiplied by columns x, y, z, 1.
    """

    name: str
    n_points: int
    n_polygons: int
    transform: tuple[tuple[float, ...], ...] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Contents:
    """What a surface file holds.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Positions as in the file, in its order and units, before any transform of a part.
    polygons : Polygons
        The polygons, in the order of the file.
    attributes : tuple of Attribute
        Values on points, corners and faces.
    parts : tuple of Part
        The meshes of a file that has several or puts them somewhere; empty otherwise.
    document : object, optional
        What else the format holds, for writing the same format again.

    Raises
    ------
    MeshError
        If the positions have the wrong shape, or the parts do not add up.
    DescriptorError
        If an attribute has another number of rows, or two have the same name.
    """

    points: FloatArray
    polygons: Polygons
    attributes: tuple[Attribute, ...] = ()
    parts: tuple[Part, ...] = ()
    document: object = None

    def __post_init__(self) -> None:
        points = numbers_of(self.points, "points", MeshError)
        if points.ndim != 2 or points.shape[1] != 3:
            raise MeshError(f"points have shape {points.shape}, expected (n, 3): one row x, y, z per point")
        points.flags.writeable = False
        object.__setattr__(self, "points", points)
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
    def of_mesh(cls, mesh: Mesh, attributes: Iterable[Attribute] = ()) -> Self:
        """Return the contents of a file that holds a mesh."""
        return cls(mesh.vertices, Polygons.of_triangles(mesh.faces), tuple(attributes))

    @cached_property
    def placed_points(self) -> FloatArray:
        """(n, 3) positions after the transforms of the parts: where the surface is."""
        if all(part.transform is None for part in self.parts):
            return self.points
        placed = np.array(self.points)
        for part, rows in self.rows_of_parts():
            if part.transform is not None:
                matrix = np.array(part.transform)
                placed[rows] = product(placed[rows], matrix[:3, :3].T) + matrix[:3, 3]
        return placed

    @cached_property
    def placed(self) -> Self:
        """The same without transforms: points, normals and tangents where the surface is."""
        if all(part.transform is None for part in self.parts):
            return self
        turned = tuple(self._turned(attribute, 1) for attribute in self.attributes)
        return replace(self, points=self.placed_points, attributes=turned, parts=(), document=None)

    def from_placed(self, attribute: Attribute) -> Attribute:
        """Turn an attribute of `placed` back, if it is normals or tangents, to what it is in the parts."""
        return self._turned(attribute, -1)

    def _turned(self, attribute: Attribute, power: int) -> Attribute:
        is_tangent = attribute.kind == "vector" and attribute.name.startswith("tangent")
        if attribute.kind != "normal" and not is_tangent:
            return attribute
        starts = np.cumsum(self.polygons.sizes) - self.polygons.sizes
        corners = {"corner": self.polygons.corners, "face": self.polygons.corners[starts]}
        part_of = self.part_of_point[corners.get(attribute.domain, slice(None))]
        values = np.array(attribute.values)
        for i, part in enumerate(self.parts):
            if part.transform is not None:
                matrix = np.array(part.transform)[:3, :3]
                along = matrix.T if power == 1 else np.linalg.pinv(matrix).T
                across = np.linalg.pinv(matrix) if power == 1 else matrix
                turned = product(values[part_of == i, :3], along if is_tangent else across)
                length = np.linalg.norm(turned, axis=1, keepdims=True)
                values[part_of == i, :3] = turned / np.where(length > 0, length, 1)
        return attribute.with_values(values)

    def rows_of_parts(self) -> list[tuple[Part, slice]]:
        """Return each part with its rows among the points."""
        stops = np.cumsum([part.n_points for part in self.parts]).tolist()
        return [(part, slice(stop - part.n_points, stop)) for part, stop in zip(self.parts, stops)]

    @cached_property
    def part_of_point(self) -> IntArray:
        """(n,) index of the part of each point; 0 where the file does not have several."""
        counts = [part.n_points for part in self.parts] or [len(self.points)]
        return np.repeat(np.arange(len(counts)), counts)

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

    def with_attributes(self, *attributes: Attribute) -> Self:
        """Return the same with more attributes; one of the same name and domain is replaced."""
        new = {(attribute.name, attribute.domain) for attribute in attributes}
        kept = tuple(a for a in self.attributes if (a.name, a.domain) not in new)
        return replace(self, attributes=kept + attributes)

    def without_attributes(self, *names: str) -> Self:
        """Return the same without the attributes of these names."""
        return replace(self, attributes=tuple(a for a in self.attributes if a.name not in names))
