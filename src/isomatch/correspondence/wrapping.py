"""The target's surface in the source's topology: the source's faces between images, with inverted faces mended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from isomatch.assets import SurfaceLike, mesh_from
from isomatch.correspondence.correspondence import Correspondence
from isomatch.correspondence.rotation import nearest_rotation
from isomatch.correspondence.untangling import Untangling
from isomatch.correspondence.welding import welded_map
from isomatch.errors import MapError
from isomatch.surfaces import Mesh, PrecisePoints, first_equal
from isomatch.values.arrays import BoolArray, FloatArray, IntArray

N_GUIDES = 30  # vertices with an image, with which a component without any moves


@dataclass(frozen=True, eq=False)
class Wrapped:
    """What `wrap` returns.

    Parameters
    ----------
    mesh : Mesh
        The faces of the source between points of the target.
    inverted_before, inverted : int
        Faces whose normal was against that of the target, and that remain so after mending.
    extended : int
        Vertices without an image, placed by those around them.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> wrapped = wrap(Correspondence([0, 1, 2, -1], n_target=4), square, square)
    >>> wrapped.extended, wrapped.inverted, wrapped.mesh
    (1, 0, Mesh(4 vertices, 2 faces))
    """

    mesh: Mesh
    inverted_before: int
    inverted: int
    extended: int


def wrap(correspondence: Correspondence, source: SurfaceLike, target: SurfaceLike) -> Wrapped:
    """Draw the target's surface with the vertices and faces of the source.

    Vertices are at their precise images. Around faces that are turned over or without area, images move on the target's
    surface until none is left, or no move helps. Vertices without an image do not lie on the target: they continue the
    surface around them harmonically, and a component without any image moves rigidly with the nearest that have one.

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
        If the map is one of other surfaces, or has no image.

    Notes
    -----
    The mending minimises distortion of the faces around, for which inversion is a large but finite cost that grows from
    round to round: V. Garanzha et al., *Foldover-free Maps in 50 Lines of Code*, SIGGRAPH 2021, here in the tangent
    planes of the target. Each round is linear in the faces that take part. Where the target is folded as sharply as its
    own triangles, a few may remain.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> wrap(Correspondence([1, 2, 3, 0], n_target=4), square, square).mesh.vertices[0].tolist()
    [1.0, 0.0, 0.0]
    """
    source, target = mesh_from(source), mesh_from(target)
    correspondence.check_fits(source, target)
    if not correspondence.matched.any():
        raise MapError(
            f"{correspondence!r} gives no vertex an image, so there is nothing to wrap; match again"
        )
    (whole, vertex), (onto, onto_vertex) = _welded(source), _welded(target)
    welded = welded_map(correspondence, vertex, onto_vertex)
    matched = welded.matched
    faces = whole.faces[matched[whole.faces].all(axis=1)]
    images = PrecisePoints(np.maximum(welded.faces, 0), np.array(welded.barycentric))
    before = after = 0
    if len(faces) and onto.n_faces:
        mending = Untangling(faces, whole, onto, images)
        before, after = mending.run()
    positions = images.interpolated(onto.vertices)
    if not matched.all() and matched.any():
        positions = _extended(whole, positions, matched)
    return Wrapped(source.moved(positions[vertex]), before, after, int((~matched[vertex]).sum()))


def _welded(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """Close seams: join boundary vertices at the same position; also the vertex of each. Collapsed faces are left out."""
    first, rim = np.arange(mesh.n_vertices), np.unique(mesh.boundary_edges)
    first[rim] = rim[first_equal(mesh.vertices[rim])]
    kept, vertex = np.unique(first, return_inverse=True)
    faces = vertex[mesh.sound_faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh(mesh.vertices[kept], faces[whole]), vertex


def _extended(mesh: Mesh, positions: FloatArray, known: BoolArray) -> FloatArray:
    """Place the other vertices: harmonic where linked to known ones, else rigid with the nearest known ones."""
    placed = positions.copy()
    linked = np.isin(mesh.components, mesh.components[known])
    ends = mesh.edges
    weight = 1 / np.maximum(mesh.edge_lengths, 1e-12 * mesh.edge_lengths.max(initial=0.0))
    both = np.tile(weight, 2), (ends.T.ravel(), ends[:, ::-1].T.ravel())
    links = csr_array(both, shape=(mesh.n_vertices,) * 2)
    laplacian = (diags_array(links.sum(axis=1)) - links).tocsr()
    unknown = np.flatnonzero(~known & linked)
    if len(unknown):
        side = -(laplacian[unknown][:, known] @ positions[known])
        placed[unknown] = spsolve(laplacian[unknown][:, unknown].tocsc(), side).reshape(-1, 3)
    rows = np.flatnonzero(~linked)
    _, component, sizes = np.unique(mesh.components[rows], return_inverse=True, return_counts=True)
    centres = _sums(mesh.vertices[rows], component, len(sizes)) / sizes[:, None]
    guides = np.flatnonzero(known)
    nearest = cKDTree(mesh.vertices[guides]).query(centres, range(1, min(N_GUIDES, len(guides)) + 1))[1]
    here, there = (x[guides[nearest]] for x in (mesh.vertices, positions))  # (components, guides, 3)
    middles = here.mean(axis=1), there.mean(axis=1)
    here, there = here - middles[0][:, None], there - middles[1][:, None]
    rotations = nearest_rotation(here.transpose(0, 2, 1) @ there)
    turned = (mesh.vertices[rows] - middles[0][component])[:, None] @ rotations[component]
    placed[rows] = turned[:, 0] + middles[1][component]
    return placed


def _sums(values: FloatArray, group: IntArray, n_groups: int) -> FloatArray:
    """Sum values (m, q) within groups: (n_groups, q)."""
    return np.stack([np.bincount(group, column, n_groups) for column in values.T], axis=1)
