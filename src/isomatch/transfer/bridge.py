"""The map from the asset that receives to the one that gives, and places of the receiver's points on the giver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.assets import Asset, Attribute
from isomatch.correspondence import UNMATCHED, Correspondence, welded_map
from isomatch.errors import MeshError
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_property


@dataclass(frozen=True, eq=False)
class Places:
    """Points on an asset.

    Parameters
    ----------
    asset : Asset
        The asset.
    triangle : (m,) array of int
        Triangle of its polygons that holds each point; −1 for none.
    barycentric : (m, 3) array of float
        Weights of the corners of that triangle.
    """

    asset: Asset
    triangle: IntArray
    barycentric: FloatArray

    @property
    def found(self) -> BoolArray:
        """(m,) which points have a place."""
        return self.triangle >= 0

    def rows(self, attribute: Attribute) -> IntArray:
        """(m, 3) row of an attribute at each corner of the triangles."""
        return rows_of_corners(self.asset, attribute)[self.asset.polygons.corner_of_triangle[self.triangle]]

    def nearest_rows(self, attribute: Attribute) -> IntArray:
        """(m,) row of an attribute at the nearest corner of the triangle."""
        nearest = self.barycentric.argmax(axis=1)
        rows: IntArray = self.rows(attribute)[np.arange(len(nearest)), nearest]
        return rows

    def interpolated(self, values: FloatArray, rows: IntArray) -> FloatArray:
        """Interpolate rows (m, 3) of values (n, d): (m, d), nan where a point has no place."""
        total = PrecisePoints(rows, self.barycentric).interpolated(values)
        total[~self.found] = np.nan
        return total


@dataclass(frozen=True, eq=False)
class Bridge:
    """A map from the mesh of the asset that receives to the mesh of the one that gives.

    Parameters
    ----------
    map : Correspondence
        ``receiver.mesh`` → ``giver.mesh``.
    receiver, giver : Asset
        Its two ends.
    """

    map: Correspondence
    receiver: Asset
    giver: Asset

    @classmethod
    def between(cls, given: Correspondence, source: Asset, target: Asset, *, to_source: bool) -> Bridge:
        """Make the bridge of a map source → target, between the points of the two files or between their meshes.

        Raises
        ------
        MapError
            If it is a map of other surfaces.
        MeshError
            If one of them has no polygons.
        """
        for name, asset in (("source", source), ("target", target)):
            if not len(asset.polygons):
                raise MeshError(
                    f"{name}: has no polygons, and values are carried between surfaces; give a mesh"
                )
        given.check_fits(*(_mapped(asset, n) for asset, n in zip((source, target), given.shape)))
        welded = welded_map(given, *(_vertices(asset, n) for asset, n in zip((source, target), given.shape)))
        if to_source:
            return cls(welded, source, target)
        return cls(welded.reversed(source.mesh, target.mesh), target, source)

    @cached_property
    def at_vertices(self) -> Places:
        """Where the vertices of the receiver's mesh lie."""
        return self._places(self.map)

    @cached_property
    def image_positions(self) -> FloatArray:
        """(n_vertices, 3) positions of these places."""
        return self.map.pull_back(self.giver.mesh.vertices)

    def at(self, points: PrecisePoints) -> Places:
        """Where points of the receiver's mesh lie."""
        first = points.corners[np.arange(len(points.corners)), points.barycentric.argmax(axis=1)]
        samples = Correspondence(first, self.receiver.mesh.n_vertices, *points)
        return self._places(samples.then(self.map, self.receiver.mesh, self.giver.mesh))

    @cached_property
    def at_thirds(self) -> Places:
        """Where the middles of the thirds of the receiver's triangles lie, three for each triangle."""
        return self.at(self._in_triangles(np.full((3, 3), 1 / 6) + np.eye(3) / 2))

    @cached_property
    def at_polygons(self) -> Places:
        """Where the middle of each polygon's largest triangle lies."""
        polygons = self.receiver.polygons
        by_size = np.lexsort([-self.receiver.mesh.face_areas, polygons.of_triangle])
        largest = by_size[np.unique(polygons.of_triangle[by_size], return_index=True)[1]]
        middles = self._in_triangles(np.full((1, 3), 1 / 3))
        return self.at(PrecisePoints(middles.corners[largest], middles.barycentric[largest]))

    def _in_triangles(self, weights: FloatArray) -> PrecisePoints:
        faces = self.receiver.mesh.faces
        return PrecisePoints(np.repeat(faces, len(weights), axis=0), np.tile(weights, (len(faces), 1)))

    def _places(self, images: Correspondence) -> Places:
        """Find the triangles of precise images; one that lies in none is its nearest vertex."""
        faces = self.giver.mesh.faces
        n = self.giver.mesh.n_vertices
        order, corner_order = np.argsort(images.faces, axis=1), np.argsort(faces, axis=1)
        triples = np.take_along_axis(images.faces, order, axis=1)
        sorted_faces = np.take_along_axis(faces, corner_order, axis=1)
        keys = _keys(sorted_faces, n)
        by_key = np.argsort(keys, kind="stable")
        at = np.searchsorted(keys, _keys(triples, n), sorter=by_key)
        triangle = by_key[np.minimum(at, len(keys) - 1)]
        inside = images.matched & (sorted_faces[triangle] == triples).all(axis=1)
        barycentric = np.zeros((len(triples), 3))
        held = np.flatnonzero(inside)
        sorted_weights = np.take_along_axis(images.barycentric, order, axis=1)
        barycentric[held[:, None], corner_order[triangle[held]]] = sorted_weights[held]
        corner_of_vertex = np.full(n, UNMATCHED)
        corner_of_vertex[faces.ravel()] = np.arange(faces.size)
        alone = np.flatnonzero(images.matched & ~inside)
        strongest = images.faces[alone, images.barycentric[alone].argmax(axis=1)]
        triangle[~inside] = UNMATCHED
        corner = corner_of_vertex[strongest]
        triangle[alone] = np.where(corner >= 0, corner // 3, UNMATCHED)
        barycentric[alone, corner % 3] = 1.0
        return Places(self.giver, triangle, barycentric)


def columns(attribute: Attribute) -> FloatArray:
    """(k, d) the values of an attribute as floats."""
    values: FloatArray = attribute.values.reshape(len(attribute), -1).astype(np.float64)
    return values


def rows_of_corners(asset: Asset, attribute: Attribute) -> IntArray:
    """(c,) row of an attribute at each corner of an asset."""
    polygons = asset.polygons
    if attribute.domain == "point":
        return polygons.corners
    return polygons.of_corner if attribute.domain == "face" else np.arange(len(polygons.corners))


def _mapped(asset: Asset, n: int) -> Mesh:
    """Return the mesh that a map of n vertices refers to: a vertex for each point of the file, or the welded one."""
    if _is_welded(asset, n):
        return asset.mesh
    return Mesh(asset.placed_points, asset.polygons.triangles)


def _vertices(asset: Asset, n: int) -> IntArray:
    """Return the vertex of the welded mesh for each of the n vertices of a map."""
    return np.arange(n) if _is_welded(asset, n) else asset.vertex_of_point


def _is_welded(asset: Asset, n: int) -> bool:
    return n == asset.mesh.n_vertices and n != len(asset.points)


def _keys(triples: IntArray, n: int) -> IntArray:
    """One integer for each sorted triple of vertices; beyond 2²¹ vertices, the same for a few."""
    keys: IntArray = (triples[:, 0] * n + triples[:, 1]) * n + triples[:, 2]
    return keys
