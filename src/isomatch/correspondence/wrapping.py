"""The target's surface in the source's topology: the source bent onto the target, starting from a map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.errors import MapError
from isomatch.correspondence.correspondence import Correspondence
from isomatch.correspondence.map_arrays import UNMATCHED
from isomatch.correspondence.nearest import nearest_points
from isomatch.correspondence.poses import nearest_rotation
from isomatch.correspondence.template_bending import Boundary, bend_template
from isomatch.decimation import normalised
from isomatch.io import SurfaceLike, mesh_from
from isomatch.surfaces import Mesh, PrecisePoints, first_equal

# A component without images moves along with this number of vertices, those with a place nearest to it; chosen.
N_GUIDES = 30
# quantile over the edges of their growth or shrinking, reported as ``stretch``; chosen
STRETCH_QUANTILE = 0.99


@dataclass(frozen=True)
class WrapQuality:
    """Quality of a surface in the topology of another one, apart from the error of the map.

    Parameters
    ----------
    turned : float
        Share of the faces that are inverted relative to the rotation of the surface around them.
    stretch : float
        99th percentile of the factor by which edges grow or shrink, relative to the median.
    distance : float
        Mean distance of the vertices from the target, over √area of the target; extended vertices
        do not count.
    extended : int
        Number of vertices without a counterpart on the target.

    Examples
    --------
    >>> WrapQuality(turned=0.0, stretch=1.3, distance=0.004, extended=0).stretch
    1.3
    """

    turned: float
    stretch: float
    distance: float
    extended: int


@dataclass(frozen=True, eq=False)
class Wrapped:
    """The result of `wrap`.

    Parameters
    ----------
    mesh : Mesh
        The source, bent onto the target.
    extended : (n,) array of bool
        Vertices without a counterpart on the target, because they have no image or lie over an
        opening; the vertices around them place them.
    quality : WrapQuality
        Measures of the surface.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> wrapped = wrap(Correspondence([0, 1, 2, -1], n_target=4), square, square)
    >>> wrapped.extended, wrapped.quality.turned, wrapped.mesh
    (array([False, False, False,  True]), 0.0, Mesh(4 vertices, 2 faces))
    """

    mesh: Mesh
    extended: BoolArray
    quality: WrapQuality


def wrap(correspondence: Correspondence, source: SurfaceLike, target: SurfaceLike) -> Wrapped:
    """Draw the target's surface with the vertices and faces of the source.

    The source is bent onto the target, so that its triangles keep their shape: first to the images
    of the map, then to the nearest points of the target. So it lies on the target or very near it,
    folds of the map are smoothed out, and the two sides of a thin wall stay apart. Parts that the
    target lacks are completed as rigidly as possible; a component without any image follows the
    nearest vertices with one, by a similarity. A map that reverses the orientation gives a mirror
    image. Time and memory are linear, 60 µs a vertex.

    Parameters
    ----------
    correspondence : Correspondence
        Source → target.
    source, target : Mesh, or what `mesh_from` takes
        The surfaces of the map. Vertices at the same position, as at seams, stay together.

    Returns
    -------
    Wrapped

    Raises
    ------
    MapError
        If the map is a map of other surfaces, or has no image.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> wrap(Correspondence([1, 2, 3, 0], n_target=4), square, square).mesh.vertices[0].round(6).tolist()
    [1.0, 0.0, 0.0]
    """
    source, target = mesh_from(source), mesh_from(target)
    correspondence.check_fits(source, target)
    if not correspondence.matched.any():
        raise MapError(
            f"{correspondence!r} gives no vertex an image, so there is nothing to wrap; match again"
        )
    (whole, vertex), (onto, onto_vertex) = _weld(source), _weld(target)
    welded = welded_map(correspondence, vertex, onto_vertex)
    places, centre, size = normalised(onto.vertices)
    whole, onto = whole.moved(normalised(whole.vertices)[0]), onto.moved(places)
    images = PrecisePoints(np.maximum(welded.faces, 0), np.array(welded.barycentric))
    matched = welded.matched
    # An inner vertex whose image is on the target's boundary belongs to surface that is missing at an
    # opening: its image is only the nearest point of the rim.
    inside = matched & ~(Boundary(onto).holds(images) & ~Boundary.vertices_of(whole))
    trusted = inside if inside.any() else matched
    positions = _extend(whole, images.interpolated(onto.vertices), trusted)
    extended, turned = ~matched, 0
    bendable = np.isin(whole.components, whole.components[matched]) & (whole.vertex_areas > 0)
    part, rows = whole.submesh(bendable)
    if part.area > 0 and onto.area > 0:
        bent = bend_template(part, onto, positions[rows], trusted[rows], matched[rows])
        positions[rows], extended[rows], turned = bent.positions, bent.beyond, int(bent.turned.sum())
        positions = _extend(whole, positions, matched | bendable)
    share, is_extended = turned / max(whole.n_faces, 1), extended[vertex]
    measures = share, _stretch(whole, positions), _distance(positions[~extended], onto)
    quality = WrapQuality(*measures, int(is_extended.sum()))
    return Wrapped(source.moved(positions[vertex] * size + centre), is_extended, quality)


def _stretch(mesh: Mesh, positions: FloatArray) -> float:
    """Factor by which almost all edges grow or shrink at most, relative to the median."""
    before, after = mesh.edge_lengths, mesh.moved(positions).edge_lengths
    is_sound = before > 0
    ratios = np.maximum(after[is_sound], np.finfo(float).tiny) / before[is_sound]
    if not len(ratios):
        return 1.0
    relative = np.abs(np.log(ratios / np.median(ratios)))
    return float(np.exp(np.quantile(relative, STRETCH_QUANTILE)))


def _distance(positions: FloatArray, target: Mesh) -> float:
    """Mean distance from a surface, divided by its √area."""
    if not len(positions) or not target.area > 0:
        return 0.0
    nearest = np.asarray(cKDTree(target.vertices).query(positions)[1], dtype=np.int64)
    points = nearest_points(target.vertices, positions, target.faces, nearest)
    distances = np.linalg.norm(points.interpolated(target.vertices) - positions, axis=1)
    return float(distances.mean() / np.sqrt(target.area))


def _weld(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """Join boundary vertices at one position, drop collapsed faces; also return new vertices (n,)."""
    first, boundary = np.arange(mesh.n_vertices), np.unique(mesh.boundary_edges)
    first[boundary] = boundary[first_equal(mesh.vertices[boundary])]
    kept, vertex = np.unique(first, return_inverse=True)
    faces = vertex[mesh.sound_faces]
    is_whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh(mesh.vertices[kept], faces[is_whole]), vertex


def _extend(mesh: Mesh, positions: FloatArray, placed: BoolArray) -> FloatArray:
    """Place the vertices not placed yet: by similarity and harmonic offsets, or with the nearest ones."""
    # At an opening, positions follow the similarity that fits all placed vertices; it gives the curvature.
    similarity = _fit_similarities(mesh.vertices[placed][None], positions[placed][None])
    similar = similarity(mesh.vertices, np.zeros(len(placed), int))
    # The offsets u of the positions from the similarity are extended harmonically along the surface to the
    # vertices linked to placed ones: L u = 0 there, so that L_uu u_u = −L_uk u_k with the unknown and known
    # vertices u and k, and edges of weight 1 / length.
    positions = positions.copy()
    linked = np.isin(mesh.components, mesh.components[placed])
    ends = mesh.edges
    weight = 1 / np.maximum(mesh.edge_lengths, 1e-12 * mesh.edge_lengths.max(initial=0.0))
    entries = np.tile(weight, 2), (ends.T.ravel(), ends[:, ::-1].T.ravel())
    links = csr_array(entries, shape=(mesh.n_vertices,) * 2)
    laplacian = (diags_array(links.sum(axis=1)) - links).tocsr()
    unknown = np.flatnonzero(~placed & linked)
    if len(unknown):
        side = -(laplacian[unknown][:, placed] @ (positions - similar)[placed])
        offsets = spsolve(laplacian[unknown][:, unknown].tocsc(), side).reshape(-1, 3)
        positions[unknown] = similar[unknown] + offsets
    rows = np.flatnonzero(~linked)
    _, component, counts = np.unique(mesh.components[rows], return_inverse=True, return_counts=True)
    sums = [np.bincount(component, column, len(counts)) for column in mesh.vertices[rows].T]
    centres = np.stack(sums, axis=1) / counts[:, None]
    guides = np.flatnonzero(placed)
    nearest = cKDTree(mesh.vertices[guides]).query(centres, range(1, min(N_GUIDES, len(guides)) + 1))[1]
    guided = (x[guides[nearest]] for x in (mesh.vertices, positions))  # (components, guides, 3)
    positions[rows] = _fit_similarities(*guided)(mesh.vertices[rows], component)
    return positions


def _fit_similarities(x: FloatArray, y: FloatArray) -> Callable[[FloatArray, IntArray], FloatArray]:
    """Fit similarities to groups of points (g, q, 3); they move points (m, 3), each as its group (m,)."""
    # Kabsch's rotation of centred points, and the ratio of their root mean squares as the scale. Unlike the
    # least-squares scale, this one does not shrink the points if they fit badly.
    x_mean, y_mean = x.mean(axis=1), y.mean(axis=1)
    x, y = x - x_mean[:, None], y - y_mean[:, None]
    rotations = nearest_rotation(x.transpose(0, 2, 1) @ y)
    before, after = np.linalg.norm(x, axis=(1, 2)), np.linalg.norm(y, axis=(1, 2))
    scales = np.where((before > 0) & (after > 0), after / np.where(before > 0, before, 1.0), 1.0)

    def move(points: FloatArray, group: IntArray) -> FloatArray:
        offsets = scales[group, None] * (points - x_mean[group])
        return np.asarray((offsets[:, None] @ rotations[group])[:, 0] + y_mean[group])

    return move


def welded_map(given: Correspondence, source_vertex: IntArray, target_vertex: IntArray) -> Correspondence:
    """Return the map of welded vertices, given the welded vertex of each, (n_source,) and (n_target,).

    A welded vertex has the image of the first of its vertices that has one.

    Examples
    --------
    >>> welded_map(Correspondence([-1, 1, 2], n_target=3), np.array([0, 1, 0]), np.array([0, 0, 1])).vertices
    array([1, 0])
    """
    matched_first = np.argsort(~given.matched, kind="stable")
    rows = matched_first[np.unique(source_vertex[matched_first], return_index=True)[1]]
    vertex = np.append(target_vertex, UNMATCHED)
    n_target = int(target_vertex.max(initial=-1)) + 1
    faces, weights = vertex[given.faces[rows]], given.barycentric[rows]
    return Correspondence(vertex[given.vertices[rows]], n_target, faces, weights)
