"""Find the faces inside chambers, which are closed or have only small openings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.errors import SettingError
from isomatch._core.memory import require_memory
from isomatch.repair.check import OPENING_DIAMETER
from isomatch.repair.self_contacts import face_normals
from isomatch.surfaces import Mesh, label_components, meetings

T = TypeVar("T", FloatArray, IntArray, BoolArray)
CELLS_PER_RADIUS = 4.0  # number of cells per radius of the ball; chosen: a cell is 1/8 of the opening wide
MARGIN_CELLS = 1.5  # cells; the ball touches a surface if the gap between them is at most this; chosen
# cells by which the least distance from the surface falls in each step of `_flood`; chosen
NARROWING_CELLS = 0.25
SPACING_CELLS = 0.5  # cells; largest distance between the points that represent a face; chosen


def inner_faces(mesh: Mesh, opening: float = OPENING_DIAMETER) -> BoolArray:
    """Find the faces (m,) in chambers of a mesh of sound faces, wound outward, with an opening in √area.

    A chamber is a space that the surface faces and that holds a ball with the diameter of the opening,
    which cannot be rolled in from outside. Spaces too narrow for the ball, such as between legs or in
    an armpit, belong to what is next to them along the surface. A closed component around a chamber
    may be wound either way. 1.5 s for 90 000 vertices.
    """
    if not 0 < opening < np.inf:
        raise SettingError(f"opening = {opening!r} is no size; give more than 0, in √area")
    area = mesh.area
    if not 0 < area < np.inf:
        return np.zeros(mesh.n_faces, dtype=bool)
    surface = mesh.moved(mesh.vertices / np.sqrt(area))
    space = _Space.around(surface, opening)
    seen = space.label_of_faces(surface)
    links, distances = _face_neighbours(surface)
    roots = np.flatnonzero(seen)
    if not (seen == _INNER).any() and len(np.unique(surface.components[surface.faces[:, 0]])) == 1:
        return np.zeros(mesh.n_faces, dtype=bool)
    graph = coo_array((distances, tuple(links.T)), shape=(mesh.n_faces,) * 2).tocsr()
    if len(roots):
        asked = {"indices": roots, "min_only": True, "return_predecessors": True}
        _, _, nearest = dijkstra(graph, directed=False, **asked)
        seen = np.where(nearest >= 0, seen[np.maximum(nearest, 0)], seen)
    lost = seen == 0
    if lost.any():  # no ball fits in front of any face of these components
        count, of_face = label_components(mesh.n_faces, tuple(links.T))
        reached = np.bincount(of_face, space.is_beside_outside(surface), count) > 0
        seen[lost] = np.where(reached[of_face[lost]], _OUTER, _INNER)
    return _drop_specks(surface, links, seen == _INNER, opening**2)


_SOLID, _INNER, _OUTER = 1, 2, 3  # labels of cells; where several could spread to a cell, the largest does


@dataclass(frozen=True, eq=False)
class _Space:
    """Cells around a surface of unit area."""

    lowest: FloatArray  # position of the corner of the grid with the lowest coordinates
    step: float  # width of a cell
    distance: FloatArray  # the distance of each cell (x, y, z) from the surface, in cells
    kind: IntArray  # for each cell: _OUTER, _INNER, or _SOLID behind the surface; 0 where no ball fits

    @classmethod
    def around(cls, surface: Mesh, opening: float) -> _Space:
        """Measure the distance of each cell from the surface, and label the spaces."""
        step = opening / 2 / CELLS_PER_RADIUS
        used = surface.vertices[np.unique(surface.faces)]
        border = int(2 * CELLS_PER_RADIUS + 3)
        lowest = used.min(axis=0) - border * step
        shape = tuple(np.ceil((used.max(axis=0) - lowest) / step).astype(int) + border)
        n_bytes = 64.0 * np.prod(shape, dtype=float)
        require_memory(n_bytes, "the grid around a mesh", "ask for a larger opening")
        points, normals = _sample_faces(surface, SPACING_CELLS * step)
        free = np.ones(shape, dtype=bool)
        free[tuple(np.floor((points - lowest) / step).astype(int).T)] = False
        distance = distance_transform_edt(free).astype(np.float32)
        # The ball can roll through connected cells in which its centre fits. These cells are a chamber if most
        # of the surface that the ball touches faces them; otherwise they lie in a solid.
        pieces, count = label(distance > CELLS_PER_RADIUS)
        outside = int(pieces[0, 0, 0])
        kinds = np.zeros(count + 1, dtype=np.int8)
        rim = np.argwhere((pieces > 0) & (pieces != outside) & (distance < CELLS_PER_RADIUS + MARGIN_CELLS))
        if len(rim):
            places = lowest + step * (rim + 0.5)
            nearest = cKDTree(points).query(places)[1]
            towards = ((places - points[nearest]) * normals[nearest]).sum(axis=1)
            of_rim = pieces[tuple(rim.T)]
            balance = np.bincount(of_rim, np.sign(towards), count + 1)
            kinds = np.where(balance > 0, _INNER, _SOLID).astype(np.int8)
            kinds[0] = 0
        kinds[outside] = _OUTER
        kind = kinds[pieces]
        return cls(lowest, step, distance, _flood(kind, distance) if (kinds == _INNER).any() else kind)

    def at(self, grid: T, places: FloatArray) -> T:
        """Look up the cells (m,) at places (m, 3); beyond the grid, those at its border."""
        cell = np.floor((places - self.lowest) / self.step).astype(int)
        cells: T = grid[tuple(np.clip(cell, 0, np.array(grid.shape) - 1).T)]
        return cells

    def label_of_faces(self, surface: Mesh) -> IntArray:
        """Label the space in front of each face (m,), 0 if it is unknown."""
        middles = surface.vertices[surface.faces].mean(axis=1)
        kind = self.at(self.kind, middles + MARGIN_CELLS * self.step * face_normals(surface)).astype(np.int64)
        return np.where(kind == _SOLID, 0, kind)

    def is_beside_outside(self, surface: Mesh) -> BoolArray:
        """Find the faces (m,) with a cell on either side that is connected with the outside."""
        pieces, _ = label(self.distance > 0)
        is_outside = pieces == pieces[0, 0, 0]
        middles = surface.vertices[surface.faces].mean(axis=1)
        offsets = MARGIN_CELLS * self.step * face_normals(surface)
        beside: BoolArray = self.at(is_outside, middles + offsets) | self.at(is_outside, middles - offsets)
        return beside


def _flood(kind: IntArray, distance: FloatArray) -> IntArray:
    """Spread labels to narrower places, the wider ones first, so that they meet at the narrowest."""
    kind = kind.copy()
    for least in np.arange(CELLS_PER_RADIUS - NARROWING_CELLS, -NARROWING_CELLS, -NARROWING_CELLS):
        free = distance > least
        while True:
            open_ = free & (kind == 0)
            around = np.zeros_like(kind)
            for axis in range(3):
                into, from_kind = np.moveaxis(around, axis, 0), np.moveaxis(kind, axis, 0)
                np.maximum(into[1:], from_kind[:-1], out=into[1:])
                np.maximum(into[:-1], from_kind[1:], out=into[:-1])
            reached = open_ & (around > 0)
            if not reached.any():
                break
            kind[reached] = around[reached]
    return kind


def _sample_faces(surface: Mesh, step: float) -> tuple[FloatArray, FloatArray]:
    """Sample points (q, 3) on the faces, at most a step apart, and their normals."""
    corners = surface.vertices[surface.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.ceil(longest / step).astype(int).clip(1)
    n_bytes = 80.0 * (0.5 * (parts + 2.0) ** 2).sum()
    require_memory(n_bytes, "points on long faces", "ask for a larger opening")
    points, of_face = [], []
    for n in np.unique(parts):
        rows = np.flatnonzero(parts == n)
        a, b = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T / n
        weights = np.column_stack([a, b, 1 - a - b])
        points.append(np.einsum("wc,fcd->fwd", weights, corners[rows]).reshape(-1, 3))
        of_face.append(np.repeat(rows, len(weights)))
    return np.concatenate(points), face_normals(surface)[np.concatenate(of_face)]


def _face_neighbours(surface: Mesh) -> tuple[IntArray, FloatArray]:
    """List pairs (p, 2) of faces with a common edge, and the distances of their centres."""
    met = meetings(surface.edge_table, surface.faces)
    pairs = met.sides // 3
    middles = surface.vertices[surface.faces].mean(axis=1)
    distances = np.linalg.norm(middles[pairs[:, 0]] - middles[pairs[:, 1]], axis=1)
    return pairs, np.maximum(distances, 1e-12)


def _drop_specks(surface: Mesh, links: IntArray, inner: BoolArray, least: float) -> BoolArray:
    """Leave out connected pieces with less area than ``least``."""
    _, piece = label_components(surface.n_faces, tuple(links[inner[links].all(axis=1)].T))
    area = np.bincount(piece, surface.face_areas * inner)
    return np.asarray(inner & (area[piece] >= least))
