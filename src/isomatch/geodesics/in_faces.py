"""Distances of points in faces from those of the corners, for engines that need good triangles."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from isomatch.geodesics.inserted import FacesBetween, between_corners
from isomatch.geodesics.protocol import ColumnEngine, DistanceEngine
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch.values.arrays import FloatArray, IntArray


class PointsInFaces(ColumnEngine):
    """The vertices of a mesh, and then points in its faces.

    The front reaches a point through its face as fast marching reaches a vertex: two corners have known distances, the
    *virtual source* is the point of the plane at these distances on the other side of the edge between them, and the
    point gets its straight distance from there if that crosses the edge, or else goes around a corner.

    Parameters
    ----------
    engine : DistanceEngine
        Distances of the n vertices.
    mesh : Mesh
    points : PrecisePoints
        m points, which become n … n + m − 1.

    Notes
    -----
    Three columns for each source in a face. Points of one face have the distance in its plane.
    """

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
        known = self._engine.distances_from(vertices)
        columns = np.zeros((len(sources), self.n_points))
        columns[~inside, : self._n] = known[row[: (~inside).sum()]]
        of_corners = row[(~inside).sum() :].reshape(-1, 3)
        for at, source, corners in zip(np.flatnonzero(inside), sources[inside] - self._n, of_corners):
            columns[at, : self._n] = self._across(source, known[corners])
        for point, corners in enumerate(self._corners):
            columns[:, self._n + point] = self._across(point, columns[:, corners].T)
        for at, source in zip(np.flatnonzero(inside), sources[inside] - self._n):
            beside = [source, *(other for face in self._faces[source] for other in self._in_face[face])]
            straight = np.linalg.norm(self._places[source] - self._places[beside], axis=1)
            columns[at, self._n + np.array(beside)] = straight
        return columns

    def _across(self, point: int, distances: FloatArray) -> FloatArray:
        """(n,) distances of a point, given those (3, n) of the corners of its face."""
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
                # in the plane of the face the virtual source is (sx, −depth), the edge from (0, 0) to (length, 0)
                near, far = distances[i], distances[(i + 1) % 3]
                sx = 0.5 * (length + (near - far) * (near + far) / length)
                depth = np.sqrt(np.maximum(near**2 - sx**2, 0.0))
                crossing = sx * y + x * depth
                crosses = (depth > 0) & (crossing >= 0) & (crossing <= length * (y + depth))
                straight = np.hypot(x - sx, y + depth)
            nearest = np.where(crosses, np.minimum(nearest, straight), nearest)
        return nearest
