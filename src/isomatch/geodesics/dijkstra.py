"""Shortest paths along edges: exact on graphs, approximate on point clouds, an upper bound on meshes."""

from __future__ import annotations

import numpy as np
import scipy

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.threads import parallel_map
from isomatch.geodesics.protocol import ColumnEngine, require_finite, require_in_range
from isomatch.repair import without_seams
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface

SOURCES_PER_TASK = 8  # number of sources whose distances a thread computes at once; chosen


class Dijkstra(ColumnEngine):
    """Lengths of shortest paths along edges."""

    # Dijkstra, *A note on two problems in connexion with graphs*, 1959, as implemented in scipy.
    # O(e + n log n) time per column for e edges, on all threads. On a graph this is the exact
    # distance. On a mesh or a point cloud paths zigzag, so distances are too long at any sampling:
    # by about 5 to 8 % on a mesh; for point clouds see `PointCloud`.
    name = "dijkstra"

    def __init__(self, surface: Mesh | PointCloud | Graph) -> None:
        if isinstance(surface, Mesh):
            require_finite(surface)
        self.n_points = surface.n_vertices
        i, j = surface.edges.T
        directed = np.concatenate([i, j]), np.concatenate([j, i])
        # An edge of length 0 joins coincident vertices; csr_array keeps it as an explicit zero.
        lengths = np.tile(surface.edge_lengths, 2)
        self._graph = scipy.sparse.csr_array((lengths, directed), shape=(self.n_points,) * 2)

    def lower(self, nearest: FloatArray, source: int) -> None:
        """Lower ``nearest`` (n,) in place to the distance from one more source, where it is nearer."""
        require_in_range(source, self.n_points, "sources")
        farthest = float(nearest.max(initial=0.0))
        column = scipy.sparse.csgraph.dijkstra(self._graph, indices=int(source), limit=farthest)
        np.minimum(nearest, column, out=nearest)

    def _columns(self, sources: IntArray) -> FloatArray:
        blocks = [sources[i : i + SOURCES_PER_TASK] for i in range(0, len(sources), SOURCES_PER_TASK)]
        rows = parallel_map(lambda block: scipy.sparse.csgraph.dijkstra(self._graph, indices=block), blocks)
        return np.concatenate(rows) if rows else np.zeros((0, self.n_points))


def distance_along_edges_to_nearest(
    surface: Surface, vertices: IntArray, *, weld: bool = False
) -> tuple[FloatArray, IntArray]:
    """Compute the distance along edges from each vertex to the nearest of m ≥ 1 others, and the index of that one.

    Both (n,), in the units of the surface; ``inf`` and negative where no path leads. With ``weld``,
    vertices of a mesh at exactly the same position are one point. One run of Dijkstra's algorithm
    from all vertices at once.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> distance, nearest = distance_along_edges_to_nearest(square, np.array([1]))
    >>> distance.tolist(), nearest.tolist()
    ([1.0, 0.0, 1.0, 2.0], [1, 1, 1, 1])
    """
    surface, seams = without_seams(surface, weld)
    if seams:
        point = seams.new_index
        distance, nearest = distance_along_edges_to_nearest(surface, point[vertices])
        vertex = np.full(surface.n_vertices, -1)
        vertex[point[vertices]] = vertices
        return distance[point], np.where(nearest < 0, -1, vertex[np.maximum(nearest, 0)])[point]
    i, j = surface.edges.T
    lengths = np.maximum(surface.edge_lengths, 1e-300)
    graph = scipy.sparse.coo_array((lengths, (i, j)), shape=(surface.n_vertices,) * 2).tocsr()
    distance, _, nearest = scipy.sparse.csgraph.dijkstra(
        graph, directed=False, indices=vertices, min_only=True, return_predecessors=True
    )
    return distance, nearest
