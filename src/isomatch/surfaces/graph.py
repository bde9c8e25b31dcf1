"""The weighted graph: vertices without coordinates, joined by edges with lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import BoolArray, FloatArray, IntArray, array_of, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import MeshError, some
from isomatch.surfaces._edges import label_components
from isomatch.surfaces._shared import hash_of


@dataclass(frozen=True, eq=False, repr=False)
class Graph:
    """An immutable undirected graph whose edges have lengths; distances are those of shortest paths.

    Parameters
    ----------
    n_vertices : int
        Number n of vertices, with or without edges.
    edges : (e, 2) array_like of int
        0-based end vertices of each edge, in any order. Edges are stored in lexicographic order, smaller vertex first.
        Of several edges between the same two vertices only the shortest is kept.
    lengths : (e,) array_like of float
        Length of each edge, finite and not negative.
    weights : (n,) array_like of float, optional
        Positive weight of each vertex, such as an area; by default 1.

    Examples
    --------
    >>> path = Graph(3, [[0, 1], [1, 2]], [2.0, 0.5])
    >>> path
    Graph(3 vertices, 2 edges)
    >>> path.area
    3.0
    """

    n_vertices: int
    edges: IntArray
    edge_lengths: FloatArray
    vertex_areas: FloatArray

    def __init__(
        self, n_vertices: int, edges: ArrayLike, lengths: ArrayLike, weights: ArrayLike | None = None
    ) -> None:
        ends, measured = _ends(edges, n_vertices), numbers_of(lengths, "lengths", MeshError)
        if measured.shape != (len(ends),):
            raise MeshError(f"lengths have shape {measured.shape}, expected ({len(ends)},): one per edge")
        good = np.isfinite(measured) & (measured >= 0)
        _require(good, "edges {} have lengths that are negative or not finite")
        measure = np.ones(n_vertices) if weights is None else numbers_of(weights, "weights", MeshError)
        if measure.shape != (n_vertices,):
            raise MeshError(f"weights have shape {measure.shape}, expected ({n_vertices},): one per vertex")
        good = np.isfinite(measure) & (measure > 0)
        _require(good, "vertices {} have weights that are not positive numbers")
        order = np.lexsort([measured, ends[:, 1], ends[:, 0]])  # the shortest of equal edges comes first
        ends, measured = ends[order], measured[order]
        first = np.ones(len(ends), dtype=bool)
        first[1:] = (ends[1:] != ends[:-1]).any(axis=1)
        object.__setattr__(self, "n_vertices", int(n_vertices))
        for name, array in (
            ("edges", ends[first]),
            ("edge_lengths", measured[first]),
            ("vertex_areas", measure.copy()),
        ):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __repr__(self) -> str:
        return f"Graph({self.n_vertices} vertices, {len(self.edges)} edges)"

    @cached_property
    def area(self) -> float:
        """Sum of the weights."""
        return float(self.vertex_areas.sum())

    @cached_property
    def content_hash(self) -> str:
        """Hash of edges, lengths and weights, 32 hexadecimal digits."""
        return hash_of(self, self.edges, self.edge_lengths, self.vertex_areas)

    @cached_property
    def components(self) -> IntArray:
        """(n,) label of the connected component of each vertex."""
        return label_components(self.n_vertices, tuple(self.edges.T))[1]


def _ends(edges: ArrayLike, n_vertices: int) -> IntArray:
    array = array_of(edges, "edges", MeshError)
    if array.size == 0:
        array = np.zeros((0, 2), dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
        raise MeshError(
            f"edges have shape {array.shape} and type {array.dtype}, expected (e, 2) integers: two vertices per edge"
        )
    _require(
        np.all((array >= 0) & (array < n_vertices), axis=1),
        f"edges {{}} have ends outside 0…{n_vertices - 1}, the vertices of the graph",
    )
    _require(array[:, 0] != array[:, 1], "edges {} join a vertex to itself")
    return np.sort(array.astype(np.int64), axis=1)


def _require(good: BoolArray, complaint: str) -> None:
    if not good.all():
        raise MeshError(f"{complaint.format(some(np.flatnonzero(~good)))}; correct or remove them")
