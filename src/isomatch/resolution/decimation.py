"""Decimation: a coarser mesh of the same surface, by collapsing edges in the order of their quadric errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.errors import MeshError, SettingError, some
from isomatch.resolution._collapse import (
    BOUNDARY,
    FIXED,
    KIND,
    N_BUCKETS,
    PARENT,
    collapse_edges,
    costs_of_edges,
    describe_vertices,
    link_corners,
)
from isomatch.surfaces import Mesh
from isomatch.values.arrays import AnyArray, FloatArray, IntArray

SHARES = (0.4, 0.6, 0.8, 1.0)  # of the edges that a round may collapse; after little progress, the next
LEAST_PROGRESS = 0.02  # of the vertices, in a round
POINT_WEIGHT = 1e-2  # of squared distances to the merged vertices, beside those to the planes of faces
IN_PLACE_WEIGHT = (
    1e-3  # the same where no vertex moves: at a tenth of an animal's vertices, the volume is nearer by 1 %
)
N_SAMPLES = 20_000  # faces, whose edges tell the distribution of costs


@dataclass(frozen=True, eq=False, repr=False)
class Decimated:
    """A mesh and the coarser one made of it.

    Parameters
    ----------
    mesh : Mesh
        The coarse mesh. Its vertices are in the order of the first fine vertices merged into them.
    owner : (n_fine,) array of int
        Vertex of the coarse mesh into which each vertex was merged.
    wanted : int
        The number of vertices asked for. The coarse mesh has more if no other edge could be collapsed.
    """

    mesh: Mesh
    owner: IntArray
    wanted: int

    def __repr__(self) -> str:
        stalled = f", {self.wanted} wanted" if self.is_stalled else ""
        return f"Decimated({len(self.owner)} → {self.mesh.n_vertices} vertices{stalled})"

    @property
    def is_stalled(self) -> bool:
        """Whether the mesh is larger than was asked for because the vertices left could not be merged."""
        return self.mesh.n_vertices > self.wanted


def decimate(
    mesh: Mesh, n_vertices: int, *, in_place: bool = False, weights: FloatArray | None = None
) -> Decimated:
    """Make a coarser mesh of the same surface.

    Parameters
    ----------
    mesh : Mesh
        With n vertices.
    n_vertices : int
        Number of vertices to keep. A mesh that has no more is returned as it is.
    in_place : bool
        Whether each coarse vertex lies, but for rounding, where one of the vertices merged into it was, and vertices of
        boundaries are not merged with one another.
    weights : (n,) array of float, optional
        Weights of the vertices. If given, the cost of an edge is the sum of the squared distances to the vertices merged,
        times their weights, whatever the planes of the faces: the density of the coarse mesh grows with √weight.

    Returns
    -------
    Decimated
        Components, boundary loops, Euler number, and the directions of faces are those of the mesh. So a small component
        or loop keeps a few vertices, and no vertex at which the mesh is not manifold is merged into another: the result
        then may have more vertices than asked for.

    Raises
    ------
    MeshError
        If a face has a vertex twice or one that does not exist, or a coordinate is not finite.
    SettingError
        If ``n_vertices`` is not positive.

    Notes
    -----
    Garland & Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997, with planes perpendicular to
    the surface at boundaries, and a small multiple of the squared distance to the merged vertices, so that flat parts get
    even triangles. An edge is collapsed if that preserves the topology (Dey, Edelsbrunner, Guha & Nekhayev, *Topology
    preserving edge contraction*, 1999), and turns no face too far nor makes it a sliver. In rounds: each collapses edges
    below a cost, the cheapest first, on a mesh that is compact in memory. O(n) time, about 300 bytes for each vertex.

    Examples
    --------
    >>> turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    >>> points = [[np.cos(t), np.sin(t), z] for t in turn for z in (0.0, 0.2)]
    >>> faces = [face for i in range(0, 40, 2) for face in ((i, i + 2, i + 1), (i + 1, i + 2, i + 3))]
    >>> decimate(Mesh(points, np.array(faces) % 40), 20)
    Decimated(40 → 20 vertices)
    """
    if n_vertices < 1:
        raise SettingError(f"n_vertices = {n_vertices} leaves nothing of the mesh; ask for at least 1")
    owner: IntArray = np.arange(mesh.n_vertices)
    if n_vertices >= mesh.n_vertices:
        return Decimated(mesh, owner, n_vertices)
    faces = _sound_faces(mesh)
    n = mesh.n_vertices
    points, centre, size = normalised(mesh.vertices)
    order = _spatial_order(points)
    vertices, marks = np.zeros((n, 13)), np.zeros((n, 5), dtype=np.int32)
    vertices[:, :3] = points[order]
    owner[order] = np.arange(n)
    faces = owner[faces]
    corners = np.empty((faces.size, 2), dtype=np.int32)
    corners[:, 0] = faces[np.argsort(faces.min(axis=1), kind="stable")].ravel()
    link_corners(marks, corners)
    point_weight = IN_PLACE_WEIGHT if in_place else POINT_WEIGHT
    describe_vertices(vertices, marks, corners, np.empty((n, 2), dtype=np.int32), point_weight)
    if weights is not None:
        _describe_by_distances(vertices, weights[order])
    if in_place:
        marks[marks[:, KIND] == BOUNDARY, KIND] = FIXED
    rounds = iter(SHARES)
    share, n_gone = 0.0, 0
    while n > n_vertices:
        if n_gone <= LEAST_PROGRESS * n:
            if share == 1.0 and not n_gone:
                break
            share = next(rounds, 1.0)
        scale, limit = _costs(vertices, marks, corners, share, in_place)
        queue = np.empty((N_BUCKETS + 1 + len(corners) // 2, 4), dtype=np.int32)
        n_gone = collapse_edges(vertices, marks, corners, queue, scale, limit, n - n_vertices, in_place)
        parent = marks[:, PARENT]
        is_kept = parent == np.arange(n)
        number = np.cumsum(is_kept) - 1
        owner = number[parent[owner]]
        n, vertices, marks = n - n_gone, vertices[is_kept], marks[is_kept]
        corners = corners[corners[:, 0] >= 0]
        corners[:, 0] = number[corners[:, 0]]
        link_corners(marks, corners)
    _, first = np.unique(owner, return_index=True)
    order = np.argsort(first)
    number = np.argsort(order)
    coarse = Mesh(vertices[order, :3] * size + centre, number[corners[:, 0]].reshape(-1, 3))
    return Decimated(coarse, number[owner], n_vertices)


def _spatial_order(points: FloatArray) -> IntArray:
    """Order points of the cube [−1, 1]³ by Morton's curve: neighbours then lie near one another in memory."""
    cell = ((points + 1) * (2**9 - 1)).astype(np.int64)
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        cell = (cell | cell << shift) & mask
    order: IntArray = np.argsort(cell @ np.array([1, 2, 4]), kind="stable")
    return order


def _describe_by_distances(vertices: FloatArray, weights: FloatArray) -> None:
    """Set the quadrics to the squared distances to the vertices, times weights."""
    points = vertices[:, :3]
    vertices[:, 3:] = 0.0
    vertices[:, [3, 6, 8]] = weights[:, None]
    vertices[:, 9:12] = -weights[:, None] * points
    vertices[:, 12] = weights * (points**2).sum(axis=1)


def _costs(
    vertices: FloatArray, marks: AnyArray, corners: AnyArray, share: float, in_place: bool
) -> tuple[float, float]:
    """Median of the costs of edges, and the cost below which a share of them is."""
    step = len(corners) // (3 * N_SAMPLES) + 1
    ends = corners[:, 0].reshape(-1, 3)[::step, :2].astype(np.int64)
    costs = costs_of_edges(vertices, marks, ends, in_place)
    costs = costs[np.isfinite(costs)]
    if not len(costs):
        return 1.0, np.inf
    scale = max(float(np.median(costs)), float(np.finfo(float).tiny))
    return scale, float(np.quantile(costs, share)) if share < 1.0 else np.inf


def normalised(vertices: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Vertices about their middle, of size 1 or less; the middle, and the size."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = low / 2 + high / 2
    size = float((high / 2 - low / 2).max()) or 1.0
    return (vertices - centre) / size, centre, size


def _sound_faces(mesh: Mesh) -> IntArray:
    a, b, c = mesh.sound_faces.T
    bad = (a == b) | (b == c) | (c == a)
    if bad.any():
        raise MeshError(
            f"faces {some(np.flatnonzero(bad))} have a vertex twice, so the surface is undefined there; "
            "remove them with repair(mesh)"
        )
    bad = ~np.isfinite(mesh.vertices).all(axis=1)
    if bad.any():
        raise MeshError(
            f"vertices {some(np.flatnonzero(bad))} are not finite numbers; remove them with repair(mesh)"
        )
    return mesh.faces
