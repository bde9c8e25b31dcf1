"""The heat method for distances, computed by the package potpourri3d."""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch.errors import MeshError, MissingDependencyError
from isomatch.geodesics.component_engine import ComponentEngine, Solver
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray


class Heat(ComponentEngine):
    """Smooth approximate distances: heat diffuses for a short time, and the directions of its gradient are integrated.

    Parameters
    ----------
    mesh : Mesh
        Any mesh of finite coordinates and positive area; it need not be manifold.

    Raises
    ------
    MissingDependencyError
        Without the package ``potpourri3d``.
    MeshError
        If a component has no area.

    Notes
    -----
    Crane, Weischedel & Wardetzky, *The heat method for distance computation*, CACM 2017, on the robust Laplacian of
    Sharp & Crane 2020. Two sparse solves per column after one factorisation per component, on one thread. The
    result is smoother than the distance and is not a metric: neither symmetric nor an upper bound.
    """

    name = "heat"

    def __init__(self, mesh: Mesh) -> None:
        self._method = _package()
        super().__init__(mesh)

    def _solver(self, component: Mesh) -> Solver:
        try:
            solver = self._method(component.vertices, component.faces)
        except RuntimeError as error:
            raise _unsolvable(component) from error

        def distances_from(source: int) -> FloatArray:
            distances = np.asarray(solver.compute_distance(source), dtype=np.float64)
            if not np.isfinite(distances).all():
                raise _unsolvable(component)
            return np.maximum(distances, 0.0)

        return distances_from


def _unsolvable(component: Mesh) -> MeshError:
    return MeshError(
        f"the heat method cannot be solved on a component of {component.n_vertices} vertices and area "
        f"{component.area:.3g}; look at check(mesh), or use another engine"
    )


def _package() -> Any:
    try:
        from potpourri3d import MeshHeatMethodDistanceSolver
    except ImportError:
        raise MissingDependencyError(
            "engine 'heat' needs the package potpourri3d; pip install 'isomatch[heat]'"
        ) from None
    return MeshHeatMethodDistanceSolver
