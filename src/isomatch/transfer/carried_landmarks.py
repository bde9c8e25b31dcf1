"""Landmarks and curves of one shape, carried to the other by the map between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.assets import Asset, SurfaceLike, surface_from
from isomatch.correspondence import UNMATCHED, Correspondence
from isomatch.errors import LandmarkError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.landmarks import Curve, Landmarks, drawn_curve, equally_spaced, nearest_on_surface, with_frame
from isomatch.matching import MatchResult
from isomatch.resolution import PlacedMesh, VertexGroups, normalised
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints
from isomatch.transfer.bridge import Bridge
from isomatch.transfer.choices import Side
from isomatch.values.arrays import FloatArray

WITHIN = 0.05  # √area of the target: its points farther from all images have none


def carry_landmarks(
    given: MatchResult | Correspondence,
    source: SurfaceLike,
    target: SurfaceLike,
    landmarks: Landmarks,
    *,
    to: Side = "target",
    curve_points: int | None = None,
    expected_error: FloatArray | None = None,
) -> Landmarks:
    """Carry landmarks of one shape to the other.

    Parameters
    ----------
    given : MatchResult or Correspondence
        Map source → target. A result also tells the expected error of each point.
    source, target : Asset, or what `surface_from` takes
        Its two ends.
    landmarks : Landmarks
        Of the source; of the target if ``to="source"``. They are brought into the space that its file says.
    to : {"target", "source"}
        Where they go: by the map, or by its inverse.
    curve_points : int, optional
        Number of points on each curve; by default as many as it was drawn with.
    expected_error : (n_source,) array of float, optional
        At each vertex of the source, in √area of the target; by default that of the result, if it is one.

    Returns
    -------
    Landmarks
        Each is a precise point of the surface, inside a triangle if there are any, in the order and with the names given;
        nan where the map has no image; in the space of the surface that receives. Points of curves are equally spaced
        along the carried curve, and have no place if a part of it has no image.

    Raises
    ------
    MapError
        If it is a map of other surfaces.
    LandmarkError
        If a surface has no positions, or a curve cannot be drawn.

    Notes
    -----
    A landmark is moved to the nearest point of its surface, and from there to the same point between the images of the
    corners of its triangle. A curve is first drawn on its surface in steps of half an edge, and all its points are
    carried.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> large = square.moved(2 * square.vertices + [5, 0, 0])
    >>> marks = Landmarks([[0.5, 0.25, 0.0]], ["nose"])
    >>> carry_landmarks(Correspondence(range(4), 4), square, large, marks).positions.tolist()
    [[6.0, 0.5, 0.0]]
    """
    if curve_points is not None and curve_points < 2:
        raise LandmarkError(f"curve_points = {curve_points} make no curve; give 2 or more")
    if isinstance(given, MatchResult):
        expected_error = given.expected_error if expected_error is None else expected_error
        given = given.map
    framed = with_frame(source), with_frame(target)
    way = _Way.of(given, (framed[0][0], framed[1][0]), to, expected_error)
    own, other = (frame.axes if frame else None for _, frame in (framed if to == "target" else framed[::-1]))
    landmarks, axes = landmarks.turned(own), other or landmarks.axes or own
    placed = landmarks.placed
    every = np.full((len(landmarks), 4), np.nan)
    every[placed] = way.carried(landmarks.positions[placed])
    along: dict[Curve, FloatArray] = {}
    for curve in landmarks.curves:
        points = landmarks.positions[list(curve.rows)]
        along[curve] = way.carried_curve(points, curve, curve_points or len(curve.rows))
    if curve_points is None:
        for curve, values in along.items():
            every[list(curve.rows)] = values
        return Landmarks(
            every[:, :3], landmarks.names, landmarks.curves, every[:, 3], axes=axes, unit=landmarks.unit
        )
    names, images, curves = list[str](), list[FloatArray](), list[Curve]()
    for row, (name, on) in enumerate(zip(landmarks.names, landmarks.curve_of)):
        if on is None:
            names.append(name)
            images.append(every[row])
        elif row == on.rows[0]:
            rows = range(len(names), len(names) + curve_points)
            curves.append(Curve(on.name, tuple(rows), on.closed))
            names += [f"{on.name}-{i + 1}" for i in range(curve_points)]
            images += list(along[on])
    values = np.array(images).reshape(-1, 4)
    return Landmarks(values[:, :3], names, curves, values[:, 3], axes=axes, unit=landmarks.unit)


@dataclass(frozen=True, eq=False)
class _Way:
    """A map between welded surfaces, the error to be expected of it, and which way landmarks go."""

    map: Correspondence
    source: Mesh | PointCloud
    target: Mesh | PointCloud
    errors: FloatArray  # at the vertices of the source, in √area
    to: Side

    @classmethod
    def of(
        cls,
        images: Correspondence,
        shapes: tuple[SurfaceLike, SurfaceLike],
        to: Side,
        errors: FloatArray | None,
    ) -> _Way:
        errors = np.full(images.shape[0], np.nan) if errors is None else errors
        first, second = map(_surface, shapes)
        if isinstance(first, Asset) and isinstance(second, Asset):
            bridge = Bridge.between(images, first, second, to_source=True)
            if len(errors) == len(first.points):
                errors = errors[first.point_of_vertex]
            return cls(bridge.map, first.mesh, second.mesh, errors, to)
        ends = [each.mesh if isinstance(each, Asset) else each for each in (first, second)]
        images.check_fits(*ends)
        return cls(images, ends[0], ends[1], errors, to)

    @property
    def start(self) -> Mesh | PointCloud:
        """What has landmarks."""
        return self.source if self.to == "target" else self.target

    @property
    def end(self) -> Mesh | PointCloud:
        """What gets them."""
        return self.target if self.to == "target" else self.source

    def carried(self, positions: FloatArray) -> FloatArray:
        """(m, 4) where positions (m, 3) go, and the error to be expected; nan where they have no image."""
        points = nearest_on_surface(self.start, positions)
        own, images = _as_map(points, self.start.n_vertices), self._images(points)
        errors = (own if self.to == "target" else images).pull_back(self.errors)
        return np.column_stack([images.pull_back(self.end.vertices), errors * np.sqrt(self.end.area)])

    def _images(self, points: PrecisePoints) -> Correspondence:
        own = _as_map(points, self.start.n_vertices)
        if isinstance(self.source, Mesh) and isinstance(self.target, Mesh):
            if self.to == "target":
                return own.then(self.map, self.source, self.target)
            return _preimages(self.map, points, self.source, self.target)
        return own.then(self.map if self.to == "target" else self.map.reversed(self.source, self.target))

    def carried_curve(self, points: FloatArray, curve: Curve, n: int) -> FloatArray:
        """(n, 4) the same for n points at equal distances along a curve through points; all nan if a part is."""
        if np.isnan(points).any():
            return np.full((n, 4), np.nan)
        images = self.carried(drawn_curve(self.start, points, curve.closed, curve.name or "curve"))
        if np.isnan(images[:, :3]).any():
            return np.full((n, 4), np.nan)
        piece, share = equally_spaced(images[:, :3], n, curve.closed)
        between: FloatArray = images[piece] + share[:, None] * (images[piece + 1] - images[piece])
        near = nearest_on_surface(self.end, between[:, :3])
        between[:, :3] = near.interpolated(self.end.vertices)
        return between


def _as_map(points: PrecisePoints, n: int) -> Correspondence:
    """Take points of a surface of n vertices as a map onto it."""
    nearest = points.corners[np.arange(len(points.corners)), points.barycentric.argmax(axis=1)]
    return Correspondence(nearest, n, *points)


def _preimages(images: Correspondence, points: PrecisePoints, source: Mesh, target: Mesh) -> Correspondence:
    """Find the points of the source whose images are nearest to points of the target, on the same sheet."""
    image = images.vertices
    vertices = np.full(len(points.corners), UNMATCHED)
    if not images.matched.any():
        return Correspondence(vertices, source.n_vertices)
    _, near = distance_along_edges_to_nearest(target, np.unique(image[images.matched]))
    starts = near[points.corners]
    starts = np.where(starts < 0, starts.max(axis=1, keepdims=True), starts)
    rows = np.flatnonzero(starts[:, 0] >= 0)
    positions, _, size = normalised(target.vertices)
    places = np.full((len(image), 3), np.nan)
    places[images.matched] = images.pull_back(positions)[images.matched]
    wanted = points.interpolated(positions)[rows]
    placed = PlacedMesh(source, places, VertexGroups.of(image, target.n_vertices))
    preimages = placed.inverse(wanted, starts[rows])
    apart = size * np.linalg.norm(preimages.interpolated(places) - wanted, axis=1)
    reached = apart <= WITHIN * np.sqrt(target.area)
    corners, barycentric = (np.zeros((len(vertices), 3), dtype=part.dtype) for part in preimages)
    corners[rows], barycentric[rows] = preimages
    barycentric[:, 0] += 1 - barycentric.sum(axis=1)
    vertices[rows[reached]] = preimages.corners[reached, 0]
    return Correspondence(vertices, source.n_vertices, corners, barycentric)


def _surface(shape: SurfaceLike) -> Asset | PointCloud:
    surface = surface_from(shape)
    if isinstance(surface, Mesh):
        return Asset.of_mesh(surface)
    if isinstance(surface, PointCloud):
        return surface
    raise LandmarkError("landmarks have positions, and a graph has none; give meshes or points")
