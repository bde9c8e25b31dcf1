"""Resolutions of a body: the user's, one on which maps are polished, and one that is matched."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch.resolution import Decimated, Prolongation, decimations
from isomatch.settings import Config
from isomatch.shapes.body import Body
from isomatch.surfaces import Mesh, Surface
from isomatch.values.arrays import IntArray


@dataclass(frozen=True, eq=False)
class Level:
    """A body at one resolution.

    Parameters
    ----------
    surface : Mesh, PointCloud or Graph
        Centred, of unit area.
    scale : float
        What a length of 1 is worth in the units of the shape.
    body_vertex : (n,) array of int
        Vertex of this level for each vertex of the shape; −1 for those left out.
    user_vertex : (n_level,) array of int
        Vertex of the shape for each vertex of this level; the nearest one, if the level is coarser.
    detail : Detail, optional
        The body in full, if this level is coarser.
    refining : Prolongation, optional
        From the level before, which is finer or the body in full, to this one.
    """

    surface: Surface
    scale: float
    body_vertex: IntArray
    user_vertex: IntArray
    detail: Detail | None = None
    refining: Prolongation | None = None


@dataclass(frozen=True, eq=False)
class Detail:
    """A body in full, beside a coarser level of it.

    Parameters
    ----------
    transfer : Prolongation
        Between the body in full and the coarser one.
    body_vertex : (n,) array of int
        Vertex of the body in full for each vertex of the shape; −1 for those left out.
    user_vertex : (n_body,) array of int
        Vertex of the shape for each vertex of the body in full.
    """

    transfer: Prolongation
    body_vertex: IntArray
    user_vertex: IntArray


def identity_transfer(mesh: Mesh) -> Prolongation:
    """Carry points from a mesh to itself."""
    everything = np.arange(mesh.n_vertices)
    return Prolongation(mesh, Decimated(mesh, everything, len(everything)))


def full_level(found: Body) -> Level:
    """Take the body as it is."""
    return Level(found.surface, found.scale, found.body_vertex, found.user_vertex)


def levels_of(found: Body, config: Config) -> list[Level]:
    """Make the levels of a body: one on which maps are polished, if there is one, then the one that is matched."""
    full, settings = full_level(found), config.levels
    matched, polished = settings.matched, settings.polished
    if config.resolution == "fast":
        matched, polished = settings.fast_matched, settings.fast_polished
    body, n = found.surface, found.surface.n_vertices
    if config.resolution == "full" or not isinstance(body, Mesh) or n <= settings.spared * matched:
        return [full]
    if n <= settings.spared * polished:
        return [full, *coarse_levels(found, body, [matched])]
    return coarse_levels(found, body, [polished, matched])


def coarse_levels(found: Body, body: Mesh, sizes: list[int]) -> list[Level]:
    """Coarser levels of a mesh, of about so many vertices each, finer first; each is made from the body in full."""
    levels: list[Level] = []
    finer: Prolongation | None = None
    for coarse in decimations(body, sizes):
        transfer = Prolongation(body, coarse)
        refining = transfer
        if finer:
            owner = transfer.coarse.owner[finer.nearest_members]
            refining = Prolongation(finer.coarse.mesh, replace(transfer.coarse, owner=owner))
        levels.append(_level(found, transfer, refining))
        finer = transfer
    return levels


def _level(found: Body, transfer: Prolongation, refining: Prolongation) -> Level:
    coarse, owner = transfer.coarse.mesh, transfer.coarse.owner
    unit = float(np.sqrt(coarse.area))
    middle = np.average(coarse.vertices, axis=0, weights=coarse.vertex_areas)
    return Level(
        coarse.moved((coarse.vertices - middle) / unit),
        found.scale * unit,
        np.append(owner, -1)[found.body_vertex],
        found.user_vertex[transfer.nearest_members],
        Detail(transfer, found.body_vertex, found.user_vertex),
        refining,
    )
