"""Landmarks and curves of one shape, carried to the other by the map between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import LandmarkError
from isomatch.correspondence import UNMATCHED, Correspondence
from isomatch.decimation import PlacedMesh, VertexGroups, normalised
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.io import Asset, SurfaceLike, surface_from
from isomatch.landmarks import Curve, Landmarks, draw_curve, equally_spaced, with_frame
from isomatch.matching import MatchResult
from isomatch.surfaces import Mesh, PointCloud, PrecisePoints, nearest_on_surface
from isomatch.transfer.bridge import Bridge
from isomatch.transfer.choices import Side

# points of the target farther than this from all images, in √area of the target, have no preimage; chosen
MAX_PREIMAGE_DISTANCE = 0.05


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

    A landmark is moved to the nearest point of its surface, and from there to the same point between
    the images of the corners of its triangle. A curve is first drawn on its surface in steps of half an
    edge, and all its points are carried.

    Parameters
    ----------
    given : MatchResult or Correspondence
        Map source → target. A result also gives the expected error of each point.
    source, target : Asset, or what `surface_from` takes
        The surfaces of the map.
    landmarks : Landmarks
        Landmarks of the source, or of the target if ``to="source"``. They are brought into the space
        that its file says.
    to : {"target", "source"}
        Where they go: by the map, or by its inverse.
    curve_points : int, optional
        Number of points on each curve; by default as many as it was drawn with.
    expected_error : (n_source,) array of float, optional
        Expected error at each vertex of the source, in √area of the target; by default the result's.

    Returns
    -------
    Landmarks
        Precise points, inside triangles if there are any, in the space of the surface that receives, in
        the order and with the names given; nan where the map has no image. Points of curves are equally
        spaced along the carried curve, and have no place if a part of it has no image.

    Raises
    ------
    MapError, LandmarkError
        If it is a map of other surfaces, a surface has no positions, or a curve cannot be drawn.

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
    (source, source_frame), (target, target_frame) = with_frame(source), with_frame(target)
    landmark_map = _LandmarkMap.of(given, (source, target), expected_error, to)
    frames = (source_frame, target_frame) if to == "target" else (target_frame, source_frame)
    giver_axes, receiver_axes = (frame.axes if frame else None for frame in frames)
    landmarks = landmarks.in_axes(giver_axes).with_separate_curves()
    axes = receiver_axes or landmarks.axes or giver_axes
    placed, unit = landmarks.placed, landmarks.unit
    all_images = np.full((len(landmarks), 4), np.nan)
    all_images[placed] = landmark_map.carried(landmarks.positions[placed])
    images_of_curve: dict[Curve, FloatArray] = {}
    for curve in landmarks.curves:
        points = landmarks.positions[list(curve.rows)]
        images_of_curve[curve] = landmark_map.carried_curve(points, curve, curve_points or len(curve.rows))
    if curve_points is None:
        for curve, values in images_of_curve.items():
            all_images[list(curve.rows)] = values
        return Landmarks(
            all_images[:, :3], landmarks.names, landmarks.curves, all_images[:, 3], axes=axes, unit=unit
        )
    names, images, curves = list[str](), list[FloatArray](), list[Curve]()
    for row, (name, row_curve) in enumerate(zip(landmarks.names, landmarks.curve_of)):
        if row_curve is None:
            names.append(name)
            images.append(all_images[row])
        elif row == row_curve.rows[0]:
            rows = range(len(names), len(names) + curve_points)
            curves.append(Curve(row_curve.name, tuple(rows), row_curve.closed))
            names += [f"{row_curve.name}-{i + 1}" for i in range(curve_points)]
            images += list(images_of_curve[row_curve])
    values = np.array(images).reshape(-1, 4)
    return Landmarks(values[:, :3], names, curves, values[:, 3], axes=axes, unit=unit)


@dataclass(frozen=True, eq=False)
class _LandmarkMap:
    """A map between welded surfaces, its expected errors, and where landmarks go."""

    map: Correspondence
    source: Mesh | PointCloud
    target: Mesh | PointCloud
    errors: FloatArray  # expected errors at the vertices of the source, in √area of the target
    to: Side

    @classmethod
    def of(
        cls, given: Correspondence, ends: tuple[SurfaceLike, SurfaceLike], errors: FloatArray | None, to: Side
    ) -> _LandmarkMap:
        errors = np.full(given.shape[0], np.nan) if errors is None else errors
        first, second = map(_surface, ends)
        if isinstance(first, Asset) and isinstance(second, Asset):
            images = Bridge.between(given, first, second, to_source=True).map
            if len(errors) == len(first.points):
                errors = errors[first.point_of_vertex]
            return cls(images, first.mesh, second.mesh, errors, to)
        source, target = (end.mesh if isinstance(end, Asset) else end for end in (first, second))
        given.check_fits(source, target)
        return cls(given, source, target, errors, to)

    @property
    def ends(self) -> tuple[Mesh | PointCloud, Mesh | PointCloud]:
        """The surface that has the landmarks, and the one that receives them."""
        return (self.source, self.target) if self.to == "target" else (self.target, self.source)

    def carried(self, positions: FloatArray) -> FloatArray:
        """Map positions (m, 3) to images and expected errors (m, 4); nan without image."""
        start, end = self.ends
        points = nearest_on_surface(start, positions)
        on_start = Correspondence.of_points(points, start.n_vertices)
        if not isinstance(self.source, Mesh) or not isinstance(self.target, Mesh):
            directed_map = self.map if self.to == "target" else self.map.reversed(self.source, self.target)
            images = on_start.then(directed_map)
        elif self.to == "target":
            images = on_start.then(self.map, self.source, self.target)
        else:
            images = _find_preimages(self.map, points, self.source, self.target)
        errors = (on_start if self.to == "target" else images).pull_back(self.errors)
        return np.column_stack([images.pull_back(end.vertices), errors * np.sqrt(end.area)])

    def carried_curve(self, points: FloatArray, curve: Curve, n: int) -> FloatArray:
        """Map n equally spaced points of a curve (n, 4); all nan if a part has no image."""
        (start, end), nowhere = self.ends, np.full((n, 4), np.nan)
        if np.isnan(points).any():
            return nowhere
        images = self.carried(draw_curve(start, points, curve.closed, curve.name or "curve"))
        if np.isnan(images[:, :3]).any():
            return nowhere
        piece, share = equally_spaced(images[:, :3], n, curve.closed)
        between: FloatArray = images[piece] + share[:, None] * (images[piece + 1] - images[piece])
        between[:, :3] = nearest_on_surface(end, between[:, :3]).interpolated(end.vertices)
        return between


def _find_preimages(
    images: Correspondence, points: PrecisePoints, source: Mesh, target: Mesh
) -> Correspondence:
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
    positions_of_images = np.full((len(image), 3), np.nan)
    positions_of_images[images.matched] = images.pull_back(positions)[images.matched]
    wanted = points.interpolated(positions)[rows]
    placed = PlacedMesh(source, positions_of_images, VertexGroups.of(image, target.n_vertices))
    preimages = placed.inverse(wanted, starts[rows])
    distances = size * np.linalg.norm(preimages.interpolated(positions_of_images) - wanted, axis=1)
    reached = distances <= MAX_PREIMAGE_DISTANCE * np.sqrt(target.area)
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
