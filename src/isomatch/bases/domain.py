"""The domain of a basis: distances, a weight for each vertex, and paths between all of them."""

from __future__ import annotations

from typing import get_args

import numpy as np

from isomatch.bases.choices import Weighting
from isomatch.errors import MeshError, SettingError
from isomatch.geodesics import DistanceEngine, MetricSpace, distance_engine
from isomatch.values.arrays import FloatArray


def basis_domain(
    surface: MetricSpace, weights: Weighting = "area", engine: str | None = None, n_columns: int = 1
) -> tuple[DistanceEngine, FloatArray]:
    """Set up the distances and the weights of a surface, or refuse one that cannot have a basis.

    Parameters
    ----------
    surface : Mesh, PointCloud or other metric space
        Anything that `distance_engine` takes, n points.
    weights : {"area", "uniform"}
        Vertex areas, or ones; ones in any case if the space has no areas.
    engine : str, optional
        How distances are computed; by default the first of ``engine_names(type(surface))``.
    n_columns : int
        Number of distance columns that will be asked for.

    Returns
    -------
    engine : DistanceEngine
    weights : (n,) array of float
        Positive.

    Raises
    ------
    SettingError
        If a setting is unknown.
    MeshError
        If the surface has fewer than ``n_columns`` points or several components, or a vertex has no area.

    Notes
    -----
    O(n); no distance is computed.
    """
    distances = distance_engine(surface, engine, weld=False)
    n = distances.n_points
    if n < n_columns:
        raise MeshError(
            f"{n} vertices are too few for {n_columns} distance columns; subdivide the mesh, or ask for fewer columns"
        )
    measure = _measure(surface, weights, n)
    require_one_component(surface)
    return distances, measure


def require_one_component(surface: MetricSpace) -> None:
    """Raise `MeshError` if a surface has several components; a matrix or a function is not examined."""
    components = getattr(surface, "components", None)
    if components is not None and components.any():
        raise MeshError(
            f"the surface has {components.max() + 1} components, and no path leads from one to another; pass one "
            "component, such as mesh.submesh(mesh.components == 0)[0], or call repair(mesh) if a seam divides them"
        )


def require_areas(areas: FloatArray, remedy: str = "") -> FloatArray:
    """Return the areas of vertices if they are positive and their products do not overflow, else raise `MeshError`."""
    with np.errstate(over="ignore", invalid="ignore"):
        bad = int((~((areas > 0) & np.isfinite(areas * areas.sum()))).sum())
    if bad:
        raise MeshError(
            f"{bad} vertices have no area, or one out of the range of floats; call repair(mesh), scale huge or tiny "
            f"coordinates to about 1{remedy}"
        )
    return areas


def _measure(surface: MetricSpace, weights: Weighting, n: int) -> FloatArray:
    if weights not in get_args(Weighting):
        raise SettingError(f"weights = {weights!r} is not one of {', '.join(map(repr, get_args(Weighting)))}")
    areas: FloatArray | None = getattr(surface, "vertex_areas", None)
    if weights == "uniform" or areas is None:
        return np.ones(n)
    return require_areas(areas, ", or use weights='uniform'")
