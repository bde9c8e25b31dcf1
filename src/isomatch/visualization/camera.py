"""The camera: a three-quarter view of a standing shape, and the same view of the shape that it is matched with."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import SettingError
from isomatch.correspondence import Correspondence, nearest_rotation
from isomatch.geodesics import ordinary_unit
from isomatch.surfaces import Mesh

# Where the viewer is, in degrees: how far around the shape from its broad side, and how far above the horizon; the
# first view is of a shape that stands, the second of a sheet; chosen.
STANDING_VIEW, SHEET_VIEW = (32.0, 14.0), (0.0, 0.0)
# A shape is a sheet if the standard deviation of its surface along its thinnest principal axis, over the one along its
# middle axis, is below this; chosen.
SHEET_RATIO = 0.1
# A shape, such as a person, stands along the y or z axis if it would not fall and its extent along this axis, over its
# extent along the other of the two, exceeds this; chosen.
UPRIGHT_RATIO = 1.6
# The shape stands on the vertices whose height above its lowest vertex, over the height of the shape, is below this. It
# stands on the floor if its lowest vertex is nearer to height 0 than this share of the height of the shape; chosen.
GROUND_SHARE = 0.06
# Share of the shape's height: a shape falls if its centroid, seen from above, is farther than this outside the convex
# hull of the vertices on which it stands; chosen.
MAX_OVERHANG = 0.02
# Radians: a source that the map turns by less than the first angle is drawn unturned, as its pose might explain the
# turn; a rotation that differs from a quarter turn by less than the second angle is replaced by that turn; chosen.
MAX_KEPT_TURN, MAX_SNAP_ANGLE = np.radians(65.0), np.radians(35.0)


def camera_of(mesh: Mesh, up_axis: int | None = None, view: tuple[float, float] | None = None) -> FloatArray:
    """Choose a view of a mesh.

    Parameters
    ----------
    mesh : Mesh
        A sheet, whose broad side is its face, or a shape whose y or z axis points up, as in nearly all files.
    up_axis : {1, 2}, optional
        The axis that points up; by default it is guessed from how the shape stands.
    view : (float, float), optional
        Where the viewer is, in degrees: how far around the shape from its broad side, and how far above the horizon. By
        default (32, 14), and (0, 0) for a sheet; (212, 14) is from behind, (90, 0) from the end, (0, 90) from above.

    Returns
    -------
    (3, 3) array
        Rows: right, up, towards the viewer; orthonormal and right-handed.

    Raises
    ------
    SettingError
        If the view is not two finite numbers.
    """
    if view is not None and not (len(view) == 2 and np.isfinite(view).all()):
        raise SettingError(f"view = {view!r} is not two angles in degrees, such as (32, 14)")
    areas = mesh.vertex_areas
    moments, axes = principal_axes(mesh.vertices, areas)
    is_sheet = moments[0] < SHEET_RATIO**2 * moments[1]
    if is_sheet:
        narrow, broad = axes[:, 0], axes[:, 2]
        up = np.cross(narrow, broad)
    else:
        up = np.eye(3)[_up_axis(mesh) if up_axis is None else up_axis]
        _, level_axes = principal_axes(mesh.vertices - np.outer(mesh.vertices @ up, up), areas)
        front = np.array([0.3, -1.0, 0.0]) if up[2] else np.array([0.3, 0.0, 1.0])
        narrow = level_axes[:, 1]  # column 0 is the up axis, along which the points have no extent here
        narrow = narrow * (1.0 if narrow @ front >= 0 else -1.0)
        broad = np.cross(up, narrow)
    azimuth, elevation = np.radians(view or (SHEET_VIEW if is_sheet else STANDING_VIEW))
    level_view = np.cos(azimuth) * narrow + np.sin(azimuth) * broad
    towards = np.cos(elevation) * level_view + np.sin(elevation) * up
    right = np.cross(up, level_view)
    return np.array([right, np.cross(towards, right), towards])


def principal_axes(points: FloatArray, areas: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the second moments, smallest first, and their directions as columns."""
    centred = points - np.average(points, axis=0, weights=areas)
    moments, axes = np.linalg.eigh((centred * areas[:, None]).T @ centred)
    return moments, axes


def _up_axis(mesh: Mesh) -> int:
    """Guess the up axis, 1 or 2."""
    # If only one axis has the shape's lowest vertex near 0, this axis is up; if not, an axis along which the shape is
    # long and on which it can stand (a wolf is long, but would fall on its nose); or else the more stable axis.
    used = mesh.vertices[mesh.vertex_areas > 0]
    extent = np.ptp(used, axis=0)
    on_the_floor = [axis for axis in (1, 2) if abs(used[:, axis].min()) < GROUND_SHARE * extent[axis]]
    if len(on_the_floor) == 1:
        return on_the_floor[0]
    stability = {axis: _stability(mesh, axis) for axis in (1, 2)}
    for axis, depth in ((1, 2), (2, 1)):
        if extent[axis] > UPRIGHT_RATIO * extent[depth] and stability[axis] > -MAX_OVERHANG:
            return axis
    return 1 if stability[1] > stability[2] else 2


def _stability(mesh: Mesh, axis: int) -> float:
    """Distance of the centroid, seen from above, to the border of the shape's support, over the height; < 0 outside."""
    height = mesh.vertices[:, axis]
    used = mesh.vertex_areas > 0
    low, tall = height[used].min(), max(float(np.ptp(height[used])), 1e-300)  # never 0, to divide by it
    ground = np.delete(mesh.vertices, axis, axis=1)
    centroid = np.average(ground, axis=0, weights=mesh.vertex_areas)
    try:
        support_edges = ConvexHull(ground[used & (height < low + GROUND_SHARE * tall)]).equations
    except (QhullError, ValueError):
        return -np.inf
    return float(-(support_edges[:, :2] @ centroid + support_edges[:, 2]).max() / tall)


def of_ordinary_size(mesh: Mesh) -> Mesh:
    """Scale a mesh with areas beyond the range of floats; pictures do not depend on the scale."""
    unit = ordinary_unit(mesh)
    return mesh if unit == 1.0 else mesh.moved(mesh.vertices / unit)


def used_vertices(mesh: Mesh) -> IntArray:
    """Return the vertices that faces use, in order."""
    return np.flatnonzero(np.bincount(mesh.sound_faces.ravel(), minlength=mesh.n_vertices))


def seen_from(camera: FloatArray, mesh: Mesh, positions: FloatArray | None = None) -> FloatArray:
    """Transform vertices or positions to (right, up, towards the viewer): unit area, middle 0."""
    points = mesh.vertices @ camera.T / np.sqrt(mesh.area)
    drawn = points[used_vertices(mesh)]
    points = points if positions is None else positions @ camera.T / np.sqrt(mesh.area)
    return np.asarray(points - (drawn.min(axis=0) + drawn.max(axis=0)) / 2)


def turn_to_target(
    source: Mesh, target: Mesh, correspondence: Correspondence, *, upright: bool = True
) -> FloatArray:
    """Find the rotation (3, 3) that brings the vertices of the source closest to their images, by least squares.

    If quarter turns about the axes are near that rotation, they replace it, so that a standing
    shape stays upright. Use ``upright=False`` for scans without a common up axis.
    """
    matched = correspondence.matched
    weights = source.vertex_areas[matched]
    if not weights.any():
        return np.eye(3)
    at_source, at_target = source.vertices[matched], target.vertices[correspondence.vertices[matched]]
    at_source = at_source - np.average(at_source, axis=0, weights=weights)
    at_target = at_target - np.average(at_target, axis=0, weights=weights)
    best = nearest_rotation(at_target.T @ (at_source * weights[:, None]))
    if not upright:
        return best
    # cosine of the angle from each turn to `best`
    cosines = ((_QUARTER_TURNS * best).sum(axis=(1, 2)) - 1) / 2
    # The identity (the only rotation with trace 3) wins up to the larger angle `MAX_KEPT_TURN`.
    is_identity = _QUARTER_TURNS.trace(axis1=1, axis2=2) == 3
    cosines[is_identity] += np.cos(MAX_SNAP_ANGLE) - np.cos(MAX_KEPT_TURN)
    nearest = int(cosines.argmax())
    return _QUARTER_TURNS[nearest] if cosines[nearest] > np.cos(MAX_SNAP_ANGLE) else best


# the 24 rotations that turn a cube onto itself: quarter turns about the axes and what they compose, (24, 3, 3)
_QUARTER_TURNS = np.rint(Rotation.create_group("O").as_matrix()) + 0.0
