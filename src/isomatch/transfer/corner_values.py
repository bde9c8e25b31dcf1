"""Values that differ at the corners of one point are carried within the pieces between the seams."""

from __future__ import annotations

import numpy as np

from isomatch.assets import Asset, Attribute
from isomatch.resolution import PlacedMesh, VertexGroups, normalised
from isomatch.surfaces import Mesh, first_equal
from isomatch.transfer.bridge import Bridge, columns, rows_of_corners
from isomatch.values.arrays import FloatArray, IntArray

ACROSS = (
    1e-6  # times the extent of the surface: farther from its image, a corner was kept on its side of a seam
)


def is_seamless(asset: Asset, attribute: Attribute) -> bool:
    """Whether all corners at one vertex of the mesh have the same values."""
    first = _first_corners(asset, attribute)
    return len(np.unique(first)) == len(np.unique(asset.vertex_of_corner))


def interpolated_at_corners(bridge: Bridge, attribute: Attribute) -> tuple[FloatArray, int]:
    """Interpolate at the corners of the receiver, and count its polygons that lie across a seam.

    The giver's mesh is cut along its seams. The search for the images of a polygon's corners starts at the place of the
    polygon's middle and walks to neighbours that are nearer. If a corner lies beyond a seam, it ends at the cut.

    Returns
    -------
    values : (c, d) array
        nan at corners without an image.
    n_across : int
        Polygons of which a corner lies beyond a seam.
    """
    giver, receiver = bridge.giver, bridge.receiver
    first = _first_corners(giver, attribute)
    corner_of_piece, piece = np.unique(first, return_inverse=True)
    positions = normalised(giver.mesh.vertices)[0]
    cut = Mesh(positions[giver.vertex_of_corner[corner_of_piece]], piece[giver.polygons.corner_of_triangle])
    polygon = receiver.polygons.of_corner
    start = bridge.at_polygons.triangle[polygon]
    images = bridge.map.pull_back(positions)[receiver.vertex_of_corner]
    held = np.flatnonzero((start >= 0) & bridge.map.matched[receiver.vertex_of_corner])
    walk = PlacedMesh(cut, cut.vertices, VertexGroups.of(np.arange(cut.n_vertices), cut.n_vertices))
    places = walk.inverse(images[held], cut.faces[start[held]])
    off = np.linalg.norm(places.interpolated(cut.vertices) - images[held], axis=1)
    of_corner = columns(attribute)[rows_of_corners(giver, attribute)]
    values = np.full((len(polygon), of_corner.shape[1]), np.nan)
    values[held] = places.interpolated(of_corner[corner_of_piece])
    return values, len(np.unique(polygon[held[off > ACROSS]]))


def _first_corners(asset: Asset, attribute: Attribute) -> IntArray:
    """(c,) the first corner at the same vertex with the same values."""
    values = columns(attribute)[rows_of_corners(asset, attribute)]
    none = np.finfo(np.float64).max  # nan is equal to no other
    return first_equal(np.column_stack([asset.vertex_of_corner, np.where(np.isnan(values), none, values)]))
