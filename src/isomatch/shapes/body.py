"""The part of a shape that is matched: its largest component, repaired, of unit area, at some resolutions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch._core.arrays import BoolArray, IntArray
from isomatch._core.errors import MeshError, some
from isomatch.decimation import Prolongation, decimations
from isomatch.geodesics import distance_engine, ordinary_unit
from isomatch.repair import LARGE_MESH, VertexTrace, find_outliers, prepare_for_matching
from isomatch.settings import Config, PreparationSettings
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface

MIN_VERTICES = 50  # vertices of a body, at least; chosen: enough for 8 distance columns and 20 functions
LEFT_UNMATCHED = "are left unmatched"  # occurs in notes on parts of a shape that are not matched
# A graph has no area, so its lengths are divided by a factor for which the mean distance between its vertices
# is this; chosen. For comparison, on a mesh of FAUST of area 1 the mean distance is 0.58.
GRAPH_AVERAGE_DISTANCE = 0.75
MIN_COMPONENT_SHARE = 0.001  # share of the area; smaller components, such as eyes, are not matched; chosen


@dataclass(frozen=True, eq=False)
class Body:
    """The part of a shape that is matched."""

    # The largest connected component, centred, of unit area. A mesh is welded and wound outward, and its
    # glued sheets are separated.
    surface: Surface
    scale: float  # length of a unit of the body in the units of the shape
    body_vertex: IntArray  # (n,) body vertex of each vertex of the shape; −1 if left out
    # (n_body,) vertex of the shape for each body vertex: copies of a vertex at separated sheets have the same
    # one, vertices of caps the nearest one
    user_vertex: IntArray
    left_out: float  # share of the shape that lies in other components, see `body_of`
    notes: tuple[str, ...]  # sentences on what was left out or repaired
    share: float = 1.0  # area of the body over the area of the whole shape
    others: tuple[Body, ...] = ()  # other components of a mesh to match, largest first


def body_of(shape: Surface, settings: PreparationSettings) -> Body:
    """Take the largest component, repaired and scaled to unit area, a graph to a fixed average distance.

    Raises
    ------
    MeshError
        If the shape cannot be used.
    """
    whole, unit, trace, notes = _repair(shape, settings.sheet_distance)
    if not whole.n_vertices:
        raise MeshError("no vertices, so there is nothing to match; give a shape with vertices")
    labels = whole.components
    shares = np.bincount(labels, whole.vertex_areas) / whole.area
    sizes = np.bincount(labels)
    largest = int(shares.argmax())
    others = np.arange(len(shares)) != largest
    if others.any():
        notes += (
            f"{others.sum()} smaller components with {shares[others].sum():.1%} of the area and "
            f"{sizes[others].sum() / len(labels):.1%} of the vertices {LEFT_UNMATCHED}: no path leads to them, so they "
            "have no geodesic distance to the rest",
        )
    if sizes[largest] < MIN_VERTICES:
        raise MeshError(
            f"the largest component has {sizes[largest]} vertices, at least {MIN_VERTICES} are needed; "
            "subdivide the mesh, or weld its triangles if they share no vertices"
        )

    def component(label: int) -> Body:
        members = labels == label
        surface, length = _normalise(whole, members, GRAPH_AVERAGE_DISTANCE)
        component_trace = trace.then(VertexTrace.of_kept(members))
        vertices = component_trace.current, component_trace.given
        return Body(surface, length * unit, *vertices, 0.0, (), float(shares[label]))

    large = others & (sizes >= MIN_VERTICES)
    matchable = np.flatnonzero(large & (shares >= MIN_COMPONENT_SHARE) & isinstance(whole, Mesh))
    largest_first = matchable[np.argsort(-shares[matchable], kind="stable")]
    # The share left out is the larger of two shares: by the area, and by the vertices of large components.
    return replace(
        component(largest),
        left_out=float(max(shares[others].sum(), sizes[large].sum() / len(labels))),
        notes=notes,
        others=tuple(component(label) for label in largest_first[: settings.most_components]),
    )


def _repair(shape: Surface, sheet_distance: float) -> tuple[Surface, float, VertexTrace, tuple[str, ...]]:
    """Repair a mesh, and leave out outliers of points; graphs stay as they are."""
    # Returns the surface in a unit in which no area overflows or vanishes, this unit, the trace of the
    # vertices, and notes.
    if isinstance(shape, Graph):
        return shape, 1.0, VertexTrace.of_all(shape.n_vertices), ()
    if isinstance(shape, PointCloud):
        is_stray, notes = find_outliers(shape.vertices), tuple[str, ...]()
        if is_stray.any():
            examples = some(np.flatnonzero(is_stray))
            notes = (f"left out {is_stray.sum()} points far from all others, such as {examples}",)
            shape = PointCloud(shape.vertices[~is_stray], shape.n_neighbours)
        unit = ordinary_unit(shape)
        scaled = PointCloud(shape.vertices / unit, shape.n_neighbours)
        return scaled, unit, VertexTrace.of_kept(~is_stray), notes
    repaired = prepare_for_matching(shape, sheet_distance)
    unit = float(np.abs(repaired.mesh.vertices).max())
    return repaired.mesh.moved(repaired.mesh.vertices / unit), unit, repaired.trace, repaired.notes


def sound_body(mesh: Mesh) -> Body:
    """Take a connected mesh with all its vertices, without repair."""
    everything = np.arange(mesh.n_vertices)
    surface, length = _normalise(mesh, np.ones(mesh.n_vertices, dtype=bool), 1.0)
    return Body(surface, length, everything, everything, 0.0, ())


def _normalise(whole: Surface, kept: BoolArray, graph_average_distance: float) -> tuple[Surface, float]:
    """Cut out some vertices and scale them to unit area; also return the length of 1 in the given units."""
    if isinstance(whole, Graph):
        number = np.cumsum(kept) - 1
        inside = kept[whole.edges[:, 0]]
        weights = whole.vertex_areas[kept] / whole.vertex_areas[kept].sum()
        edges, lengths = number[whole.edges[inside]], whole.edge_lengths[inside]
        engine = distance_engine(Graph(len(weights), edges, lengths, weights))
        sources = np.linspace(0, len(weights) - 1, 20).astype(np.int64)
        length = float((engine.distances_from(sources) @ weights).mean()) / graph_average_distance
        if not 0 < length < np.inf:
            raise MeshError(
                "the lengths of the edges are all 0, or too large to add, so distances tell no vertices apart; "
                "give lengths of ordinary size"
            )
        return Graph(len(weights), edges, lengths / length, weights), length
    if isinstance(whole, Mesh):
        part: Mesh | PointCloud = whole.submesh(kept)[0]
    else:
        part = PointCloud(whole.vertices[kept], whole.n_neighbours)
    length = float(np.sqrt(part.area))
    points = (part.vertices - np.average(part.vertices, axis=0, weights=part.vertex_areas)) / length
    if isinstance(part, PointCloud):
        return PointCloud(points, part.n_neighbours), length
    # The edges of a large mesh take twice the memory of its faces and are rarely needed again. So they are
    # not kept.
    return Mesh(points, part.faces) if part.n_vertices > LARGE_MESH else part.moved(points), length


@dataclass(frozen=True, eq=False)
class Level:
    """A body at one resolution."""

    surface: Surface  # centred, of unit area
    scale: float  # length of 1 in the units of the shape
    body_vertex: IntArray  # (n,) vertex of this level for each vertex of the shape; −1 if left out
    user_vertex: IntArray  # (n_level,) vertex of the shape, the nearest one, for each vertex of this level
    detail: Detail | None = None  # the body in full, if this level is coarser
    refining: Prolongation | None = None  # between this level and the finer one, or the body in full


@dataclass(frozen=True, eq=False)
class Detail:
    """A body in full, for a coarser level of it."""

    transfer: Prolongation  # between the body in full and the coarser level
    body_vertex: IntArray  # (n,) vertex of the body in full for each vertex of the shape; −1 if left out
    user_vertex: IntArray  # (n_body,) vertex of the shape for each vertex of the body in full


def full_level(body: Body) -> Level:
    """Make a level of all vertices of a body."""
    return Level(body.surface, body.scale, body.body_vertex, body.user_vertex)


def levels_of(body: Body, config: Config) -> list[Level]:
    """Make the levels of a body: one on which maps are polished, if needed, then the one that is matched."""
    full, settings = full_level(body), config.levels
    matched, polished = settings.matched, settings.polished
    if config.resolution == "fast":
        matched, polished = settings.fast_matched, settings.fast_polished
    n = body.surface.n_vertices
    if config.resolution == "full" or not isinstance(body.surface, Mesh) or n <= settings.spared * matched:
        return [full]
    if n <= settings.spared * polished:
        return [full, *_coarse_levels(body, body.surface, [matched])]
    return _coarse_levels(body, body.surface, [polished, matched])


def _coarse_levels(body: Body, mesh: Mesh, sizes: list[int]) -> list[Level]:
    """Make coarser levels of a mesh of about these numbers of vertices, each from the body in full."""
    levels: list[Level] = []
    finer: Prolongation | None = None
    for coarse in decimations(mesh, sizes):
        transfer = refining = Prolongation(mesh, coarse)
        if finer:
            owner = transfer.coarse.owner[finer.nearest_members]
            refining = Prolongation(finer.coarse.mesh, replace(transfer.coarse, owner=owner))
        levels.append(_level(body, transfer, refining))
        finer = transfer
    return levels


def _level(body: Body, transfer: Prolongation, refining: Prolongation) -> Level:
    coarse, owner = transfer.coarse.mesh, transfer.coarse.owner
    unit = float(np.sqrt(coarse.area))
    middle = np.average(coarse.vertices, axis=0, weights=coarse.vertex_areas)
    surface = coarse.moved((coarse.vertices - middle) / unit)
    trace = VertexTrace(body.user_vertex, body.body_vertex).then(VertexTrace(transfer.nearest_members, owner))
    detail = Detail(transfer, body.body_vertex, body.user_vertex)
    return Level(surface, body.scale * unit, trace.current, trace.given, detail, refining)
