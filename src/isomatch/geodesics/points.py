"""Points in the faces of a mesh: checked, made vertices of the mesh, or measured through their faces."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch.geodesics.protocol import ColumnEngine, DistanceEngine, require_in_range
from isomatch.surfaces import Mesh, PrecisePoints

MAX_SUM_ERROR = 1e-6  # largest difference from 1 of the sum of a point's weights; chosen above rounding
MIN_WEIGHT = 1e-12  # weights below this are set to 0, as faces there would have no area; chosen


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
    if corners.shape[1:] != (3,) or weights.shape != corners.shape or corners.dtype.kind not in "iu":
        raise MeshError(
            f"points have corners of shape {corners.shape} and type {corners.dtype}, and weights of shape "
            f"{weights.shape}; expected (m, 3) vertices and (m, 3) numbers"
        )
    require_in_range(corners, n_vertices)
    good = (weights >= 0).all(axis=1) & (np.abs(weights.sum(axis=1) - 1) <= MAX_SUM_ERROR)
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
    require_in_range(vertices, n_vertices)
    return vertices.astype(np.int64)


def concatenate_points(*parts: PrecisePoints) -> PrecisePoints:
    """Join several lists of points to one."""
    return PrecisePoints(*(np.concatenate(arrays) for arrays in zip(*parts)))


@dataclass(frozen=True, eq=False)
class DividedMesh:
    """A mesh with further points of its surface as vertices, after the original vertices."""

    mesh: Mesh  # faces with new points inside or on an edge are divided
    vertex: IntArray  # the vertex (m,) of each point, an original one if both coincide
    face_index: IntArray  # the original face (n_faces,) that contains each face
    places: PrecisePoints  # the place of each vertex in the original mesh


def insert_points(mesh: Mesh, points: PrecisePoints) -> DividedMesh:
    """Make vertices of m points of a mesh; `MeshError` if a point is in no face."""
    # Dividing faces does not change distances on the surface, but can change the errors of an engine. O(n log
    # n + m), and O(q²) for q points in one face.
    points_at = [merge_corners(*point) for point in zip(*points)]
    if all(len(corners) == 1 for corners, _ in points_at):
        vertex = np.array([corners[0] for corners, _ in points_at], dtype=np.int64)
        vertices = PrecisePoints.at_vertices(np.arange(mesh.n_vertices))
        return DividedMesh(mesh, vertex, np.arange(mesh.n_faces), vertices)
    division = _Division(mesh)
    return division.result(np.array([division.insert(*point) for point in points_at], dtype=np.int64))


def merge_corners(corners: IntArray, weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the distinct corners of a point, in increasing order, and their weights, which add up to 1."""
    distinct, number = np.unique(corners, return_inverse=True)
    total = np.bincount(number, weights)
    inside = total >= MIN_WEIGHT
    return distinct[inside], total[inside] / total[inside].sum()


class FacesBetween:
    """Faces of a mesh that have given corners."""

    def __init__(self, mesh: Mesh) -> None:
        corners = mesh.sound_faces.ravel()
        self._faces = mesh.faces
        self._order = np.argsort(corners, kind="stable")  # numbers of the corners, sorted by their vertex
        self._first = np.append(0, np.cumsum(np.bincount(corners, minlength=mesh.n_vertices)))

    def __call__(self, corners: IntArray) -> IntArray:
        """Numbers of the faces that have all of one to three distinct corners; `MeshError` if none has."""
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
        self._parts: dict[int, list[tuple[int, ...]]] = {}  # the triangles of each face that is divided
        self._added: list[tuple[IntArray, FloatArray]] = []  # corners and weights (3,) of new vertices
        self._between: dict[tuple[int, ...], list[int]] = {}  # new vertices, by their corners

    def insert(self, corners: IntArray, weights: FloatArray) -> int:
        """Return the vertex of a point, given its distinct corners in order, and their weights."""
        if len(corners) == 1:
            return int(corners[0])
        faces = self._faces_between(corners)
        weights = np.pad(weights, (0, 3 - len(weights)))
        neighbours = self._between.setdefault(tuple(corners.tolist()), [])
        for vertex in neighbours:
            if abs(self._added[vertex - self._n][1] - weights).max() <= MIN_WEIGHT:
                return vertex
        new = self._n + len(self._added)
        self._added.append((np.pad(corners, (0, 3 - len(corners)), mode="edge"), weights))
        neighbours.append(new)
        for face in faces:
            self._divide(int(face), new)
        return new

    def _divide(self, face: int, new: int) -> None:
        """Divide the part of a face that contains a new vertex, and its neighbour if that is on their edge."""
        corners = self._mesh.faces[face]
        parts = self._parts.setdefault(face, [tuple(corners.tolist())])
        place = self._place(new, corners)
        bases = (np.array([self._place(vertex, corners) for vertex in part]) for part in parts)
        weights = [np.linalg.solve(basis.T, place) for basis in bases]  # weights of the new vertex by part
        inside = max(range(len(parts)), key=lambda i: weights[i].min())
        # corners with weight 0, if the new vertex is on an edge
        opposite = np.flatnonzero(weights[inside] < MIN_WEIGHT)
        edge = set(np.delete(parts[inside], opposite).tolist()) if len(opposite) == 1 else set()
        divided = {part for part in parts if part == parts[inside] or (edge and edge <= set(part))}
        sides = [side for part in parts if part in divided for side in zip(part, (*part[1:], part[0]))]
        kept = [part for part in parts if part not in divided]
        self._parts[face] = kept + [(*side, new) for side in sides if set(side) != edge]

    def _place(self, vertex: int, corners: IntArray) -> FloatArray:
        """Weights (3,) of the corners of a face at a vertex in it or on its border."""
        if vertex < self._n:
            return np.asarray(corners == vertex, dtype=np.float64)
        between, weights = self._added[vertex - self._n]
        return np.asarray((corners[:, None] == between) @ weights)

    def result(self, vertex: IntArray) -> DividedMesh:
        """Return the mesh; faces that are divided come last."""
        mesh = self._mesh
        whole = np.delete(np.arange(mesh.n_faces), list(self._parts))
        parts = [part for face_parts in self._parts.values() for part in face_parts]
        divided = [face for face, face_parts in self._parts.items() for _ in face_parts]
        faces = np.concatenate([mesh.faces[whole], np.array(parts, dtype=np.int64).reshape(-1, 3)])
        index = np.concatenate([whole, np.array(divided, dtype=np.int64)])
        added = PrecisePoints(*(np.array(values) for values in zip(*self._added)))
        places = concatenate_points(PrecisePoints.at_vertices(np.arange(mesh.n_vertices)), added)
        return DividedMesh(Mesh(places.interpolated(mesh.vertices), faces), vertex, index, places)


class PointsInFaces(ColumnEngine):
    """The vertices of a mesh, and then m points in its faces, measured through the corners of their faces."""

    # This class is for engines that need good triangles. A source in a face takes three columns; the distance
    # of two points of one face is measured in its plane.
    def __init__(self, engine: DistanceEngine, mesh: Mesh, points: PrecisePoints) -> None:
        self.name, self.n_points = engine.name, mesh.n_vertices + len(points.corners)
        self._engine, self._n = engine, mesh.n_vertices
        self._corners = points.corners
        self._places = points.interpolated(mesh.vertices)
        self._triangles = mesh.vertices[points.corners]  # positions of each point's corners, (m, 3, 3)
        faces_between = FacesBetween(mesh)
        self._faces = [faces_between(merge_corners(*point)[0]).tolist() for point in zip(*points)]
        self._in_face: dict[int, list[int]] = defaultdict(list)  # the points in each face, by its number
        for number, faces in enumerate(self._faces):
            for face in faces:
                self._in_face[face].append(number)

    def _columns(self, sources: IntArray) -> FloatArray:
        inside = sources >= self._n
        points = sources[inside] - self._n
        vertices, row = np.unique(
            np.concatenate([sources[~inside], self._corners[points].ravel()]), return_inverse=True
        )
        from_vertices = self._engine.distances_from(vertices)
        columns = np.zeros((len(sources), self.n_points))
        columns[~inside, : self._n] = from_vertices[row[: (~inside).sum()]]
        rows_of_corners = row[(~inside).sum() :].reshape(-1, 3)
        for k, source, corners in zip(np.flatnonzero(inside), points, rows_of_corners):
            columns[k, : self._n] = self._across(source, from_vertices[corners])
        for point, corners in enumerate(self._corners):
            columns[:, self._n + point] = self._across(point, columns[:, corners].T)
        for k, source in zip(np.flatnonzero(inside), points):
            same_face = [source, *(point for face in self._faces[source] for point in self._in_face[face])]
            straight = np.linalg.norm(self._places[source] - self._places[same_face], axis=1)
            columns[k, self._n + np.array(same_face)] = straight
        return columns

    def _across(self, point: int, distances: FloatArray) -> FloatArray:
        """(n,) distances of a point, given the distances (3, n) of the corners of its face."""
        # The front reaches a point through its face as fast marching reaches a vertex: two corners have known
        # distances, and the *virtual source* is the point of the plane at these distances from them, on the
        # other side of the edge between them. If the straight line from the virtual source to the point
        # crosses the edge, its length is the distance of the point; otherwise the path goes around a corner.
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
            with np.errstate(invalid="ignore"):  # inf − inf is nan, between components
                # sx² + depth² = near² and (sx − length)² + depth² = far² give sx. In the plane of the face,
                # the virtual source is (sx, −depth), and the edge is from (0, 0) to (length, 0).
                near, far = distances[i], distances[(i + 1) % 3]
                sx = 0.5 * (length + (near - far) * (near + far) / length)
                depth = np.sqrt(np.maximum(near**2 - sx**2, 0.0))
                crossing = sx * y + x * depth
                crosses = (depth > 0) & (crossing >= 0) & (crossing <= length * (y + depth))
                straight = np.hypot(x - sx, y + depth)
            nearest = np.where(crosses, np.minimum(nearest, straight), nearest)
        return nearest
