"""Double walls: how much of a surface has another sheet close behind it, which faces away."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray
from isomatch._core.errors import SettingError
from isomatch.surfaces import Mesh

WALL = 0.05  # √area: by normals in this unit, nearest points tell sheets apart; docs/lab/design_notes.md
N_PROBED = 1000  # vertices, evenly over the area: the share is then known to 1.5 %
MOST_COMPARED = 50_000  # vertices that may be the other sheet, 0.004 √area apart
DEPTHS = (0.15, 0.3, 0.5, 0.75, 1.0)  # of the wall, at which the other sheet is sought
OPPOSITE = -0.7  # cosine of the normals of two sheets, at most
STEEP = 2.0  # depth of the other sheet over its distance along the surface, at least


def double_walled_share(surface: Mesh, wall: float = WALL, turned: BoolArray | None = None) -> float:
    """Measure the share of the area with another sheet close behind that faces away: of skulls, shells and plates.

    The surface has sound faces, wound consistently, but for those that are turned (n,); the wall is the thickness up to
    which sheets count, in √area. The nearest vertex to a place behind each of 1000 is sought at five depths: O(n) time,
    0.3 s for 90 000 vertices.
    """
    if not 0 <= wall < np.inf:
        raise SettingError(f"wall = {wall!r} is not a thickness; give 0 or more, in √area")
    # in six dimensions, positions and normals times the wall, the vertex nearest to a place behind a vertex, with the
    # opposite normal
    area = surface.area
    if not 0 < area < np.inf:
        return 0.0
    if turned is not None and turned.any():
        surface = Mesh(surface.vertices, np.where(turned[:, None], surface.faces[:, ::-1], surface.faces))
    points, normals = surface.vertices / np.sqrt(area), surface.vertex_normals
    until = np.cumsum(surface.vertex_areas)
    probed = np.unique(np.searchsorted(until, (np.arange(N_PROBED) + 0.5) / N_PROBED * until[-1]))
    used = np.flatnonzero(surface.vertex_areas > 0)
    used = used[:: -(-len(used) // MOST_COMPARED)]
    tree = cKDTree(np.column_stack([points[used], wall * normals[used]]))
    here, away = points[probed], normals[probed]
    is_wall = np.zeros(len(probed), dtype=bool)
    for depth in DEPTHS:
        place = np.column_stack([here - depth * wall * away, -wall * away])
        other = used[tree.query(place)[1]]
        offset = points[other] - here
        behind = -(offset * away).sum(axis=1)
        along = np.linalg.norm(offset + behind[:, None] * away, axis=1)
        opposite = (normals[other] * away).sum(axis=1) < OPPOSITE
        is_wall |= opposite & (behind > 0) & (behind <= wall) & (behind >= STEEP * along)
    return float(is_wall.mean())
