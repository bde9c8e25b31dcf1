"""The ball signature: the shape of the surface in space around each point, at several radii."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.compiled import compiled
from isomatch._core.errors import DescriptorError
from isomatch.geodesics import (
    Balls,
    distance_along_edges_to_nearest,
    distance_engine,
    geodesic_balls,
    points_of,
)
from isomatch.repair import without_seams
from isomatch.surfaces import Graph, Mesh, PointCloud

# Default radii of the balls in √area, for a person from the wrist to the knee; larger balls reach the other
# limb where limbs touch: see decisions.md, ball signature.
RADII = (0.04, 0.06, 0.09)
# Weights of a ball's offset and three extents, greatest first, when two balls are compared. The greatest
# extent tells little: see decisions.md, ball signature.
WEIGHTS = (1.0, 0.0, 0.5, 1.0)
# least radius of compared balls, in mean edge lengths; chosen: with 5000 vertices, radius 0.04 has 2.5
MIN_RADIUS_EDGES = 2.0
# largest length by which a compared ball crosses a boundary, in the unit of the radii; chosen
MAX_OVERHANG = 0.02
MIN_DEVIATION = 0.03  # standard deviations that divide differences are raised to this; less is noise; chosen
# distance from a vertex, in mean spacings of samples, up to which samples give it values; chosen
MAX_SAMPLE_SPACINGS = 1.5
# half widths of cells are raised to this, in the unit of the radii, as areas might be 0; chosen
MIN_HALF_CELL = 1e-9
MAX_DIFFERENCE = 2.0  # larger differences of two values are lowered to this, in standard deviations; chosen


@dataclass(frozen=True, eq=False)
class BallSignature:
    """Moments of the geodesic balls around n points of a surface, at r radii; lengths in the given ``unit``.

    ``values`` holds for each ball the offset of its centroid from its centre along the normal,
    positive in hollows, and its three extents, the greatest first: square roots of the eigenvalues
    of its covariance. They are divided by the radius.
    """

    radii: FloatArray  # radii of the balls, increasing, (r,)
    values: FloatArray  # offset and three extents of each ball, (n, r, 4)
    to_boundary: FloatArray  # distance (n,) to the boundary; inf if there is none
    finest: float = 0.0  # least radius of balls with enough vertices to describe the surface

    @cached_property
    def known(self) -> BoolArray:
        """(n, r) whether values count: the boundary is far enough, and the triangulation fine enough."""
        return np.asarray(
            (self.radii <= self.to_boundary[:, None] + MAX_OVERHANG) & (self.radii >= self.finest)
        )

    def at(self, vertices: IntArray) -> BallSignature:
        """Restrict to some points (m,)."""
        return replace(self, values=self.values[vertices], to_boundary=self.to_boundary[vertices])

    def scaled(self, factor: float, radii: ArrayLike) -> BallSignature:
        """Give the signature of the surface enlarged by a factor, interpolated at other radii (q,)."""
        radii = np.asarray(radii, dtype=np.float64)
        place = np.interp(np.log(radii / factor), np.log(self.radii), np.arange(len(self.radii)))
        below = np.minimum(place.astype(np.int64), len(self.radii) - 2)
        part = (place - below)[:, None]
        values = (1 - part) * self.values[:, below] + part * self.values[:, below + 1]
        return BallSignature(radii, values, factor * self.to_boundary, factor * self.finest)

    def descriptor_distance(self, other: BallSignature, deviation: FloatArray | None = None) -> FloatArray:
        """Compare with the signature of n other points: the mean difference (n,) of the values known of both.

        It is in standard deviations, each counted up to 2; nan if no value is known of both.
        Offsets count most, then the least extent: how the surface bulges, and how thick it is.
        ``deviation`` (r, 4) is the unit of the differences, by default `deviation_of` both
        signatures.

        Raises
        ------
        DescriptorError
            If the signatures have other radii or another number of points.
        """
        if self.values.shape != other.values.shape or not np.allclose(self.radii, other.radii):
            raise DescriptorError(
                f"signatures of {len(self.values)} and of {len(other.values)} points of radii {self.radii.tolist()} and "
                f"{other.radii.tolist()} cannot be compared; take as many points and the same radii"
            )
        unit = deviation_of(self, other) if deviation is None else deviation
        difference = np.minimum(np.abs(self.values - other.values) / unit, MAX_DIFFERENCE)
        difference = difference @ WEIGHTS / np.sum(WEIGHTS)
        known = self.known & other.known
        n_known = known.sum(axis=1)
        total = np.where(known, difference, 0.0).sum(axis=1)
        return np.asarray(np.divide(total, n_known, out=np.full(len(total), np.nan), where=n_known > 0))


def deviation_of(*signatures: BallSignature) -> FloatArray:
    """Measure the standard deviations (r, 4) of the known values of some surfaces together; at least 0.03."""
    deviations = np.full(signatures[0].values.shape[1:], MIN_DEVIATION)
    for j in range(len(deviations)):
        values = np.concatenate([signature.values[signature.known[:, j], j] for signature in signatures])
        if len(values):
            deviations[j] = np.maximum(values.std(axis=0), MIN_DEVIATION)
    return deviations


def ball_signature(
    surface: Mesh | PointCloud,
    radii: ArrayLike = RADII,
    *,
    unit: float | None = None,
    samples: ArrayLike | None = None,
    normals: ArrayLike | None = None,
    weld: bool = True,
) -> BallSignature:
    """Compute the ball signature of every vertex of a surface.

    It depends on the pose where a joint bends a ball. It tells inside from outside, thick from
    thin, a knee from the hollow behind it, and a boundary changes it only where it cuts a ball.
    Mirror images have the same values.

    Parameters
    ----------
    surface : Mesh or PointCloud
        A surface of n vertices.
    radii : (r,) array_like of float
        Increasing, in units of ``unit``. The smallest should span several edges.
    unit : float, optional
        The length that is 1; by default √area. For a part, give √area of the whole.
    samples : (m,) array_like of int, optional
        Vertices whose balls are computed; the other vertices get means of near samples. By default
        all.
    normals : (n, 3) array_like, optional
        Unit normals; a cloud needs them.
    weld : bool
        Whether vertices of a mesh at exactly the same position are one point of the surface.

    Raises
    ------
    DescriptorError
        If the surface is a graph, which has no normals, or a cloud without normals; if radii are
        not positive and increasing; or if there is no sample.
    MeshError
        If a sample is no vertex.

    Notes
    -----
    Moments of balls are integral invariants; Pottmann et al., *Integral invariants for robust
    geometry processing*, CAGD 2009, take balls in space. O(m b log b) time for balls of b vertices.

    Examples
    --------
    In the plane the centroid is the centre, and the extents of a disk are ½, ½ and 0:

    >>> from isomatch import Mesh
    >>> from isomatch.descriptors import ball_signature
    >>> x, y = (side.ravel() for side in np.meshgrid(np.arange(41.0), np.arange(41.0)))
    >>> corner = (np.arange(40) + 41 * np.arange(40)[:, None]).ravel()[:, None]
    >>> plane = Mesh(np.stack([x, y, 0 * x], 1), np.concatenate([corner + [0, 1, 42], corner + [0, 42, 41]]))
    >>> signature = ball_signature(plane, [0.2], samples=[20 * 41 + 20])
    >>> signature.values[20 * 41 + 20].round(2) + 0.0
    array([[0. , 0.5, 0.5, 0. ]])
    """
    if isinstance(surface, Graph):
        raise DescriptorError(
            "a graph has no normals, so that it has no ball signature; give a mesh or a cloud"
        )
    n = surface.n_vertices
    centres = np.arange(n) if samples is None else points_of(samples, n).corners[:, 0]
    welded, seams = without_seams(surface, weld)
    if seams:
        samples = None if samples is None else seams.new_index[centres]
        normals = None if normals is None else _normals(surface, normals)[seams.vertex_index]
        signature = ball_signature(welded, radii, unit=unit, samples=samples, normals=normals, weld=False)
        return signature.at(seams.new_index)
    reach = np.asarray(radii, dtype=np.float64)
    if reach.ndim != 1 or not len(reach) or reach[0] <= 0 or (np.diff(reach) <= 0).any():
        raise DescriptorError(f"radii = {radii!r}; expected positive numbers that increase")
    length = np.sqrt(surface.area) if unit is None else unit
    centres, areas = np.unique(centres), np.asarray(surface.vertex_areas)
    if not len(centres):
        raise DescriptorError("samples is empty; give at least one vertex, or None for all")
    half_cells = np.maximum(np.sqrt(areas / np.pi), MIN_HALF_CELL * length)  # an area might be 0
    farthest = length * reach[-1] + float(half_cells.max())
    balls = geodesic_balls(distance_engine(surface, weld=False), centres, farthest)
    shape = len(centres), len(reach)
    offsets, covariances = np.zeros(shape), np.zeros((*shape, 3, 3))
    cells = surface.vertices, _normals(surface, normals), half_cells
    _moments(*cells, centres, *balls, length * reach, offsets, covariances)
    extents = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances)[..., ::-1], 0.0))
    values = np.concatenate([offsets[..., None], extents], axis=-1)
    if len(centres) < n:
        values = _spread(surface, centres, balls, values)
    finest = MIN_RADIUS_EDGES * float(surface.edge_lengths.mean()) if isinstance(surface, Mesh) else 0.0
    return BallSignature(reach, values, _to_boundary(surface) / length, finest / length)


def _normals(surface: Mesh | PointCloud, normals: ArrayLike | None) -> FloatArray:
    """Check the unit normals (n, 3) of the user, or compute the normals of a mesh."""
    if normals is None:
        if isinstance(surface, Mesh):
            return surface.vertex_normals
        raise DescriptorError("a cloud of points needs normals for its ball signature; give normals = (n, 3)")
    normals = np.asarray(normals, dtype=np.float64)
    if normals.shape != surface.vertices.shape:
        raise DescriptorError(f"normals have shape {normals.shape}, expected {surface.vertices.shape}")
    return normals


def _to_boundary(surface: Mesh | PointCloud) -> FloatArray:
    """(n,) distance of each vertex to the boundary; inf if there is none."""
    if isinstance(surface, PointCloud) or not len(surface.boundary_edges):
        return np.full(surface.n_vertices, np.inf)
    return distance_along_edges_to_nearest(surface, np.unique(surface.boundary_edges))[0]


def _spread(surface: Mesh | PointCloud, centres: IntArray, balls: Balls, values: FloatArray) -> FloatArray:
    """Give every vertex the mean values (m, r, 4) of near centres, or the values of the nearest centre."""
    n, flat = surface.n_vertices, values.reshape(len(centres), -1)
    reach = MAX_SAMPLE_SPACINGS * np.sqrt(surface.area / len(centres))
    weights = np.maximum(1 - balls.distances / reach, 0.0) ** 2
    rows = np.repeat(np.arange(len(centres)), np.diff(balls.start))
    sums = scipy.sparse.csr_array((weights, (balls.points, rows)), shape=(n, len(centres)))
    total = sums.sum(axis=1)
    spread = (sums @ flat) / np.where(total > 0, total, 1.0)[:, None]
    alone = np.flatnonzero(total <= 0)
    if len(alone):
        _, nearest = distance_along_edges_to_nearest(surface, centres)
        spread[alone] = flat[np.searchsorted(centres, nearest[alone])]
    return np.asarray(spread.reshape(n, *values.shape[1:]))


@compiled()
def _moments(
    points: FloatArray,
    normals: FloatArray,
    half_cells: FloatArray,
    centres: IntArray,
    start: IntArray,
    inside: IntArray,
    distances: FloatArray,
    radii: FloatArray,
    offsets: FloatArray,
    covariances: FloatArray,
) -> None:
    """Fill in the offsets (m, r) of centroids along the normal, and covariances (m, r, 3, 3), in radii."""
    # A vertex stands for a disk of radius ``half_cells``; a ball contains the share of the disk within its
    # radius, so that the moments change continuously with the radius. The height of a smooth surface with
    # principal curvatures κ₁ and κ₂ and mean curvature H above the tangent plane is −½ (κ₁ x² + κ₂ y²), whose
    # mean over a disk of radius r is −¼ r² · ½ (κ₁ + κ₂) = −H r² / 4: the offset is −H r / 4 to leading
    # order. ∫ x² over the unit disk is ¼ of its area: two extents of a flat ball are ½.
    for i in range(len(centres)):
        centre = centres[i]
        for j in range(len(radii)):
            r = radii[j]
            total = mx = my = mz = mxx = mxy = mxz = myy = myz = mzz = 0.0
            for e in range(start[i], start[i + 1]):
                v = inside[e]
                share = 0.5 + 0.5 * (r - distances[e]) / half_cells[v]
                if share <= 0.0:
                    continue
                share = min(share, 1.0)
                w = half_cells[v] ** 2 * share
                # the middle of this share is nearer to the centre than the vertex is, by half the width that
                # is missing
                factor = (1.0 - (1.0 - share) * half_cells[v] / max(distances[e], half_cells[v])) / r
                x = factor * (points[v, 0] - points[centre, 0])
                y = factor * (points[v, 1] - points[centre, 1])
                z = factor * (points[v, 2] - points[centre, 2])
                total += w
                mx, my, mz = mx + w * x, my + w * y, mz + w * z
                mxx, mxy, mxz = mxx + w * (x * x), mxy + w * (x * y), mxz + w * (x * z)
                myy, myz, mzz = myy + w * (y * y), myz + w * (y * z), mzz + w * (z * z)
            x, y, z = mx / total, my / total, mz / total
            offsets[i, j] = x * normals[centre, 0] + y * normals[centre, 1] + z * normals[centre, 2]
            c = covariances[i, j]
            c[0, 0], c[1, 1], c[2, 2] = mxx / total - x * x, myy / total - y * y, mzz / total - z * z
            c[0, 1] = c[1, 0] = mxy / total - x * y
            c[0, 2] = c[2, 0] = mxz / total - x * z
            c[1, 2] = c[2, 1] = myz / total - y * z
