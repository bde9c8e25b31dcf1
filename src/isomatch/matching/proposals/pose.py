"""First maps to nearest points in space, in the given pose or after a rigid motion."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import BodyVertices, Float, FloatArray, Int, SearchRows
from isomatch._core.errors import SettingError
from isomatch._core.threads import parallel_map
from isomatch.correspondence import poses_between, with_normals
from isomatch.matching.problem import Problem, search_pairs
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Graph, Surface


def starts_from_pose(pair: Problem) -> list[Int[SearchRows, "m_s"]]:
    """First maps to the nearest point in space; `SettingError` if a shape is a graph."""
    sides = (pair.source, pair.source_vertices), (pair.target, pair.target_vertices)
    # bodies are centred and of unit area; the user's surfaces are not
    bodies = [_positions(shape.body)[vertices] for shape, vertices in sides]
    surfaces = [_positions(shape.surface)[shape.user_vertex[vertices]] for shape, vertices in sides]
    return [
        SearchRows(np.asarray(cKDTree(onto).query(points)[1], dtype=np.int64))
        for points, onto in (bodies, surfaces)
    ]


def starts_from_poses(pair: Problem) -> list[Int[BodyVertices, "m_s 2"]]:
    """First maps to the nearest points after a rigid motion, if meshes are then close in space."""
    limit, orientation = pair.config.search.near_rigid, pair.config.orientation
    if not (limit and pair.oriented):
        return []
    sides = {"preserve": (False,), "reverse": (True,), "any": (False, True)}[orientation]
    source = with_normals(pair.source.mesh_body)[pair.source_vertices]
    target = with_normals(pair.target.mesh_body)[pair.target_vertices]
    several = parallel_map(lambda mirrored: poses_between(source, target, mirrored), sides)
    return [
        search_pairs(pair, SearchRows(x.nearest)) for poses in several for x in poses if x.distance <= limit
    ]


def nearest_in_pose(
    source: PreparedShape, target: PreparedShape, source_vertex: Int[BodyVertices, "q"]
) -> Int[BodyVertices, "q"]:
    """Target vertex nearest in space to each of some source vertices, without moving the shapes."""
    points, onto = (_positions(shape.surface)[shape.user_vertex] for shape in (source, target))
    return BodyVertices(np.asarray(cKDTree(onto).query(points[source_vertex])[1], dtype=np.int64))


def _positions(surface: Surface) -> Float[FloatArray, "n 3"]:
    """Positions of the vertices."""
    if isinstance(surface, Graph):
        raise SettingError("start = 'pose', but a graph has no positions in space; leave it at 'auto'")
    return surface.vertices
