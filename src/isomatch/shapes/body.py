"""What is matched of a shape: its largest component, repaired, of unit area, and others like it, at some resolutions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch._core.arrays import BoolArray, IntArray
from isomatch._core.errors import MeshError, some
from isomatch.decimation import Prolongation, decimations
from isomatch.geodesics import distance_engine, ordinary_unit
from isomatch.repair import LARGE_MESH, VertexTrace, outliers, prepare_for_matching
from isomatch.settings import Config, PreparationSettings
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface

FEWEST_VERTICES = 50  # fewer leave no room for 8 columns and 20 functions
LEFT_UNMATCHED = "are left unmatched"

# of two points of a graph of unit size; about that of animals and people of unit area
GRAPH_AVERAGE_DISTANCE = 0.75
# share of the area from which a component is matched by itself; an eye has as much of a body
LEAST_COMPONENT = 0.001


@dataclass(frozen=True, eq=False)
class Body:
    """The part of a shape that is matched."""

    # the largest connected component; a mesh welded, its glued sheets separated, wound outward; centred, of unit area
    surface: Surface
    scale: float  # what a length of 1 is worth in the units of the shape
    body_vertex: IntArray  # (n,) body vertex of each vertex of the shape; −1 for those left out
    # (n_body,) vertex of the shape of each body vertex: the same for copies where sheets were parted, the nearest on caps
    user_vertex: IntArray
    left_out: float  # share in other components, see `body_of`
    notes: tuple[str, ...]  # what was left out or repaired
    share: float = 1.0  # of the area of the shape
    # of a mesh, further components that can be matched by themselves, largest first
    others: tuple[Body, ...] = ()


def body_of(shape: Surface, settings: PreparationSettings) -> Body:
    """Take the largest component, mend it, and give it unit area; or to a graph, which has none, an average distance.

    Raises
    ------
    MeshError
        If the shape cannot be used.
    """
    whole, unit, trace, notes = _repaired(shape, settings.sheet_distance)
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
    if sizes[largest] < FEWEST_VERTICES:
        raise MeshError(
            f"the largest component has {sizes[largest]} vertices, at least {FEWEST_VERTICES} are needed; "
            "subdivide the mesh, or weld its triangles if they share no vertices"
        )

    def component(label: int) -> Body:
        kept = labels == label
        surface, length = _normalised(whole, kept, GRAPH_AVERAGE_DISTANCE)
        own = trace.then(VertexTrace.of_kept(kept))
        return Body(surface, length * unit, own.current, own.given, 0.0, (), float(shares[label]))

    own = others & (sizes >= FEWEST_VERTICES)
    matchable = np.flatnonzero(own & (shares >= LEAST_COMPONENT) & isinstance(whole, Mesh))
    largest_first = matchable[np.argsort(-shares[matchable], kind="stable")]
    # left out is the share of the area, or of the vertices in components of some size, if that is larger: those of debris
    # do not count
    return replace(
        component(largest),
        left_out=float(max(shares[others].sum(), sizes[own].sum() / len(labels))),
        notes=notes,
        others=tuple(component(label) for label in largest_first[: settings.most_components]),
    )


def _repaired(shape: Surface, sheet_distance: float) -> tuple[Surface, float, VertexTrace, tuple[str, ...]]:
    """Mend a shape; of points only outliers are left out, and of graphs nothing."""
    # returned in a unit in which no area overflows or vanishes, with that unit, the trace of its vertices, and notes
    if isinstance(shape, Graph):
        return shape, 1.0, VertexTrace.of_all(shape.n_vertices), ()
    if isinstance(shape, PointCloud):
        stray, notes = outliers(shape.vertices), tuple[str, ...]()
        if stray.any():
            named = some(np.flatnonzero(stray))
            notes = (f"left out {stray.sum()} points far from all others, such as {named}",)
            shape = PointCloud(shape.vertices[~stray], shape.n_neighbours)
        unit = ordinary_unit(shape)
        scaled = PointCloud(shape.vertices / unit, shape.n_neighbours)
        return scaled, unit, VertexTrace.of_kept(~stray), notes
    mended = prepare_for_matching(shape, sheet_distance)
    unit = float(np.abs(mended.mesh.vertices).max())
    return mended.mesh.moved(mended.mesh.vertices / unit), unit, mended.trace, mended.notes


def sound_body(mesh: Mesh) -> Body:
    """Take a connected mesh as it is; nothing is mended, and no vertex left out."""
    everything = np.arange(mesh.n_vertices)
    surface, length = _normalised(mesh, np.ones(mesh.n_vertices, dtype=bool), 1.0)
    return Body(surface, length, everything, everything, 0.0, ())


def _normalised(whole: Surface, kept: BoolArray, graph_average_distance: float) -> tuple[Surface, float]:
    """Cut out some vertices and give them unit area; returns also what a length of 1 is worth."""
    if isinstance(whole, Graph):
        number = np.cumsum(kept) - 1
        inside = kept[whole.edges[:, 0]]
        weights = whole.vertex_areas[kept] / whole.vertex_areas[kept].sum()
        edges, lengths = number[whole.edges[inside]], whole.edge_lengths[inside]
        engine = distance_engine(Graph(len(weights), edges, lengths, weights))
        some = np.linspace(0, len(weights) - 1, 20).astype(np.int64)
        length = float((engine.distances_from(some) @ weights).mean()) / graph_average_distance
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
    # the edges of a large mesh take twice the memory of its faces, and are hardly needed again
    return Mesh(points, part.faces) if part.n_vertices > LARGE_MESH else part.moved(points), length


@dataclass(frozen=True, eq=False)
class Level:
    """A body at one resolution."""

    surface: Surface  # centred, of unit area
    scale: float  # what a length of 1 is worth in the units of the shape
    body_vertex: IntArray  # (n,) vertex of this level for each vertex of the shape; −1 for those left out
    # (n_level,) vertex of the shape for each of this level, the nearest if it is coarser
    user_vertex: IntArray
    detail: Detail | None = None  # the body in full, if this level is coarser
    refining: Prolongation | None = None  # from the level before, finer or the body in full, to this one


@dataclass(frozen=True, eq=False)
class Detail:
    """A body in full, beside a coarser level of it."""

    transfer: Prolongation  # between the body in full and the coarser one
    # (n,) vertex of the body in full for each vertex of the shape; −1 for those left out
    body_vertex: IntArray
    user_vertex: IntArray  # (n_body,) vertex of the shape for each vertex of the body in full


def full_level(body: Body) -> Level:
    """Take the body as it is."""
    return Level(body.surface, body.scale, body.body_vertex, body.user_vertex)


def levels_of(body: Body, config: Config) -> list[Level]:
    """Make the levels of a body: one on which maps are polished, if there is one, then the one that is matched."""
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
    """Coarser levels of a mesh, of about so many vertices each, finer first; each is made from the body in full."""
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
