"""First maps from the pose: to nearest points in space, as the shapes lie or after a rigid motion."""

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
    # of the bodies, which are centred and of unit area, and of the shapes as they are
    source, target = pair.source, pair.target
    here, there = pair.source_vertices, pair.target_vertices
    bodies = _places(source.body)[here], _places(target.body)[there]
    shapes = (
        _places(source.surface)[source.user_vertex[here]],
        _places(target.surface)[target.user_vertex[there]],
    )
    rows = (np.asarray(cKDTree(onto).query(points)[1], dtype=np.int64) for points, onto in (bodies, shapes))
    return list(map(SearchRows, rows))


def starts_from_poses(pair: Problem) -> list[Int[BodyVertices, "m_s 2"]]:
    """First maps to the nearest points of meshes that are alike in space, however they lie."""
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
    """Target vertex nearest in space to each of some source vertices, the shapes as they are."""
    here, there = (_places(shape.surface)[shape.user_vertex] for shape in (source, target))
    return BodyVertices(np.asarray(cKDTree(there).query(here[source_vertex])[1], dtype=np.int64))


def _places(surface: Surface) -> Float[FloatArray, "n 3"]:
    """Positions of the vertices."""
    if isinstance(surface, Graph):
        raise SettingError("start = 'pose', but a graph has no positions in space; leave it at 'auto'")
    return surface.vertices
