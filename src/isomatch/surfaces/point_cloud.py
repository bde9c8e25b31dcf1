"""The point cloud: points that sample a surface, each joined to its nearest neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import robust_laplacian
import scipy
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import MeshError, SettingError, some
from isomatch.surfaces._coincident import first_equal
from isomatch.surfaces._edges import label_components, lengths
from isomatch.surfaces._shared import Plotted, hash_of

MIN_POINTS = 4  # least number of points, as fewer have no local triangulation
# largest number of points at one place: finding their neighbours takes 0.1 s, and 45 s among 60 000 points
MAX_COINCIDENT_POINTS = 1000


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud(Plotted):
    """An immutable set of points that sample a surface; distances are measured along edges to nearest neighbours.

    Parameters
    ----------
    vertices : (n, 3) array_like of float
        Positions, in the user's units, of at least 4 points. Stored as read-only float64.
    n_neighbours : int
        Each point is joined to this many of its nearest neighbours, or to all others if there are fewer.

    Notes
    -----
    Paths along edges zigzag, so distances are too long, on a random sample of a sphere by 5 to 8 % on average with 8
    neighbours, 3 % with 12, 1.2 % with 20, 0.6 % with 30 and 0.2 % with 50, however dense it is. But with many
    neighbours, edges cut through the inside of a curved surface, which shortens distances (by 0.3 % for 50 neighbours
    among 1 000 points of a sphere), and may join parts that are close in space but far apart on the surface: choose
    fewer neighbours for thin or nearly touching parts. O(n log n) time, proportional to the number of neighbours.

    Examples
    --------
    >>> points = np.random.default_rng(0).normal(size=(500, 3))
    >>> sphere = PointCloud(points / np.linalg.norm(points, axis=1, keepdims=True))
    >>> sphere
    PointCloud(500 points, 30 neighbours)
    >>> bool(abs(sphere.area / (4 * np.pi) - 1) < 0.05)
    True
    """

    vertices: FloatArray
    n_neighbours: int

    def __init__(self, vertices: ArrayLike, n_neighbours: int = 30) -> None:
        points = numbers_of(vertices, "points", MeshError)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < MIN_POINTS:
            raise MeshError(
                f"points have shape {points.shape}, expected (n, 3) with n at least {MIN_POINTS}: "
                "one row x, y, z per point"
            )
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(bad):
            raise MeshError(f"points {some(bad)} have coordinates that are not finite; remove them")
        if n_neighbours < 1:
            raise SettingError(f"n_neighbours = {n_neighbours} is not a positive number of neighbours")
        points.flags.writeable = False
        object.__setattr__(self, "vertices", points)
        object.__setattr__(self, "n_neighbours", int(n_neighbours))

    def __repr__(self) -> str:
        return f"PointCloud({self.n_vertices} points, {self.n_neighbours} neighbours)"

    @property
    def n_vertices(self) -> int:
        """Number of points."""
        return len(self.vertices)

    @cached_property
    def edges(self) -> IntArray:
        """(e, 2) pairs of points, one a nearest neighbour of the other, in lexicographic order."""
        n, k = self.n_vertices, self._n_joined
        self._require_places()
        nearest = scipy.spatial.cKDTree(self._scaled).query(self._scaled, k + 1)[1]
        itself = nearest == np.arange(n)[:, None]
        itself[~itself.any(axis=1), k] = True  # more than k points coincide, and hide the point itself
        others = nearest[~itself].reshape(n, k)
        ends = np.stack([np.repeat(np.arange(n), k), others.ravel()])
        keys = np.unique(ends.min(axis=0) * n + ends.max(axis=0))
        return np.column_stack([keys // n, keys % n])

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """(e,) length of each edge, in the units of the points."""
        return lengths(self.vertices, self.edges)

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """(n,) positive area of each point: a third of the area of its triangles in the tangent plane.

        By the tufted Laplacian of Sharp & Crane 2020. `MeshError` where points lie on a line, or many at one place.
        """
        self._require_places()
        try:
            mass = robust_laplacian.point_cloud_laplacian(self._scaled, n_neighbors=self._n_joined)[1]
        except RuntimeError:
            raise MeshError(
                "the points cannot be triangulated locally, so they have no areas: they lie on a line or at few "
                "places, or have too few neighbours; remove coincident points, or raise n_neighbours"
            ) from None
        with np.errstate(over="ignore"):  # an area beyond the largest float becomes infinite
            areas = mass.diagonal() * np.square(self._unit)
        bad = np.flatnonzero(~(areas > 0))
        if len(bad):
            raise MeshError(f"points {some(bad)} have no area; remove coincident and isolated points")
        return np.asarray(areas)

    @cached_property
    def area(self) -> float:
        """Total area, in squared units of the points."""
        return float(self.vertex_areas.sum())

    @cached_property
    def content_hash(self) -> str:
        """Hash of the points in their order, 32 hexadecimal digits."""
        return hash_of(self, self.vertices)

    @cached_property
    def components(self) -> IntArray:
        """(n,) label of the connected component of each point."""
        return label_components(self.n_vertices, tuple(self.edges.T))[1]

    def _require_places(self) -> None:
        """Raise `MeshError` if too many points coincide: finding their neighbours takes quadratic time."""
        most = int(np.bincount(first_equal(self.vertices)).max())
        if most > MAX_COINCIDENT_POINTS:
            raise MeshError(
                f"{most} points lie at one place, and have no neighbours but each other; remove all but one"
            )

    @property
    def _n_joined(self) -> int:
        return min(self.n_neighbours, self.n_vertices - 1)

    @property
    def _unit(self) -> float:
        return float(np.abs(self.vertices).max()) or 1.0

    @property
    def _scaled(self) -> FloatArray:
        return self.vertices / self._unit
