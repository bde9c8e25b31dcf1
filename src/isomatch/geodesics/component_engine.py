"""Base class of engines whose solver takes one connected mesh: a solver for each component of the surface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from isomatch.geodesics.protocol import ColumnEngine
from isomatch.geodesics.units import ordinary_unit, require_finite
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray

Solver = Callable[[int], FloatArray]
"""Distances from a vertex of a connected mesh to all its vertices, (n,)."""


class ComponentEngine(ColumnEngine):
    """Distances within each connected component from its own solver, and ``inf`` between components.

    A subclass sets ``name`` and implements ``_solver``. Some packages return finite numbers across components; here
    they never see more than one. A solver is set up when the first source lies in its component, and kept.

    Parameters
    ----------
    mesh : Mesh
        Any number n of vertices and any number of components.

    Raises
    ------
    MeshError
        If a coordinate is not finite.
    """

    def __init__(self, mesh: Mesh) -> None:
        require_finite(mesh)
        self.n_points = mesh.n_vertices
        self._unit = ordinary_unit(mesh)
        self._mesh = mesh.moved(mesh.vertices / self._unit)
        self._components: dict[int, _Component] = {}

    def _columns(self, sources: IntArray) -> FloatArray:
        distances = np.full((len(sources), self.n_points), np.inf)
        for row, source in zip(distances, sources):
            label = self._mesh.components[source]
            if np.count_nonzero(self._mesh.components == label) > 1:  # not a vertex that no face uses
                component = self._component(int(label))
                place = int(np.searchsorted(component.vertices, source))
                row[component.vertices] = self._unit * component.distances_from(place)
            row[source] = 0.0
        return distances

    def _component(self, label: int) -> _Component:
        if label not in self._components:
            mesh, vertices = self._mesh.submesh(self._mesh.components == label)
            self._components[label] = _Component(vertices, self._solver(mesh))
        return self._components[label]

    @abstractmethod
    def _solver(self, component: Mesh) -> Solver:
        """Set up the solver of one connected mesh, of size between 1e-10 and 1e10."""


class _Component(NamedTuple):
    vertices: IntArray  # indices in the whole mesh, increasing
    distances_from: Solver
