"""Engines of other packages, which know nothing of separate components: each is asked for one piece at a time."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.geodesics.protocol import ColumnEngine
from isomatch.geodesics.units import ordinary_unit, require_finite
from isomatch.surfaces import Mesh

Solver = Callable[[int], FloatArray]


class _Piece(NamedTuple):
    vertices: IntArray  # its vertices in the whole mesh
    distances_from: Solver


class PieceEngine(ColumnEngine):
    """Distances within each connected component from a solver of its own, and ``inf`` between them."""

    def __init__(self, mesh: Mesh) -> None:
        require_finite(mesh)
        self.n_points = mesh.n_vertices
        self._unit = ordinary_unit(mesh)
        self._mesh = Mesh(mesh.vertices / self._unit, mesh.faces)
        self._pieces: dict[int, _Piece] = {}

    def _columns(self, sources: IntArray) -> FloatArray:
        distances = np.full((len(sources), self.n_points), np.inf)
        for row, source in zip(distances, sources):
            label = self._mesh.components[source]
            if np.count_nonzero(self._mesh.components == label) > 1:  # a vertex that no face uses is alone
                piece = self._piece(int(label))
                place = int(np.searchsorted(piece.vertices, source))
                row[piece.vertices] = self._unit * piece.distances_from(place)
            row[source] = 0.0
        return distances

    def _piece(self, label: int) -> _Piece:
        if label not in self._pieces:
            mesh, vertices = self._mesh.submesh(self._mesh.components == label)
            self._pieces[label] = _Piece(vertices, self._solver(mesh))
        return self._pieces[label]

    @abstractmethod
    def _solver(self, piece: Mesh) -> Solver:
        """Set up one connected mesh; the result maps one of its vertices to its distance column."""
