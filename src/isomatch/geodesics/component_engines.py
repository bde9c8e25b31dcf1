"""Engines of other packages, whose solver takes one connected mesh: exact distances, and the heat method."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch._core.first_use import package
from isomatch.geodesics.dijkstra import Dijkstra
from isomatch.geodesics.protocol import ColumnEngine, ordinary_unit, require_finite
from isomatch.geodesics.windows import UnfoldedFaces, windows_from
from isomatch.repair import check, repair
from isomatch.surfaces import Mesh

Solver = Callable[[int], FloatArray]
"""Distances from a vertex of a connected mesh to all its vertices, (n,)."""

# names, as in `check`, of defects with which pygeodesic crashes or computes wrong distances
_UNSUPPORTED = ("repeated_index_faces", "duplicate_faces", "non_manifold_edges", "non_manifold_vertices")


class ComponentEngine(ColumnEngine):
    """Distances within each connected component from its own solver, and ``inf`` between components.

    A subclass sets ``name`` and implements ``_solver``. A package sees one component at a time,
    because some return finite numbers across components. A solver is set up when the first source
    lies in its component, and kept.
    """

    def __init__(self, mesh: Mesh) -> None:
        require_finite(mesh)
        self.n_points = mesh.n_vertices
        self._unit = ordinary_unit(mesh)
        self._mesh = mesh.moved(mesh.vertices / self._unit)
        # label of a component → its vertices, in increasing order, and its solver
        self._solvers: dict[int, tuple[IntArray, Solver]] = {}

    def _columns(self, sources: IntArray) -> FloatArray:
        distances = np.full((len(sources), self.n_points), np.inf)
        for row, source in zip(distances, sources):
            label = self._mesh.components[source]
            if np.count_nonzero(self._mesh.components == label) > 1:  # a single vertex needs no solver
                if label not in self._solvers:
                    mesh, vertices = self._mesh.submesh(self._mesh.components == label)
                    self._solvers[label] = vertices, self._solver(mesh)
                vertices, distances_from = self._solvers[label]
                row[vertices] = self._unit * distances_from(int(np.searchsorted(vertices, source)))
            row[source] = 0.0
        return distances

    @abstractmethod
    def _solver(self, component: Mesh) -> Solver:
        """Set up the solver of one connected mesh, of size between 1e-10 and 1e10."""


class Exact(ComponentEngine):
    """Exact geodesic distances on the polyhedron, by propagating windows of straight rays across edges."""

    # Mitchell, Mount & Papadimitriou, *The discrete geodesic problem*, SIAM J. Comput. 1987, as implemented
    # by D. Kirsanov in the package pygeodesic. The windows of `geodesic_path` serve components that are not
    # manifold, where pygeodesic 0.1.11 crashes (an edge of three faces) or is wrong (0 between two cones that
    # share their tip), and paths. For paths the windows are 5 to 25 times as fast as pygeodesic, because they
    # stop at the target; for whole columns they take 1.6 times as long. A column takes O(n² log n) time in
    # the worst case, on one thread: 60 ms and more at 5 000 vertices, 40 to 70 times as long as fast
    # marching, and 120 times as long at 28 000 vertices.
    name = "exact"

    def __init__(self, mesh: Mesh) -> None:
        self._algorithm = package("pygeodesic.geodesic", "exact", "engine 'exact'").PyGeodesicAlgorithmExact
        super().__init__(mesh)

    def _solver(self, component: Mesh) -> Solver:
        report = check(component, wall=0.0)
        if any(len(getattr(report, defect)) for defect in _UNSUPPORTED):
            return _window_solver(repair(component, weld=False, remove_unused=False, orient=False).mesh)
        algorithm = self._algorithm(component.vertices, component.faces.astype(np.int32))

        def distances_from(source: int) -> FloatArray:
            return np.asarray(algorithm.geodesicDistances(np.array([source]), None)[0], dtype=np.float64)

        return distances_from


def _window_solver(mesh: Mesh) -> Solver:
    unfolded, along_edges = UnfoldedFaces.of(mesh), Dijkstra(mesh)

    def distances_from(source: int) -> FloatArray:
        bound = along_edges.distances_from([source])[0]
        exact = windows_from(unfolded, mesh.vertices, source, bound).distance
        return np.asarray(np.minimum(exact, bound))

    return distances_from


class Heat(ComponentEngine):
    """Smooth approximate distances: heat diffuses for a short time, its gradient's directions are integrated."""

    # Crane, Weischedel & Wardetzky, *The heat method for distance computation*, CACM 2017, on the
    # robust Laplacian of Sharp & Crane 2020: (A + t L) u = δ for a short time t, X = −∇u / |∇u|,
    # and L φ = ∇·X for the distance φ. Two sparse solves per column after one factorisation per
    # component, on one thread, in the package potpourri3d. The result is smoother than the distance
    # and is not a metric: neither symmetric nor an upper bound.
    name = "heat"

    def __init__(self, mesh: Mesh) -> None:
        self._method = package("potpourri3d", "heat", "engine 'heat'").MeshHeatMethodDistanceSolver
        super().__init__(mesh)

    def _solver(self, component: Mesh) -> Solver:
        unsolvable = (
            f"the heat method cannot be solved on a component of {component.n_vertices} vertices and area "
            f"{component.area:.3g}; look at check(mesh), or use another engine"
        )
        try:
            solver = self._method(component.vertices, component.faces)
        except RuntimeError as error:
            raise MeshError(unsolvable) from error

        def distances_from(source: int) -> FloatArray:
            distances = np.asarray(solver.compute_distance(source), dtype=np.float64)
            if not np.isfinite(distances).all():
                raise MeshError(unsolvable)
            return np.maximum(distances, 0.0)

        return distances_from
