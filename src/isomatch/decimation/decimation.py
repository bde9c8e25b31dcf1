"""Decimation: a coarser mesh of the same surface, made by collapsing edges of least quadric error."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import MeshError, SettingError, some
from isomatch.decimation._collapse import (
    BOUNDARY,
    FIXED,
    KIND,
    N_BUCKETS,
    collapse_edges,
    costs_of_edges,
    describe_vertices,
    link_corners,
    remove_gaps,
)
from isomatch.surfaces import Mesh, in_spatial_order

# meshes of more vertices are decimated block by block, so that a block is in the processor's cache; chosen
MAX_CACHED_VERTICES = 2**16
BLOCK_VERTICES = 2048  # vertices in a block; chosen: at about 250 bytes each, half of a cache of 1 MB
MAX_BLOCK_SHARE = 0.5  # largest share of the vertices of a block that one round merges; chosen
# Rounds are allowed to collapse the cheapest edges: at first this share of all edges, later the next; chosen.
EDGE_SHARES = (0.4, 0.6, 0.8, 1.0)
# After a round that merges at most this share of the vertices, the next of EDGE_SHARES applies; chosen.
MIN_PROGRESS_SHARE = 0.02
# Weights of the squared distance to each merged vertex, where the squared distance to the plane of each face
# has the weight 1. The first is chosen. The second is for decimation in which the vertices left keep their
# places: four shapes of TOSCA, decimated to a tenth of their vertices, lose 0.5 to 2.3 % of their volume with
# the weight 1e-3, and 0.7 to 2.9 % with the weight 1e-2.
POINT_WEIGHT, IN_PLACE_POINT_WEIGHT = 1e-2, 1e-3
N_SAMPLED_FACES = 20_000  # number of faces whose edges give the distribution of costs; chosen


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
        The number of vertices asked for. The coarse mesh has more if no other edge could be
        collapsed.
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
        Whether each coarse vertex lies, up to rounding, where one of the vertices merged into it
        was, and vertices of boundaries are not merged with one another.
    weights : (n,) array of float, optional
        Weights of the vertices. If given, the cost of an edge is the sum of the squared distances
        to the vertices merged, times their weights; planes of faces have no part in it. The density
        of the coarse mesh grows with √weight.

    Returns
    -------
    Decimated
        It has the components, boundary loops, Euler number, and directions of faces of the mesh. So
        a small component or loop keeps a few vertices, and no vertex at which the mesh is not
        manifold is merged into another: the result then may have more vertices than asked for.

    Raises
    ------
    MeshError
        If a face has a vertex twice or one that does not exist, or a coordinate is not finite.

    Notes
    -----
    Garland & Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997, where
    an edge is collapsed if that preserves the topology (Dey, Edelsbrunner, Guha & Nekhayev,
    *Topology preserving edge contraction*, 1999), and turns no face too far nor makes it a sliver.
    O(n) time, about 300 bytes for each vertex.

    Examples
    --------
    >>> turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    >>> points = [[np.cos(t), np.sin(t), z] for t in turn for z in (0.0, 0.2)]
    >>> faces = [face for i in range(0, 40, 2) for face in ((i, i + 2, i + 1), (i + 1, i + 2, i + 3))]
    >>> decimate(Mesh(points, np.array(faces) % 40), 20)
    Decimated(40 → 20 vertices)
    """
    return decimations(mesh, [n_vertices], in_place=in_place, weights=weights)[0]


def decimations(
    mesh: Mesh, sizes: Sequence[int], *, in_place: bool = False, weights: FloatArray | None = None
) -> list[Decimated]:
    """Make coarser meshes of descending sizes, each the same as by `decimate`; common rounds are done once.

    Each size costs its last rounds and about 300 bytes for each vertex left when it parts from the
    others.
    """
    if list(sizes) != sorted(sizes, reverse=True) or not len(sizes):
        raise SettingError(f"sizes = {list(sizes)} are not descending; give the largest first")
    if min(sizes) < 1:
        raise SettingError(f"n_vertices = {min(sizes)} leaves nothing of the mesh; ask for at least 1")
    small = [Decimated(mesh, np.arange(mesh.n_vertices), size) for size in sizes if size >= mesh.n_vertices]
    sizes = sizes[len(small) :]
    if not sizes:
        return small
    rounds = _Rounds(mesh, in_place, weights)
    coarse = []
    for size in sizes:
        common = None
        while rounds.n > size and not rounds.is_over:
            if size > sizes[-1] and not rounds.is_far_from(size):
                common = common or deepcopy(rounds)  # copied, as the next round might end at this size too
            rounds.collapse(size)
        coarse.append(rounds.result(mesh, size))
        rounds = common or rounds
    return small + coarse


class _Rounds:
    """A mesh on its way to a coarser one: the arrays of `_collapse`, compact after every round."""

    # Each round collapses edges below a cost, the cheapest first; in a large mesh block by block.
    # Vertices and faces are in spatial order.
    def __init__(self, mesh: Mesh, in_place: bool, weights: FloatArray | None) -> None:
        faces, n = _sound_faces(mesh), mesh.n_vertices
        points, faces, order = in_spatial_order(normalised(mesh.vertices)[0], faces)
        vertices, marks = np.zeros((n, 13)), np.zeros((n, 5), dtype=np.int32)
        vertices[:, :3] = points
        corners = np.empty((faces.size, 2), dtype=np.int32)
        corners[:, 0] = faces.ravel()
        owner = np.empty(n, dtype=np.int32)
        owner[order] = np.arange(n, dtype=np.int32)
        link_corners(marks, corners)
        point_weight = IN_PLACE_POINT_WEIGHT if in_place else POINT_WEIGHT
        describe_vertices(vertices, marks, corners, np.empty((n, 2), dtype=np.int32), point_weight)
        if weights is not None:
            _describe_by_distances(vertices, weights[order])
        if in_place:
            marks[marks[:, KIND] == BOUNDARY, KIND] = FIXED
        self.n = n  # number of vertices left
        self.vertices, self.marks, self.corners = vertices, marks, corners
        self.owner = owner  # int32 (n_fine,): the vertex into which each vertex of the mesh was merged
        self.in_place = in_place
        # how many of EDGE_SHARES were tried, and how many edges the last round collapsed
        self.n_shares = self.n_collapsed = 0

    @property
    def is_over(self) -> bool:
        """Whether no edge can be collapsed."""
        return self.n_shares == len(EDGE_SHARES) and not self.n_collapsed

    def is_far_from(self, n_vertices: int) -> bool:
        """Whether the mesh is large and cannot reach the number of vertices in a round by blocks."""
        return self.n > MAX_CACHED_VERTICES and self.n * (1 - MAX_BLOCK_SHARE) > n_vertices + BLOCK_VERTICES

    def collapse(self, n_vertices: int) -> None:
        """Collapse edges in one round, until a number of vertices is left."""
        if self.n_collapsed <= MIN_PROGRESS_SHARE * self.n:
            self.n_shares = min(self.n_shares + 1, len(EDGE_SHARES))
        share, block, max_per_block = EDGE_SHARES[self.n_shares - 1], self.n, self.n - n_vertices
        if self.is_far_from(n_vertices):
            block, max_per_block = BLOCK_VERTICES, int(MAX_BLOCK_SHARE * BLOCK_VERTICES)
        arrays = self.vertices, self.marks, self.corners
        scale, limit = _costs(*arrays, share, self.in_place)
        queue = np.empty((N_BUCKETS + 1 + 3 * block, 4), dtype=np.int32)
        self.n_collapsed = collapse_edges(*arrays, queue, scale, limit, max_per_block, block, self.in_place)
        self.n -= self.n_collapsed
        n_corners = remove_gaps(self.vertices, self.marks, self.corners, self.owner)
        self.vertices, self.marks = self.vertices[: self.n], self.marks[: self.n]
        self.corners = self.corners[:n_corners]
        link_corners(self.marks, self.corners)

    def result(self, mesh: Mesh, wanted: int) -> Decimated:
        """Return the coarse mesh, its vertices in the order of the first fine vertices merged into them."""
        _, centre, size = normalised(mesh.vertices)
        first = np.empty(self.n, dtype=np.int64)
        # of equal indices, the last one written stays: backwards, the first vertex merged into each
        first[self.owner[::-1]] = np.arange(len(self.owner))[::-1]
        order, number = np.argsort(first), np.empty(self.n, dtype=np.int64)
        number[order] = np.arange(self.n)
        faces = number[self.corners[:, 0]].reshape(-1, 3)
        return Decimated(Mesh(self.vertices[order, :3] * size + centre, faces), number[self.owner], wanted)


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
    """Median of the costs of edges, and the quantile of the costs that is given by a share."""
    step = len(corners) // (3 * N_SAMPLED_FACES) + 1
    ends = corners[:, 0].reshape(-1, 3)[::step, :2].astype(np.int64)
    costs = costs_of_edges(vertices, marks, ends, in_place)
    costs = costs[np.isfinite(costs)]
    if not len(costs):
        return 1.0, np.inf
    scale = max(float(np.median(costs)), float(np.finfo(float).tiny))
    return scale, float(np.quantile(costs, share)) if share < 1.0 else np.inf


def normalised(vertices: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Move the middle of vertices to 0 and scale them to [−1, 1]; return also the middle, and the size."""
    # column by column, which is faster
    low, high = (np.array([extreme(x) for x in vertices.T]) for extreme in (np.min, np.max))
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
