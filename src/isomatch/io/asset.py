"""A surface with all contents of its file, its parts, space of coordinates, and mesh for matching."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol, TypeAlias, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray, numbers_of, read_only
from isomatch._core.cached import cached_property
from isomatch._core.errors import DescriptorError, MeshError, some
from isomatch.io.attribute import Attribute, Domain, Kind, require_lengths
from isomatch.io.polygons import Polygons, Renumbering
from isomatch.surfaces import Mesh, weld_points

REPORTED_ROUNDING, MAX_ROUNDING = 1e-4, 1e-3
"""How far rounding to float32 may move a point, over the mean edge length: more than the first number is avoided or
reported, more than the second is an error unless the user allows it; chosen."""
UNKNOWN, SCANNER = "unknown", "scanner_anat"  # names of coordinate spaces, as in NIfTI
# directions of the axes of FreeSurfer's voxels, one in each column, with x right, y anterior and z superior
_VOXEL_AXES = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
_SCANNER_HEAD = [2, 1, 20]  # first integers in the footer of a FreeSurfer surface in scanner coordinates
# matrices are taken as equal if their entries differ by at most this, in millimetres for offsets; chosen
_MATRIX_TOLERANCE = 1e-4
# first entries of nibabel's ``volume_info``, the data on a FreeSurfer volume, if it names no file
NEW_VOLUME: Mapping[str, Any] = {
    "head": np.array([2, 0, 20], dtype=np.int32),
    "valid": "1  # volume info valid",
    "filename": "none",
}
Axes: TypeAlias = Literal["RAS", "LPS"]
"""The directions of x, y and z: right, front and up, or left, back and up."""
TURN = np.array([-1.0, -1.0, 1.0])  # factors of x, y and z that turn RAS into LPS and back
# Names of texts in a file: SPACE has the axes, as 3D Slicer writes them into VTP; COMMENTS has other lines.
SPACE, COMMENTS = "SPACE", "comments"
# They match lines that name the axes, as 3D Slicer and NRRD write them, and lines that name the unit.
_AXES_LINE = re.compile(r"\b(?:space|coordinate[ _]?system)\s*[=:]\s*[\"']?(?P<axes>[rlaips]{3})\b", re.I)
_UNIT_LINE = re.compile(r"\bunits?\s*([:=]|in\b|is\b|are\b|(milli|centi|micro)?met|[mc]?m\b|inch)", re.I)


@dataclass(frozen=True)
class Part:
    """One of several meshes in a file, whose points and polygons follow those of the parts before.

    The ``transform`` places it: a matrix that multiplies columns x, y, z, 1.
    """

    name: str
    n_points: int
    n_polygons: int
    transform: tuple[tuple[float, ...], ...] | None = None


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a @ b, rounded alike on every machine, so that hashes of placed points are the same."""
    total: FloatArray = a[:, :1] * b[0]
    for i in range(1, len(b)):
        total = total + a[:, i, None] * b[i]
    return total


@dataclass(frozen=True, eq=False)
class Frame:
    """The space of coordinates, as files of brains and of 3D Slicer define it.

    Parameters
    ----------
    space, to : str
        Spaces before and after multiplication by the matrix: ``"unknown"``, ``"scanner_anat"``,
        ``"aligned_anat"``, ``"talairach"``, ``"mni_152"`` or ``"template_other"``, as in NIfTI.
    matrix : (4, 4) array of float
        It multiplies columns x, y, z, 1.
    volume : mapping, optional
        The volume from which FreeSurfer made the surface, with the keys of nibabel.
    words : tuple of str
        Lines of the file with its unit or axes, such as comments of PLY and titles of VTK.
    """

    space: str = UNKNOWN
    to: str = UNKNOWN
    matrix: FloatArray = field(default_factory=lambda: np.eye(4))
    volume: Mapping[str, Any] | None = None
    words: tuple[str, ...] = ()

    @classmethod
    def of_lines(cls, *lines: str) -> Frame | None:
        """Make a frame of the lines with a unit or axes; None without such a line."""
        words = tuple(line.strip() for line in lines if _AXES_LINE.search(line) or _UNIT_LINE.search(line))
        return cls(words=tuple(dict.fromkeys(words))) if words else None

    @classmethod
    def of_named(cls, texts: Mapping[str, str]) -> Frame | None:
        """Make a frame of named texts, such as RAS under SPACE; None if they have no unit or axes."""
        lines = texts.get(COMMENTS, "").splitlines()
        known = {COMMENTS, SPACE} if any(map(_AXES_LINE.search, lines)) else {COMMENTS}
        return cls.of_lines(*lines, *(f"{name}={text}" for name, text in texts.items() if name not in known))

    @classmethod
    def of_volume(cls, volume: Mapping[str, Any]) -> Frame:
        """Make the frame of a FreeSurfer surface, whose origin is the centre of its volume."""
        if not str(volume.get("valid", "")).startswith("1"):
            return cls(volume=volume)
        if list(volume.get("head", ())) == _SCANNER_HEAD:
            return cls(SCANNER, SCANNER, volume=volume)
        matrix = np.eye(4)
        directions = np.stack([volume[key] for key in ("xras", "yras", "zras")], axis=1)
        matrix[:3, :3] = directions @ np.linalg.inv(_VOXEL_AXES)
        matrix[:3, 3] = volume["cras"]
        return cls(UNKNOWN, SCANNER, matrix, volume)

    @property
    def axes(self) -> Axes | None:
        """The directions of its axes, None if unknown; spaces of NIfTI and FreeSurfer are RAS."""
        names = {match["axes"].upper() for line in self.words if (match := _AXES_LINE.search(line))}
        if names:
            return cast(Axes, names.pop()) if names in ({"RAS"}, {"LPS"}) else None
        is_turned = not np.allclose(self.matrix[:3, :3], np.eye(3), atol=_MATRIX_TOLERANCE)
        is_ras = self.volume is not None or self.space != UNKNOWN or (self.to != UNKNOWN and not is_turned)
        return "RAS" if is_ras else None

    @property
    def lines(self) -> tuple[str, ...]:
        """Its words, with a line for the axes if they are known."""
        has_line = self.axes is None or any(map(_AXES_LINE.search, self.words))
        return self.words if has_line else (*self.words, f"{SPACE}={self.axes}")

    @property
    def named(self) -> dict[str, str]:
        """Its words under the names that `of_named` reads."""
        others = "\n".join(line for line in self.words if line != f"{SPACE}={self.axes}")
        return {name: text for name, text in ((SPACE, self.axes), (COMMENTS, others)) if text}

    def title(self, longest: int) -> str:
        """Join its lines into a title; if that has more bytes than ``longest``, only the axes."""
        title = "; ".join(self.lines)
        return title if len(title.encode()) <= longest else f"{SPACE}={self.axes}" if self.axes else ""

    @property
    def has_space(self) -> bool:
        """Whether it names a space or has a matrix."""
        return self.space != UNKNOWN or self.to != UNKNOWN or not self._is_like(Frame())

    @property
    def in_volume(self) -> Mapping[str, Any] | None:
        """A volume of FreeSurfer with its centre at the origin of these coordinates; None if none fits."""
        if self.volume is not None:
            of_volume = Frame.of_volume(self.volume)
            is_same = (of_volume.space, of_volume.to) == (self.space, self.to) and self._is_like(of_volume)
            if not self.has_space or is_same:
                return self.volume
        matrix = self.matrix if self.to == SCANNER else np.eye(4)
        turn = matrix[:3, :3]
        is_rotation = np.allclose(turn @ turn.T, np.eye(3), atol=_MATRIX_TOLERANCE)
        if SCANNER not in (self.space, self.to) or not is_rotation:
            return None
        return {
            **NEW_VOLUME,
            "volume": np.full(3, 256),
            "voxelsize": np.ones(3),
            **dict(zip(("xras", "yras", "zras"), (turn @ _VOXEL_AXES).T)),
            "cras": matrix[:3, 3],
        }

    @property
    def is_in_volume(self) -> bool:
        """Whether a volume of FreeSurfer contains all of it."""
        if self.words and (self.axes != "RAS" or any(map(_UNIT_LINE.search, self.words))):
            return False
        return not self.has_space or (self.to in (UNKNOWN, SCANNER) and self.in_volume is not None)

    def __str__(self) -> str:
        if self.words:
            return ", ".join(self.words)
        if self._is_like(Frame()):
            return f"in {self.to if self.space == UNKNOWN else self.space}"
        if np.allclose(self.matrix[:3, :3], np.eye(3), atol=_MATRIX_TOLERANCE):
            offset = " ".join(f"{number:g}" for number in self.matrix[:3, 3])
            return f"c_ras {offset}, the offset to {self.to}"
        return f"matrix to {self.to}"

    def _is_like(self, other: Frame) -> bool:
        return bool(np.allclose(self.matrix, other.matrix, rtol=0, atol=_MATRIX_TOLERANCE))


@dataclass(frozen=True, eq=False, repr=False)
class Asset:
    """A surface with all contents of its file.

    Values at the vertices of `mesh` go to points with `vertex_of_point`, to corners with
    `vertex_of_corner`.

    Parameters
    ----------
    points : (n, 3) array_like of float
        Positions in the order and units of the file, before any transform of a part.
    polygons : Polygons
        Triangles, quads and other polygons, in the order of the file.
    attributes : tuple of Attribute
        Values on points, corners and faces.
    parts : tuple of Part
        The meshes of a file with several meshes or with transforms; empty otherwise.
    document : object, optional
        Other contents, for writing the same format again.
    notes : tuple of str
        Sentences about what the reader left out, assumed or replaced.
    frame : Frame, optional
        The space of the coordinates, if the file defines it.

    Raises
    ------
    MeshError
        If the positions have the wrong shape, or the parts do not add up. Polygons with missing points
        are refused when they are used; `repair` removes them.
    DescriptorError
        If an attribute has a wrong number of rows, or two have the same name.

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
        points = read_only(numbers_of(self.points, "points", MeshError))
        if points.ndim != 2 or points.shape[1] != 3:
            raise MeshError(f"points have shape {points.shape}, expected (n, 3): one row x, y, z per point")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "polygons", self.polygons.at(points))
        object.__setattr__(self, "attributes", tuple(self.attributes))
        n = {"point": len(points), "corner": len(self.polygons.corners), "face": len(self.polygons)}
        sums = sum(part.n_points for part in self.parts), sum(part.n_polygons for part in self.parts)
        if self.parts and sums != (n["point"], n["face"]):
            raise MeshError(f"parts of {sums} points and polygons; there are {n['point']}, {n['face']}")
        require_lengths(self.attributes, n)

    def __repr__(self) -> str:
        names = ", ".join(attribute.name for attribute in self.attributes) or "no attributes"
        return f"{type(self).__name__}({len(self.points)} points, {len(self.polygons)} polygons; {names})"

    @classmethod
    def of_mesh(cls, mesh: Mesh, attributes: Iterable[Attribute] = ()) -> Asset:
        """Make an asset of a mesh and values on it."""
        return cls(mesh.vertices, Polygons.of_triangles(mesh.faces), tuple(attributes))

    def attribute(self, name: str, domain: Domain | None = None) -> Attribute:
        """Return an attribute by its name and, if several have it, domain; `DescriptorError` if none has."""
        for attribute in self.attributes:
            if attribute.name == name and domain in (None, attribute.domain):
                return attribute
        names = ", ".join(f"{a.name!r} of {a.domain}s" for a in self.attributes) or "none"
        raise DescriptorError(f"no attribute {name!r}{f' of {domain}s' if domain else ''}; there are {names}")

    def of_kind(self, kind: Kind) -> tuple[Attribute, ...]:
        """Return the attributes of one kind, in their order."""
        return tuple(attribute for attribute in self.attributes if attribute.kind == kind)

    def with_attributes(self, *attributes: Attribute) -> Asset:
        """Add attributes; those with the same name and domain are replaced."""
        replaced_keys = {(attribute.name, attribute.domain) for attribute in attributes}
        kept = tuple(a for a in self.attributes if (a.name, a.domain) not in replaced_keys)
        return replace(self, attributes=kept + attributes)

    def without_attributes(self, *names: str) -> Asset:
        """Remove the attributes with these names."""
        return replace(self, attributes=tuple(a for a in self.attributes if a.name not in names))

    @cached_property
    def mean_edge(self) -> float:
        """Mean side of the placed triangles; without triangles, estimated from the extent of the points."""
        places = self.placed_points
        if len(self.polygons) and len(places):
            corners = places.take(self.polygons.triangles, axis=0, mode="clip")
            sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        else:  # about the spacing that the points would have on a square grid
            sides = np.linalg.norm(places - places[:1], axis=1) / max(len(places), 1) ** 0.5
        return float(sides[np.isfinite(sides)].sum() / max(np.isfinite(sides).sum(), 1))

    def rounding(self, middles: FloatArray | float = 0.0) -> FloatArray:
        """Measure how far rounding to float32, after subtracting ``middles`` (n, 3), moves each placed point."""
        with np.errstate(over="ignore", invalid="ignore"):
            exact = self.points - middles
            rest = exact - exact.astype(np.float32)
            moved = replace(self, points=self.points - rest).placed_points - self.placed_points
            return np.asarray(np.nan_to_num(np.linalg.norm(moved, axis=1)))

    @property
    def needs_doubles(self) -> bool:
        """Whether float32 would move points by more than ``REPORTED_ROUNDING`` of the mean edge."""
        return bool(self.rounding().max(initial=0) > REPORTED_ROUNDING * self.mean_edge > 0)

    @cached_property
    def mesh(self) -> Mesh:
        """The surface for matching: ``polygons.triangles`` between welded points, at their placed positions.

        Points at exactly the same position become one vertex, which closes seams, in the order of the
        first points.
        """
        return Mesh(self.placed_points[self.point_of_vertex], self.vertex_of_point[self.polygons.triangles])

    @cached_property
    def _welded(self) -> tuple[IntArray, IntArray]:
        self.require_points()
        return weld_points(self.placed_points)

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
        """The same, with a note if some concave polygons could not be cut along their outline."""
        uncut = self.polygons.uncut
        if not len(uncut):
            return self
        note = f"the outlines of polygons {some(uncut)} cross themselves or have no area; they are cut as if convex"
        return replace(self, notes=(*self.notes, note))

    def require_points(self) -> None:
        """Raise `MeshError` if a polygon refers to a missing point."""
        corners = self.polygons.corners
        outside = np.flatnonzero((corners < 0) | (corners >= len(self.points)))
        if len(outside):
            polygons, points = some(np.unique(self.polygons.of_corner[outside])), f"0…{len(self.points) - 1}"
            remedy = "remove them, or export the file again"
            raise MeshError(f"polygons {polygons} refer to points outside {points}; {remedy}")

    def renumbered(self, rows: Renumbering) -> Asset:
        """Return the renumbered points and polygons, with all values on them."""
        index = {"point": rows.point_index, "corner": rows.corner_index, "face": rows.polygon_index}
        parts = self.parts
        if parts:
            part_of_polygon = np.repeat(np.arange(len(parts)), [part.n_polygons for part in parts])
            n_points = np.bincount(self.part_of_point[rows.point_index], minlength=len(parts)).tolist()
            n_polygons = np.bincount(part_of_polygon[rows.polygon_index], minlength=len(parts)).tolist()
            counted = zip(parts, n_points, n_polygons)
            parts = tuple(replace(part, n_points=n, n_polygons=m) for part, n, m in counted if n)
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
        """Move the vertices of its mesh to other placed positions, (n_vertices, 3)."""
        positions = numbers_of(vertices, "vertices", MeshError)
        if positions.shape != self.mesh.vertices.shape:
            raise MeshError(f"positions have shape {positions.shape}, expected {self.mesh.vertices.shape}")
        return self.placed_at(positions[self.vertex_of_point])

    def placed_at(self, places: FloatArray) -> Asset:
        """Move its points to other places, (n, 3), given after the transforms of the parts."""
        points = places.copy()
        for rows, matrix in self._transforms():
            back = np.linalg.pinv(matrix)
            points[rows] = points[rows] @ back[:3, :3].T + back[:3, 3]
        return replace(self, points=points)

    @cached_property
    def placed_points(self) -> FloatArray:
        """(n, 3) positions after the transforms of the parts."""
        transforms = self._transforms()
        points = np.array(self.points) if transforms else self.points
        for rows, matrix in transforms:
            points[rows] = product(points[rows], matrix[:3, :3].T) + matrix[:3, 3]
        return points

    def _transforms(self) -> list[tuple[slice, FloatArray]]:
        """List the rows of the points of each part with a transform, and its matrix."""
        ends = np.cumsum([part.n_points for part in self.parts])
        placed = [(part, end) for part, end in zip(self.parts, ends) if part.transform is not None]
        return [(slice(end - part.n_points, end), np.array(part.transform)) for part, end in placed]

    @cached_property
    def placed(self) -> Asset:
        """The same without transforms, which are applied to points, normals, tangents and shape keys."""
        if not self._transforms():
            return self
        attributes = tuple(self._turned(attribute) for attribute in self.attributes)
        return replace(self, points=self.placed_points, attributes=attributes, parts=(), document=None)

    def from_placed(self, attribute: Attribute) -> Attribute:
        """Transform normals, tangents or a shape key of `placed` back into the coordinates of the parts."""
        return self._turned(attribute, back=True)

    def _turned(self, attribute: Attribute, back: bool = False) -> Attribute:
        """Transform normals, tangents and keys with their parts, or back; all but keys get length 1."""
        if attribute.kind not in ("normal", "key") and not attribute.is_tangent:
            return attribute
        corners, values = self.polygons.corners, np.array(attribute.values)
        points = {"corner": corners, "face": corners[self.polygons.starts]}
        part_of = self.part_of_point[points.get(attribute.domain, slice(None))]
        for i, part in enumerate(self.parts):
            if part.transform is not None:
                matrix = np.array(part.transform)[:3, :3]
                along, across = matrix.T, np.linalg.pinv(matrix)
                if back:
                    along, across = across.T, along.T
                vectors = product(values[part_of == i, :3], across if attribute.kind == "normal" else along)
                if attribute.kind != "key":
                    length = np.linalg.norm(vectors, axis=1, keepdims=True)
                    vectors = vectors / np.where(length > 0, length, 1)
                values[part_of == i, :3] = vectors
        return attribute.with_values(values)

    @cached_property
    def part_of_point(self) -> IntArray:
        """(n,) index of the part of each point, 0 without parts."""
        counts = [part.n_points for part in self.parts] or [len(self.points)]
        return np.repeat(np.arange(len(counts)), counts)


@runtime_checkable
class RenumberedDocument(Protocol):
    """A document that refers to points or polygons by their numbers."""

    def renumbered(self, before: Asset, after: Asset, rows: Renumbering) -> object:
        """Return the document of the new asset, which has the attributes of the old one, in order."""
        ...
