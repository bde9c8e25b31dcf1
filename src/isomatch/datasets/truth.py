"""Ground truth between two triangulations of one surface: exact closest points of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray

CHUNK = 50_000  # points handled at once, to bound memory


@dataclass(frozen=True, eq=False)
class Truth:
    """True image of each of n source vertices on the target."""

    vertices: IntArray  # (n,) nearest target vertex
    faces: IntArray  # (n,) target face that contains the closest point
    barycentric: FloatArray  # (n, 3) weights of the three corners of that face

    def points(self, target: Mesh) -> FloatArray:
        """Compute the precise images, (n, 3), on the target mesh in any pose."""
        images: FloatArray = np.einsum(
            "ij,ijx->ix", self.barycentric, target.vertices[target.faces[self.faces]]
        )
        return images


def closest_points(points: FloatArray, mesh: Mesh) -> Truth:
    """Find the closest point of a mesh to each of (n, 3) points, exactly."""
    # a face whose corners lie within R of its centroid c is at least |p − c| − R away from p. So if the faces of the k
    # nearest centroids are at least d away, and the k-th centroid is farther than d + R, no other face is closer than
    # d. Points for which this fails are searched again with more centroids, up to all of them
    triangles = mesh.vertices[mesh.faces]
    centroids = triangles.mean(axis=1)
    radius = np.sqrt(((triangles - centroids[:, None]) ** 2).sum(axis=2).max())
    tree = KDTree(centroids)
    faces = np.zeros(len(points), dtype=np.int64)
    barycentric = np.zeros((len(points), 3))
    open_points, k = np.arange(len(points)), min(12, mesh.n_faces)
    while len(open_points):
        certain = np.zeros(len(open_points), dtype=bool)
        n_chunks = -(-len(open_points) * k // (12 * CHUNK))
        for chunk in np.array_split(np.arange(len(open_points)), n_chunks):
            rows = open_points[chunk]
            reach, candidates = tree.query(points[rows], k=np.arange(1, k + 1))
            weights, distance = _closest_on_triangles(points[rows, None], triangles[candidates])
            best = distance.argmin(axis=1)[:, None]
            faces[rows] = np.take_along_axis(candidates, best, axis=1)[:, 0]
            barycentric[rows] = np.take_along_axis(weights, best[:, :, None], axis=1)[:, 0]
            certain[chunk] = (reach[:, -1] >= distance.min(axis=1) + radius) | (k == mesh.n_faces)
        open_points, k = open_points[~certain], min(4 * k, mesh.n_faces)
    nearest: IntArray = KDTree(mesh.vertices).query(points)[1].astype(np.int64)
    return Truth(nearest, faces, barycentric)


def _closest_on_triangles(points: FloatArray, triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Barycentric coordinates (…, 3) of, and distance (…) to, the closest point of each (…, 3, 3) triangle."""
    # the foot of the perpendicular if that lies inside, otherwise the closest point of the three edges
    offset = triangles - points[..., None, :]
    weights = _foot(offset)
    best = np.where((weights >= 0).all(axis=-1), _length(weights, offset), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        start, edge = offset[..., i, :], offset[..., j, :] - offset[..., i, :]
        squared = np.maximum(np.einsum("...x,...x->...", edge, edge), 1e-300)
        t = np.clip(-np.einsum("...x,...x->...", start, edge) / squared, 0, 1)
        on_edge = np.zeros_like(weights)
        on_edge[..., i], on_edge[..., j] = 1 - t, t
        distance = _length(on_edge, offset)
        closer = distance < best
        weights, best = np.where(closer[..., None], on_edge, weights), np.where(closer, distance, best)
    return weights, best


def _foot(offset: FloatArray) -> FloatArray:
    """Barycentric coordinates of the projection of the origin onto the plane of each triangle."""
    u, v = offset[..., 1, :] - offset[..., 0, :], offset[..., 2, :] - offset[..., 0, :]
    uu, uv, vv = (np.einsum("...x,...x->...", p, q) for p, q in ((u, u), (u, v), (v, v)))
    pu, pv = (-np.einsum("...x,...x->...", offset[..., 0, :], p) for p in (u, v))
    determinant = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * pu - uv * pv) / determinant, (uu * pv - uv * pu) / determinant
    return np.stack([1 - second - third, second, third], axis=-1)


def _length(weights: FloatArray, offset: FloatArray) -> FloatArray:
    """Distance from the origin to the point of each triangle with the given weights."""
    squared: FloatArray = (np.einsum("...i,...ix->...x", weights, offset) ** 2).sum(axis=-1)
    return np.sqrt(squared)
