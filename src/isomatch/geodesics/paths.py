"""Shortest paths on a mesh, exact and straight across its triangles, and their files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import FormatError, MeshError
from isomatch._core.files import write_text
from isomatch.geodesics.dijkstra import Dijkstra
from isomatch.geodesics.points import concatenate_points, insert_points, points_of
from isomatch.geodesics.protocol import ordinary_unit, require_finite
from isomatch.geodesics.windows import UnfoldedFaces, Windows, windows_from
from isomatch.io import SurfaceLike, mesh_from
from isomatch.repair import repair
from isomatch.surfaces import Mesh, PrecisePoints

# an exact length may exceed the length along edges, by rounding, by at most this share; chosen
MAX_EXCESS_RATIO = 1e-9
MIN_SEGMENT_RATIO = 1e-12  # segments shorter than this share of their path are rounding and left out; chosen
PATH_SUFFIXES = (".obj", ".vtp")  # formats in which paths are written


@dataclass(frozen=True, eq=False, repr=False)
class GeodesicPath:
    """A shortest path: a polyline of k points, straight in every face.

    Parameters
    ----------
    points : PrecisePoints
        The ends, and where the path crosses edges or passes through vertices; each in a face of a
        segment that it ends.
    faces : (k − 1,) array of int
        Face in which each segment lies; none of a path of length 0.
    positions : (k, 3) array of float
        The points in space.
    length : float
        In mesh units: the exact distance of the ends on the polyhedron.

    Examples
    --------
    From a corner of the unit square to the middle of its far side:

    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> path = geodesic_path(square, 1, PrecisePoints(np.array([[2, 3, 0]]), np.array([[0.5, 0.5, 0.0]])))
    >>> path
    GeodesicPath(3 points, length 1.118)
    >>> path.positions[1].round(4) + 0.0, path.faces.tolist()
    (array([0.6667, 0.6667, 0.    ]), [0, 1])
    """

    points: PrecisePoints
    faces: IntArray
    positions: FloatArray
    length: float

    def __repr__(self) -> str:
        return f"GeodesicPath({len(self.positions)} points, length {self.length:.4g})"


def geodesic_path(
    surface: SurfaceLike, source: int | PrecisePoints, target: int | PrecisePoints, *, weld: bool = True
) -> GeodesicPath:
    """Find the shortest path between two points of a mesh.

    Parameters
    ----------
    surface : Mesh, path_like, tuple or object
        Anything that `mesh_from` takes. It need not be manifold.
    source, target : int or PrecisePoints
        A vertex, or a point in a face or on an edge.
    weld : bool
        Whether vertices at exactly the same position are one point of the surface.

    Returns
    -------
    GeodesicPath
        Any one, if several are shortest.

    Raises
    ------
    MeshError
        If a coordinate is not finite, a point is not of the surface, there are several, no path
        leads from one to the other, or faces between them have no area.
    MemoryBudgetError
        If there are too many windows.

    Notes
    -----
    The path is traced back through windows of straight rays; it is the global minimum. 10 000
    vertices take 0.25 s to set up, and 0.1 s for a path between random points; opposite ends of a
    sphere, which many paths join, take 3 s.

    Examples
    --------
    >>> tetrahedron = Mesh(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    >>> geodesic_path(tetrahedron, 0, 3)
    GeodesicPath(2 points, length 1)
    """
    paths = list(islice(geodesic_paths(surface, source, target, weld=weld), 2))
    if len(paths) != 1:
        raise MeshError(
            "geodesic_path finds one path, from one source to one target; use geodesic_paths for several"
        )
    return paths[0]


def geodesic_paths(
    surface: SurfaceLike,
    sources: ArrayLike | PrecisePoints,
    targets: ArrayLike | PrecisePoints,
    *,
    weld: bool = True,
) -> Iterator[GeodesicPath]:
    """Find the shortest path from each source to the target of the same number; the mesh is prepared once.

    ``sources`` and ``targets`` are m vertices or PrecisePoints each; the rest, and the errors, as
    for `geodesic_path`.
    """
    mesh = mesh_from(surface)
    first, second = points_of(sources, mesh.n_vertices), points_of(targets, mesh.n_vertices)
    if len(first.corners) != len(second.corners):
        raise MeshError(
            f"{len(first.corners)} sources and {len(second.corners)} targets; give a target for each source"
        )
    finder = _PathFinder(mesh, concatenate_points(first, second), weld)
    return (finder.path(i, i + len(first.corners)) for i in range(len(first.corners)))


class _Stop(NamedTuple):
    """A point on an edge of the divided mesh, and the face in which the path continues to the target."""

    start: int
    end: int
    fraction: float  # share of the edge from its start to the point
    face: int


class _PathFinder:
    """A mesh prepared for paths between some of its points: welded, without unsound faces, of ordinary size."""

    def __init__(self, mesh: Mesh, points: PrecisePoints, weld: bool) -> None:
        require_finite(mesh)
        self.original, self.points, self.unit = mesh, points, ordinary_unit(mesh)
        sound = Mesh(mesh.vertices, mesh.sound_faces)
        self.repair = repair(sound, weld=weld, remove_unused=False, orient=False)
        corners = self.repair.new_index[points.corners]
        self.division = insert_points(self.repair.mesh, PrecisePoints(corners, points.barycentric))
        self.mesh = self.division.mesh.moved(self.division.mesh.vertices / self.unit)
        self.unfolded, self.along_edges = UnfoldedFaces.of(self.mesh), Dijkstra(self.mesh)

    def path(self, i: int, j: int) -> GeodesicPath:
        """Find the path from one of the points to another."""
        source, target = (int(self.division.vertex[k]) for k in (i, j))
        bound = self.along_edges.distances_from([source])[0]
        if not np.isfinite(bound[target]):
            raise MeshError(
                "no path leads from the source to the target, which are in different components; look at check(mesh)"
            )
        windows = windows_from(self.unfolded, self.mesh.vertices, source, bound, target)
        if not windows.distance[target] <= bound[target] * (1 + MAX_EXCESS_RATIO):
            raise MeshError(
                "rays between the source and the target are lost in faces without area; look at check(mesh), and remesh"
            )
        stops = self._stops(windows, source, target)[::-1]
        places = np.array([self._place(stop) for stop in stops]).reshape(-1, 3)
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        length = float(steps.sum())
        kept = [k for k, step in enumerate(steps) if step > MIN_SEGMENT_RATIO * length]
        faces = [int(self.division.face_index[stops[k].face]) for k in kept]  # faces of the welded mesh
        turns = [n for n in range(1, len(kept)) if faces[n] != faces[n - 1]]
        rows = [self._in_face(stops[kept[n]], faces[n]) for n in turns]
        within = [faces[n] for n in [0, *turns]] if kept else []
        points = PrecisePoints(
            np.array([self.points.corners[i], *(row[0] for row in rows), self.points.corners[j]]),
            np.array([self.points.barycentric[i], *(row[1] for row in rows), self.points.barycentric[j]]),
        )
        origin = self.original.vertices[points.corners[0, 0]]  # numbers near 0 have more digits
        relative = points.interpolated((self.original.vertices - origin) / self.unit)
        length = float(np.linalg.norm(np.diff(relative, axis=0), axis=1).sum()) * self.unit
        index = self.repair.face_index[np.array(within, dtype=np.int64)]
        return GeodesicPath(points, index, points.interpolated(self.original.vertices), length)

    def _stops(self, windows: Windows, source: int, target: int) -> list[_Stop]:
        """List the points of the path, from the target back to the source."""
        faces, unfolded = self.mesh.faces, self.unfolded
        # A vertex is reached from a root along an edge, or through the faces of a row of windows. Then the
        # segment is straight in the row of unfolded faces: from c = (x, y) to the root p it crosses the side
        # at px − (x − px) py / (y − py), as in `windows._propagate`. That point, in the frame of the side of
        # the parent window, is the next (x, y), and so on to the first window, whose side is opposite to the
        # root.
        stops = [_Stop(target, target, 0.0, -1)]
        vertex = target
        while vertex != source:
            window = int(windows.reached[vertex])
            if window < 0:
                root = -1 - window
                around = unfolded.corners[unfolded.corner_first[root] : unfolded.corner_first[root + 1]] // 3
                face = around[(faces[around] == vertex).any(axis=1)][0]
            else:
                root = int(windows.root[window])
                x, y = unfolded.apex[windows.side[window]]
                while window >= 0:
                    side, (px, py) = int(windows.side[window]), windows.source[window]
                    face, i = divmod(side, 3)
                    crossing = px - (x - px) * py / (y - py)
                    fraction = float(np.clip(crossing / unfolded.length[side], 0.0, 1.0))
                    start, end = int(faces[face, i]), int(faces[face, (i + 1) % 3])
                    stops.append(_Stop(start, end, fraction, face))
                    face, window = int(windows.before[window]), int(windows.parent[window])
                    if window >= 0:
                        ends = (self._corner(windows.side[window], corner) for corner in (start, end))
                        x, y = (1 - fraction) * next(ends) + fraction * next(ends)
            stops.append(_Stop(root, root, 0.0, int(face)))
            vertex = root
        return stops

    def _corner(self, side: int, vertex: int) -> FloatArray:
        """Place of a corner of the face at a side, in the plane of that side."""
        face, i = divmod(int(side), 3)
        number = (self.mesh.faces[face].tolist().index(vertex) - i) % 3
        return (np.zeros(2), np.array([self.unfolded.length[side], 0.0]), self.unfolded.apex[side])[number]

    def _place(self, stop: _Stop) -> FloatArray:
        points = self.mesh.vertices
        return np.asarray((1 - stop.fraction) * points[stop.start] + stop.fraction * points[stop.end])

    def _in_face(self, stop: _Stop, face: int) -> tuple[IntArray, FloatArray]:
        """Corners, as the user numbers them, and weights of a point in a face of the welded mesh."""
        corners, weights = self.repair.mesh.faces[face], np.zeros(3)
        for vertex, fraction in ((stop.start, 1 - stop.fraction), (stop.end, stop.fraction)):
            for corner, weight in zip(*(array[vertex] for array in self.division.places)):
                weights[corners == corner] += fraction * weight
        return self.original.faces[self.repair.face_index[face]], weights


def write_paths(file: str | Path, paths: Sequence[GeodesicPath]) -> None:
    """Write paths as polylines: to ``.obj``, or to ``.vtp`` with the points in faces and the lengths.

    Raises
    ------
    FormatError
        If the suffix is another.
    UnwritableFileError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from isomatch import Mesh, geodesic_path
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_paths(f"{folder}/path.obj", [geodesic_path(square, 0, 1)])
    ...     print(Path(folder, "path.obj").read_text())
    v 0.0 0.0 0.0
    v 1.0 0.0 0.0
    l 1 2
    <BLANKLINE>
    """
    file = Path(file)
    if file.suffix.lower() not in PATH_SUFFIXES:
        raise FormatError(
            f"{file}: suffix {file.suffix!r} cannot hold paths; use {' or '.join(PATH_SUFFIXES)}"
        )
    write_text(file, (_obj if file.suffix.lower() == ".obj" else _vtp)(paths))


def _obj(paths: Sequence[GeodesicPath]) -> str:
    lines, first = [], 1
    for path in paths:
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in path.positions.tolist()]
        lines.append("l " + " ".join(map(str, range(first, first + len(path.positions)))))
        first += len(path.positions)
    return "\n".join([*lines, ""])


def _vtp(paths: Sequence[GeodesicPath]) -> str:
    ends = np.cumsum([len(path.positions) for path in paths]).astype(np.int64)
    n = int(ends[-1]) if len(paths) else 0

    def together(parts: Iterable[AnyArray], width: int) -> AnyArray:
        return np.concatenate([np.zeros((0, width)), *parts])

    corners = together((path.points.corners for path in paths), 3).astype(np.int64)
    weights = together((path.points.barycentric for path in paths), 3)
    arrays = (
        ("PointData", [_array("corners", corners), _array("barycentric", weights)]),
        ("CellData", [_array("length", np.array([path.length for path in paths], dtype=np.float64))]),
        ("Points", [_array("points", together((path.positions for path in paths), 3))]),
        ("Lines", [_array("connectivity", np.arange(n)), _array("offsets", ends)]),
    )
    parts = [line for tag, inside in arrays for line in (f"<{tag}>", *inside, f"</{tag}>")]
    counts = {"Points": n, "Verts": 0, "Lines": len(paths), "Strips": 0, "Polys": 0}
    piece = " ".join(f'NumberOf{kind}="{count}"' for kind, count in counts.items())
    file = '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">'
    head = ['<?xml version="1.0"?>', file, "<PolyData>", f"<Piece {piece}>"]
    return "\n".join([*head, *parts, "</Piece>", "</PolyData>", "</VTKFile>", ""])


def _array(name: str, values: AnyArray) -> str:
    kind = "Float64" if values.dtype.kind == "f" else "Int64"
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    words = " ".join(map(repr, values.ravel().tolist()))
    return f'<DataArray type="{kind}" Name="{name}"{width} format="ascii">{words}</DataArray>'
