"""Limbs whose vertices were merged by distance: find the sheet of each face, and part the sheets."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.repair._winding import rewind_faces
from isomatch.repair.self_contacts import bends_and_costs, copy_at_fans, face_normals, inner_edges
from isomatch.repair.sheets import SHEET_DISTANCE, Separation, crowded_vertices, far_copies, split_by
from isomatch.surfaces import Mesh, find_root, first_equal, label_components

# A merge leaves a ragged ring: edges of three and four faces, vertices with several fans, small holes where
# triangles of both sheets vanished, and between them edges of two faces that bend sharply. The contact
# consists of all these vertices. Without them, the surface around it falls apart into the sheets, while the
# surface around a fold or a pinch of one sheet stays in one piece. Faces at the contact belong to the sheet
# of their other corners. If the sheets are still joined, the next pass adds flatter edges, and then
# neighbours, to the contact. A pass has the least angle, in degrees, by which concave edges of the contact
# bend, and the number of rings of neighbours that are added; chosen.
PASSES = ((120.0, 0), (90.0, 0), (60.0, 0), (40.0, 0), (60.0, 1))
# √area; largest distance along edges from marked vertices at which sheets are sought; chosen
SEEN_DISTANCE = 0.08
# A piece is a sheet if it reaches at least this share of SEEN_DISTANCE away from marked vertices, otherwise a
# scrap of the contact; chosen.
MIN_SHEET_REACH = 0.8
# Vertices of edges with more than two faces, or with several fans, are marked. Of the vertices of a contact,
# at least the first share is marked, and at least the second share plus half the mean cosine between the
# normals of the copies of a vertex, because merged limbs face each other. In 200 merges of bodies of FAUST,
# TOSCA, SCAPE and MakeHuman, 0.29 to 1 of the vertices of contacts were marked, with mean cosines up to 0.3;
# of folds and holes, up to 0.2 were marked, with mean cosines from 0.
MIN_MARKED_SHARE, MARKED_SHARE_AT_RIGHT_ANGLES = 0.25, 0.2
# Pieces that come off at a contact are bodies, and parted entirely, if each has at least this share of the
# area; otherwise only marked vertices are parted; chosen: a leg has 0.17.
MIN_BODY_SHARE = 0.2
COPY_OFFSET_EDGES = 0.25  # mean edge lengths by which copies move inward, not to be welded again; chosen


def part_merged_limbs(mesh: Mesh, least_distance: float = SHEET_DISTANCE) -> Separation:
    """Part limbs whose vertices were merged by distance, and move them apart; copies come last."""
    # The mesh is sound and wound consistently. A manifold one is returned as it is, without seams.
    # O(n log n) time: 0.1 s for 13 000 vertices with marks.
    marked, label = crowded_vertices(mesh), mesh.components
    faces, points, index, seams = mesh.faces.copy(), mesh.vertices.copy(), np.arange(mesh.n_vertices), []
    for component in np.unique(label[marked]):
        body, rows = mesh.submesh(label == component)
        separated = _part_component(body, least_distance)
        if separated.seams:
            number = np.concatenate([rows, len(points) + np.arange(len(separated.vertex_index) - len(rows))])
            faces[label[mesh.faces[:, 0]] == component] = number[separated.mesh.faces]
            points = np.concatenate([points, separated.mesh.vertices[len(rows) :]])
            points[rows] = separated.mesh.vertices[: len(rows)]
            index = np.concatenate([index, rows[separated.vertex_index[len(rows) :]]])
            seams += [rows[seam] for seam in separated.seams]
    return Separation(Mesh(points, faces) if seams else mesh, index, tuple(seams))


def _part_component(mesh: Mesh, least_distance: float) -> Separation:
    index = np.arange(mesh.n_vertices)
    size = np.abs(mesh.vertices).max() or 1.0  # a unit in which squares do not overflow
    parted = mesh.moved(mesh.vertices / size)
    inward = parted.volume < 0  # if wound inward, turned over: "concave" needs an outward winding
    parted = rewind_faces(parted) if inward else parted
    while True:  # repeated, as limbs that have moved may meet again
        further, origin = _part_once(parted, least_distance)
        if len(origin) == len(index):
            break
        parted, index = further, index[origin]
    if len(index) == mesh.n_vertices:
        return Separation(mesh, index, ())
    several = np.bincount(index, minlength=mesh.n_vertices) > 1
    points = np.where(several[index][:, None], size * parted.vertices, mesh.vertices[index])
    seams = [np.flatnonzero(several)[rows] for rows in split_by(_label_near(mesh, several))]
    return Separation(Mesh(points, (rewind_faces(parted) if inward else parted).faces), index, tuple(seams))


def _part_once(mesh: Mesh, least_distance: float) -> tuple[Mesh, IntArray]:
    """Part limbs and move them apart; return also the old number of each vertex."""
    parted, index = mesh, np.arange(mesh.n_vertices)
    marked, bends = crowded_vertices(mesh), _bends(mesh)
    for concave, rings in PASSES:
        if not marked.any():
            break
        contact = _contact_vertices(parted, marked, bends < -concave, rings)
        fan, vertex = _fans_of_sheets(parted, marked, contact)
        merged = _confirm_contacts(parted, marked, fan, vertex, least_distance)
        if merged.any():
            parted, origin = copy_at_fans(parted, fan, vertex, merged)
            index = index[origin]
            marked, bends = crowded_vertices(parted), _bends(parted)
    moves = (np.bincount(index, minlength=mesh.n_vertices) > 1)[index]
    if not moves.any():
        return mesh, index
    points = parted.vertices.copy()
    points[moves] -= COPY_OFFSET_EDGES * mesh.edge_lengths.mean() * parted.vertex_normals[moves]
    together = np.flatnonzero(moves & (first_equal(points) != np.arange(len(points))))
    if len(together):  # copies coincide again where the normals of crumpled sheets agree
        start, end = np.concatenate([parted.edges, parted.edges[:, ::-1]]).T
        count = np.maximum(np.bincount(start, minlength=len(points)), 1)
        middle = np.column_stack([np.bincount(start, x[end], len(points)) / count for x in parted.vertices.T])
        points[together] += COPY_OFFSET_EDGES * (middle[together] - points[together])
    return Mesh(points, parted.faces), index


def _bends(mesh: Mesh) -> FloatArray:
    """Find the sharpest concave edge at each vertex, (n,): its angle in degrees, negative if concave."""
    ends, beside = inner_edges(mesh)
    # edges whose two faces are wound unlike each other are left out: there, the inside meets the outside
    agree = ~mesh.edge_table.clash[mesh.edge_table.n_faces == 2]
    least = np.zeros(mesh.n_vertices)
    np.minimum.at(least, ends[agree], bends_and_costs(mesh, ends, beside)[0][agree, None])
    return least


def _contact_vertices(mesh: Mesh, marked: BoolArray, concave: BoolArray, rings: int) -> BoolArray:
    """Find the vertices (n,) of contacts: marks, concave edges and holes connected with them, and rings."""
    contact = marked | concave
    rim = mesh.edges[mesh.edge_table.n_faces == 1]
    _, hole = label_components(mesh.n_vertices, tuple(rim.T))
    contact[rim[np.isin(hole[rim[:, 0]], hole[marked])]] = True
    piece = np.full(mesh.n_vertices, -1)
    piece[contact] = _label_near(mesh, contact)
    contact &= np.isin(piece, piece[marked])
    for _ in range(rings):
        contact = _add_neighbours(mesh, contact)
    return contact


def _add_neighbours(mesh: Mesh, inside: BoolArray) -> BoolArray:
    grown = inside.copy()
    grown[mesh.edges[inside[mesh.edges].any(axis=1)]] = True
    return grown


def _label_near(mesh: Mesh, inside: BoolArray) -> IntArray:
    """Label the vertices inside, (k,); those that are connected, or share a neighbour, get one label."""
    grown = _add_neighbours(mesh, inside)
    _, label = label_components(mesh.n_vertices, tuple(mesh.edges[grown[mesh.edges].all(axis=1)].T))
    return label[inside]


def _fans_of_sheets(mesh: Mesh, marked: BoolArray, contact: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the fan of each corner, (m, 3), and the vertex of each fan: one per sheet, largest first."""
    n = mesh.n_vertices
    graph = coo_array((mesh.edge_lengths, tuple(mesh.edges.T)), shape=(n, n)).tocsr()
    limit = SEEN_DISTANCE * np.sqrt(mesh.area)
    sources = np.flatnonzero(marked)
    distance_to_marks = dijkstra(graph, directed=False, indices=sources, min_only=True, limit=limit)
    around = np.isfinite(distance_to_marks) & ~contact
    count, piece = label_components(n, tuple(mesh.edges[around[mesh.edges].all(axis=1)].T))
    reach = np.zeros(count)
    np.maximum.at(reach, piece[around], distance_to_marks[around])
    sheet = np.where(around & (reach[piece] >= MIN_SHEET_REACH * limit), piece, -1)

    faces = mesh.faces
    at_contact: BoolArray = np.any(contact[faces], axis=1)
    of_face = np.where(at_contact, sheet[faces].max(axis=1), -1)
    face, neighbour, likeness = _face_neighbours(mesh, at_contact)
    _spread_sheets(of_face, face, neighbour, np.argsort(-likeness, kind="stable"))
    corner, of_corner = faces.ravel(), np.repeat(of_face, 3)
    on_sheet = np.flatnonzero(of_corner >= 0)
    low, high = np.full(n, len(faces)), np.full(n, -1)
    np.minimum.at(low, corner[on_sheet], of_corner[on_sheet])
    np.maximum.at(high, corner[on_sheet], of_corner[on_sheet])
    # Faces of no sheet, such as those beyond the contact, stay with one sheet at each of their corners.
    rows = np.flatnonzero((high > low)[corner])
    of_rows = np.where(of_corner[rows] >= 0, of_corner[rows], low[corner[rows]])
    pairs, pair, size = np.unique(
        np.column_stack([corner[rows], of_rows]), axis=0, return_inverse=True, return_counts=True
    )
    largest_first = np.lexsort([-size, pairs[:, 0]])
    rank = np.argsort(largest_first) - np.searchsorted(pairs[:, 0], pairs[:, 0])
    n_fans: IntArray = np.maximum(np.bincount(pairs[:, 0], minlength=n), 1)
    fan = (np.cumsum(n_fans) - n_fans)[corner]
    fan[rows] += rank[pair.ravel()]
    return fan.reshape(-1, 3), np.repeat(np.arange(n), n_fans)


def _face_neighbours(mesh: Mesh, at_contact: BoolArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Pair faces (k,) that traverse an edge in opposite directions, one of them at a contact.

    Return also the cosine of their normals.
    """
    table, start = mesh.edge_table, mesh.faces.ravel()
    edge = np.repeat(np.arange(len(table.ends)), table.n_faces)
    pairs = [
        np.column_stack([table.sides[:-step], table.sides[step:]])[edge[:-step] == edge[step:]]
        for step in range(1, int(table.n_faces.max()))
    ]
    sides = np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs])
    face, neighbour = (sides[start[sides[:, 0]] != start[sides[:, 1]]] // 3).T
    face, neighbour = (rows[at_contact[face] | at_contact[neighbour]] for rows in (face, neighbour))
    normals = face_normals(mesh)
    return face, neighbour, np.einsum("ij,ij->i", normals[face], normals[neighbour])


@compiled()
def _spread_sheets(sheet: IntArray, face: IntArray, neighbour: IntArray, order: IntArray) -> None:
    """Give faces without a sheet, −1, the sheet of neighbours, by a forest with one sheet per tree."""
    parent = np.arange(len(sheet))
    for k in order:
        i, j = find_root(parent, face[k]), find_root(parent, neighbour[k])
        if i != j and (sheet[i] < 0 or sheet[j] < 0 or sheet[i] == sheet[j]):
            parent[j] = i
            sheet[i] = max(sheet[i], sheet[j])
    for f in range(len(sheet)):
        sheet[f] = sheet[find_root(parent, f)]


def _confirm_contacts(
    mesh: Mesh, marked: BoolArray, fan: IntArray, vertex: IntArray, least_distance: float
) -> BoolArray:
    """Select the vertices (n,) with several fans at contacts where distant sheets face each other."""
    several = np.bincount(vertex, minlength=mesh.n_vertices) > 1
    if not several.any():
        return several
    separated = Mesh(mesh.vertices[vertex], fan)
    is_copy = vertex[1:] == vertex[:-1]
    facing = np.ones(mesh.n_vertices)
    normals = separated.vertex_normals
    np.minimum.at(facing, vertex[1:][is_copy], np.einsum("ij,ij->i", normals[1:], normals[:-1])[is_copy])
    places = np.flatnonzero(several)
    seams = [places[rows] for rows in split_by(_label_near(mesh, several))]
    least = [max(MIN_MARKED_SHARE, MARKED_SHARE_AT_RIGHT_ANGLES + facing[v].mean() / 2) for v in seams]
    merged = [v for v, share in zip(seams, least) if marked[v].mean() >= share]
    # Bodies that share a corner, an edge or a wall stay one body. Merged bodies have lost triangles: at least
    # half of the vertices around a hole are at the contact. If a limb would be cut off, only marked vertices
    # are parted.
    component, rim = separated.components, separated.edges[separated.edge_table.n_faces == 1]
    _, hole = label_components(len(vertex), tuple(rim.T))
    is_open = np.isin(np.arange(len(vertex)), rim)
    area = np.bincount(component[separated.faces[:, 0]], separated.face_areas) / separated.area

    def kept_of(seam: IntArray) -> IntArray:
        copies = np.isin(vertex, seam)
        bodies = np.unique(component[copies])
        if len(bodies) == 1:
            return seam
        torn = np.bincount(hole, is_open & copies) >= 0.5 * np.bincount(hole, is_open)
        if not np.isin(bodies, component[copies & is_open & torn[hole]]).all():
            return seam[:0]
        return seam if area[bodies].min() >= MIN_BODY_SHARE else seam[marked[seam]]

    parts = [part for seam in merged if len(part := kept_of(seam))]
    far = far_copies(separated, vertex, parts, least_distance)
    return np.isin(np.arange(mesh.n_vertices), np.concatenate([[-1], *far]))
