"""The common part of all bases: weights and a domain, a rule for signs, and pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Unpack

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import MeshError
from isomatch._core.first_use import PlotOptions, Shown, visualization
from isomatch._core.settings import require_one_of
from isomatch.geodesics import DistanceEngine, MetricSpace, distance_engine
from isomatch.io import SurfaceLike

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BasisMethod = Literal["predicted", "nystrom", "fmds", "smds", "exact"]
Weighting = Literal["area", "uniform"]


def basis_domain(
    surface: MetricSpace, weights: Weighting = "area", engine: str | None = None, n_columns: int = 1
) -> tuple[DistanceEngine, FloatArray]:
    """Set up the engine and the positive weights (n,) of a surface, if it can have a basis.

    Weights are vertex areas, or ones if "uniform" or if the space has no areas; ``n_columns`` is
    the number of distance columns that the basis will need.

    Raises
    ------
    SettingError
        If a setting is unknown.
    MeshError
        If the surface has fewer than ``n_columns`` points or several components, or a vertex has no
        area.
    """
    distances = distance_engine(surface, engine, weld=False)
    n = distances.n_points
    if n < n_columns:
        raise MeshError(
            f"{n} vertices are too few for {n_columns} distance columns; subdivide the mesh, or ask for fewer columns"
        )
    require_one_of("weights", weights, Weighting)
    areas: FloatArray | None = None if weights == "uniform" else getattr(surface, "vertex_areas", None)
    measure = np.ones(n) if areas is None else require_areas(areas, ", or use weights='uniform'")
    require_one_component(surface)
    return distances, measure


def require_one_component(surface: MetricSpace) -> None:
    """Raise `MeshError` if a surface has several components; a matrix or a function is not checked."""
    components = getattr(surface, "components", None)
    if components is not None and components.any():
        raise MeshError(
            f"the surface has {components.max() + 1} components, and no path leads from one to another; pass one "
            "component, such as mesh.submesh(mesh.components == 0)[0], or call repair(mesh) if a seam divides them"
        )


def require_areas(areas: FloatArray, remedy: str = "") -> FloatArray:
    """Return areas of vertices; `MeshError` if one is not positive or their products overflow."""
    with np.errstate(over="ignore", invalid="ignore"):
        bad = int((~((areas > 0) & np.isfinite(areas * areas.sum()))).sum())
    if bad:
        raise MeshError(
            f"{bad} vertices have no area, or one out of the range of floats; call repair(mesh), scale huge or tiny "
            f"coordinates to about 1{remedy}"
        )
    return areas


def shared_weights(weights: FloatArray, point: IntArray) -> FloatArray:
    """Share the weight of each point of a welded mesh among its vertices (n,); sums and norms stay."""
    return np.asarray((weights / np.bincount(point, minlength=len(weights)))[point])


def fix_signs(vectors: FloatArray, weights: FloatArray) -> FloatArray:
    """Change signs of columns (n, k) so that their third moments Σ_i w_i φ(i)³ are positive."""
    # The third moment does not depend on the order of the vertices. If a function is odd under a symmetry of
    # the surface, its third moment is 0 up to rounding; the sign of such a function is arbitrary, and no
    # result may depend on it.
    moments = weights.astype(vectors.dtype) @ (vectors * vectors * vectors)  # ** 3 takes ten times as long
    return np.ascontiguousarray(vectors * np.where(moments < 0, -1.0, 1.0).astype(vectors.dtype))


class PlottedBasis(Shown):
    """A basis that draws its spectrum and its vectors."""

    __slots__ = ()

    def plot(self, surface: SurfaceLike = None, **options: Unpack[PlotOptions]) -> Figure:
        """Draw the spectrum, or the first four vectors on their surface, by `visualization.plot_basis`."""
        figure: Figure = visualization().plot_basis(self, surface, **options)
        return figure
