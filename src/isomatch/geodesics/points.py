"""Points of a surface as a user names them: checked, made vertices of the mesh, or measured through their faces."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import MeshError, some
from isomatch.geodesics.protocol import ColumnEngine, DistanceEngine
from isomatch.surfaces import Mesh, PrecisePoints

SUM = 1e-6  # by which the weights of a point may differ from 1 together
AT_CORNER = 1e-12  # smallest weight of a corner; less is rounding, and would make faces without area


def points_of(given: ArrayLike | PrecisePoints, n_vertices: int) -> PrecisePoints:
    """Take vertices as points of the surface, and check those in faces.

    Raises
    ------
    MeshError
        If a vertex is out of range or no integer, or weights are negative or do not add up to 1.

    Examples
    --------
    >>> points_of([4, 7], 9).corners.tolist()
    [[4, 4, 4], [7, 7, 7]]
    """
    if not isinstance(given, PrecisePoints):
        return PrecisePoints.at_vertices(vertices_of(given, n_vertices))
    corners, weights = np.asarray(given.corners), np.asarray(given.barycentric, dtype=np.float64)
    if (
        corners.ndim != 2
        or corners.shape[1] != 3
        or weights.shape != corners.shape
        or corners.dtype.kind not in "iu"
    ):
        raise MeshError(
            f"points have corners of shape {corners.shape} and type {corners.dtype}, and weights of shape "
            f"{weights.shape}; expected (m, 3) vertices and (m, 3) numbers"
        )
    _require_in_range(corners.ravel(), n_vertices)
    good = (weights >= 0).all(axis=1) & (np.abs(weights.sum(axis=1) - 1) <= SUM)
    if not good.all():
        i = int(np.argmin(good))
        raise MeshError(
            f"point {i} has weights {', '.join(f'{weight:g}' for weight in weights[i])}; expected three that are not "
            "negative and add up to 1"
        )
    return PrecisePoints(corners.astype(np.int64), weights)


def vertices_of(points: ArrayLike, n_vertices: int) -> IntArray:
    """Return (m,) indices of vertices; `MeshError` if they are none or out of range."""
    vertices = np.atleast_1d(np.asarray(points))
    if vertices.ndim != 1 or (vertices.size and vertices.dtype.kind not in "iu"):
        raise MeshError("points must be a one-dimensional array of vertex indices, or PrecisePoints")
    _require_in_range(vertices, n_vertices)
    return vertices.astype(np.int64)


def joined(*parts: PrecisePoints) -> PrecisePoints:
    """List the points of several lists."""
    return PrecisePoints(
        np.concatenate([part.corners for part in parts]), np.concatenate([part.barycentric for part in parts])
    )


def _require_in_range(vertices: AnyArray, n_vertices: int) -> None:
    bad = vertices[(vertices < 0) | (vertices >= n_vertices)]
    if len(bad):
        raise MeshError(f"vertices {some(bad)} are outside 0…{n_vertices - 1}, the vertices of the surface")


@dataclass(frozen=True, eq=False)
class Inserted:
    """A mesh with further points of its surface as vertices, after those of the original."""

    mesh: Mesh  # faces with new points inside or on an edge are divided
    vertex: IntArray  # (m,) of each point: of the original, if the point is there
    face_index: IntArray  # (n_faces,) face of the original of which each face is all or a part
    places: PrecisePoints  # of each vertex of the mesh in the original


def inserted(mesh: Mesh, points: PrecisePoints) -> Inserted:
    """Make vertices of m points of a mesh, which stays as it is if all are; `MeshError` if a point is in no face."""
    # Distances between all points stay as they are, but for what an engine makes of the other triangles. O(n log n +
    # m), but for q points of one face O(q²).
    between = [between_corners(*point) for point in zip(*points)]
    if all(len(used) == 1 for used, _ in between):
        at = np.array([used[0] for used, _ in between], dtype=np.int64)
        vertices = PrecisePoints.at_vertices(np.arange(mesh.n_vertices))
        return Inserted(mesh, at, np.arange(mesh.n_faces), vertices)
    division = _Division(mesh)
    vertex = [division.insert(used, parts) for used, parts in between]
    return division.result(np.array(vertex, dtype=np.int64))


def between_corners(corners: IntArray, weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the different corners that a point has, in order, and the weight of each; together 1."""
    used, of_corner = np.unique(corners, return_inverse=True)
    parts = np.bincount(of_corner, weights)
    inside = parts >= AT_CORNER
    return used[inside], parts[inside] / parts[inside].sum()


class FacesBetween:
    """Faces of a mesh that have given corners."""

    def __init__(self, mesh: Mesh) -> None:
        used = mesh.sound_faces.ravel()
        self._faces = mesh.faces
        self._order = np.argsort(used, kind="stable")  # corners, those of a vertex together
        self._first = np.append(0, np.cumsum(np.bincount(used, minlength=mesh.n_vertices)))

    def __call__(self, corners: IntArray) -> IntArray:
        """Numbers of the faces that have all of some different corners, one of three; `MeshError` if none has."""
        around = self._order[self._first[corners[0]] : self._first[corners[0] + 1]] // 3
        faces: IntArray = around[np.isin(self._faces[around], corners).sum(axis=1) == len(corners)]
        if len(corners) > 1 and not len(faces):
            what = "edge" if len(corners) == 2 else "face"
            raise MeshError(f"a point has corners {corners.tolist()}, between which there is no {what}")
        return faces


class _Division:
    """A mesh whose faces are divided at one point after another."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._n = mesh.n_vertices
        self._faces_between = FacesBetween(mesh)
        self._faces: dict[int, tuple[int, int, int]] = {}  # of parts of divided faces, by number
        self._parts: dict[int, list[int]] = {}  # parts of a face of the mesh
        self._face_index: list[int] = []  # of the parts
        self._added: list[tuple[IntArray, FloatArray]] = []
        self._between: dict[tuple[int, ...], list[int]] = {}  # vertices added between the same corners

    def insert(self, corners: IntArray, weights: FloatArray) -> int:
        """Return the vertex of a point, given its different corners in order, and their weights."""
        if len(corners) == 1:
            return int(corners[0])
        others = self._between.setdefault(tuple(corners.tolist()), [])
        for vertex in others:
            if abs(self._added[vertex - self._n][1] - weights).max() <= AT_CORNER:
                return vertex
        faces = self._faces_between(corners)
        new = self._n + len(self._added)
        self._added.append((corners, weights))
        others.append(new)
        for face in faces:
            self._divide(int(face), new)
        return new

    def _divide(self, face: int, new: int) -> None:
        """Divide the part of a face that contains a new vertex, and the one beside it if it is on their edge."""
        if face not in self._parts:
            self._parts[face] = [self._keep(face, tuple(int(v) for v in self._mesh.faces[face]))]
        corners = self._mesh.faces[face]
        point = self.place(new, corners)
        held = [self._weights(part, corners, point) for part in self._parts[face]]
        inside = max(range(len(held)), key=lambda k: held[k].min())
        on = np.flatnonzero(held[inside] < AT_CORNER)  # corners of the part opposite to the edge of the point
        on = on if len(on) == 1 else on[:0]
        edge = {self._faces[self._parts[face][inside]][i] for i in range(3) if i not in on}
        divided = [
            part
            for k, part in enumerate(self._parts[face])
            if k == inside or (len(on) and edge <= set(self._faces[part]))
        ]
        for part in divided:
            triangle = self._faces.pop(part)
            self._parts[face].remove(part)
            for i in range(3):
                a, b = triangle[i], triangle[(i + 1) % 3]
                if not (len(on) and {a, b} == edge):
                    self._parts[face].append(self._keep(face, (a, b, new)))

    def _keep(self, face: int, triangle: tuple[int, ...]) -> int:
        number = len(self._face_index)
        self._face_index.append(face)
        self._faces[number] = (triangle[0], triangle[1], triangle[2])
        return number

    def _weights(self, part: int, corners: IntArray, point: FloatArray) -> FloatArray:
        """Barycentric coordinates of a point in a part of a face; both are given in those of the face."""
        basis = np.array([self.place(v, corners) for v in self._faces[part]])
        return np.asarray(np.linalg.solve(basis.T, point))

    def place(self, vertex: int, corners: IntArray) -> FloatArray:
        """Weights of the corners of a face at a vertex in it or on its border."""
        weights = np.zeros(3)
        if vertex < self._n:
            weights[corners == vertex] = 1.0
        else:
            for corner, weight in zip(*self._added[vertex - self._n]):
                weights[corners == corner] = weight
        return weights

    def result(self, vertex: IntArray) -> Inserted:
        mesh, n = self._mesh, self._n
        whole = np.ones(mesh.n_faces, dtype=bool)
        whole[list(self._parts)] = False
        parts = sorted(self._faces)
        triangles = np.array([self._faces[part] for part in parts], dtype=np.int64).reshape(-1, 3)
        faces = np.concatenate([mesh.faces[whole], triangles])
        index = np.concatenate([np.flatnonzero(whole), np.array(self._face_index, dtype=np.int64)[parts]])
        corners = np.repeat(np.arange(n + len(self._added))[:, None], 3, axis=1)
        weights = np.tile([1.0, 0.0, 0.0], (len(corners), 1))
        for row, (used, parts_of) in enumerate(self._added, start=n):
            corners[row], weights[row] = used[0], 0.0
            corners[row, : len(used)], weights[row, : len(used)] = used, parts_of
        places = PrecisePoints(corners, weights)
        return Inserted(Mesh(places.interpolated(mesh.vertices), faces), vertex, index, places)


class PointsInFaces(ColumnEngine):
    """The vertices of a mesh, and then m points in its faces, whose distances follow from those of the corners."""

    # For engines that need good triangles. Three columns for each source in a face; points of one face have the
    # distance in its plane.
    def __init__(self, engine: DistanceEngine, mesh: Mesh, points: PrecisePoints) -> None:
        self.name, self.n_points = engine.name, mesh.n_vertices + len(points.corners)
        self._engine, self._n = engine, mesh.n_vertices
        self._corners = points.corners
        self._places = points.interpolated(mesh.vertices)
        self._triangles = mesh.vertices[points.corners]  # (m, 3, 3)
        faces_between = FacesBetween(mesh)
        self._faces = [faces_between(between_corners(*point)[0]).tolist() for point in zip(*points)]
        self._in_face: dict[int, list[int]] = defaultdict(list)  # points of a face
        for number, faces in enumerate(self._faces):
            for face in faces:
                self._in_face[face].append(number)

    def _columns(self, sources: IntArray) -> FloatArray:
        inside = sources >= self._n
        wanted = np.concatenate([sources[~inside], self._corners[sources[inside] - self._n].ravel()])
        vertices, row = np.unique(wanted, return_inverse=True)
        of_vertices = self._engine.distances_from(vertices)
        columns = np.zeros((len(sources), self.n_points))
        columns[~inside, : self._n] = of_vertices[row[: (~inside).sum()]]
        of_corners = row[(~inside).sum() :].reshape(-1, 3)
        for at, source, corners in zip(np.flatnonzero(inside), sources[inside] - self._n, of_corners):
            columns[at, : self._n] = self._across(source, of_vertices[corners])
        for point, corners in enumerate(self._corners):
            columns[:, self._n + point] = self._across(point, columns[:, corners].T)
        for at, source in zip(np.flatnonzero(inside), sources[inside] - self._n):
            beside = [source, *(other for face in self._faces[source] for other in self._in_face[face])]
            straight = np.linalg.norm(self._places[source] - self._places[beside], axis=1)
            columns[at, self._n + np.array(beside)] = straight
        return columns

    def _across(self, point: int, distances: FloatArray) -> FloatArray:
        """(n,) distances of a point, given those (3, n) of the corners of its face."""
        # The front reaches a point through its face as fast marching reaches a vertex: two corners have known
        # distances, the *virtual source* is the point of the plane at these distances on the other side of the edge
        # between them. The point gets its straight distance from there if that crosses the edge, or else goes around a
        # corner.
        place, triangle = self._places[point], self._triangles[point]
        spokes = np.linalg.norm(triangle - place, axis=1)
        nearest: FloatArray = (distances + spokes[:, None]).min(axis=0)
        for i in range(3):
            a, b = triangle[i], triangle[(i + 1) % 3]
            length = float(np.linalg.norm(b - a))
            if length == 0.0:
                continue
            x = float((place - a) @ (b - a)) / length
            y = np.sqrt(max(spokes[i] ** 2 - x**2, 0.0))
            with np.errstate(invalid="ignore"):  # inf − inf between components
                # sx² + depth² = near², (sx − length)² + depth² = far²; the difference of the two gives sx
                # in the plane of the face the virtual source is (sx, −depth), the edge from (0, 0) to (length, 0)
                near, far = distances[i], distances[(i + 1) % 3]
                sx = 0.5 * (length + (near - far) * (near + far) / length)
                depth = np.sqrt(np.maximum(near**2 - sx**2, 0.0))
                crossing = sx * y + x * depth
                crosses = (depth > 0) & (crossing >= 0) & (crossing <= length * (y + depth))
                straight = np.hypot(x - sx, y + depth)
            nearest = np.where(crosses, np.minimum(nearest, straight), nearest)
        return nearest
