"""Limbs that were merged by distance: which sheet each face at the contact is of, and the sheets parted again."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch.repair.self_contacts import bends_and_costs, copied, face_normals, inner_edges
from isomatch.repair.sheets import SHEET_DISTANCE, Separation, crowded, far_copies, split_by
from isomatch.surfaces import Mesh, first_equal, linked, root

# A merge leaves a ragged ring: edges of three and four faces, vertices where several fans meet, small holes where
# triangles of both sheets vanished; between them stay edges of two faces that bend sharply. All these vertices are the
# contact. Without them, the surface around the contact falls apart into the sheets; around a fold or a pinch of one
# sheet, which separate nothing, it stays in one piece. Faces at the contact are of the sheet of their other corners.
# Where that leaves the sheets joined, flatter edges, and then neighbours, are taken for a part of the contact too.
PASSES = ((120.0, 0), (90.0, 0), (60.0, 0), (40.0, 0), (60.0, 1))  # concave by so many degrees; rings added
AROUND = 0.08  # √area, less than half the shortest way from one sheet to the other: how far around the contact is seen
REACH = 0.8  # of it, to which a piece extends that is a sheet; others are rags of the contact
# Marked are vertices of edges with more than two faces, or with several fans. A contact has at least this share of them,
# and 0.2 + half the mean cosine of the normals of copies: merged limbs face each other. In 200 merges of bodies of FAUST,
# TOSCA, SCAPE and MakeHuman contacts had shares of 0.29 to 1 and cosines up to 0.3; folds and holes, up to 0.2 and from 0
MARKED = 0.25
SQUARE = 0.2
LEAST_BODY = 0.2  # share of the area of the smallest of bodies that come apart; a leg has 0.17
APART = 0.25  # mean edge length, by which copies move inward: points at one position would be welded again


def unmerged(mesh: Mesh, least_distance: float = SHEET_DISTANCE) -> Separation:
    """Part limbs whose vertices were merged by distance, and move them apart; copies follow the vertices of the mesh."""
    # the mesh is sound and wound consistently. One of which no more than two faces meet at an edge, and one fan at a
    # vertex, is returned as it is, without seams. O(n log n) time: 0.1 s for 13 000 vertices that have marks
    marked, label = crowded(mesh), mesh.components
    faces, points, index, seams = mesh.faces.copy(), mesh.vertices.copy(), np.arange(mesh.n_vertices), []
    for component in np.unique(label[marked]):
        body, rows = mesh.submesh(label == component)
        apart = _component_unmerged(body, least_distance)
        if apart.seams:
            number = np.concatenate([rows, len(points) + np.arange(len(apart.vertex_index) - len(rows))])
            faces[label[mesh.faces[:, 0]] == component] = number[apart.mesh.faces]
            points = np.concatenate([points, apart.mesh.vertices[len(rows) :]])
            points[rows] = apart.mesh.vertices[: len(rows)]
            index = np.concatenate([index, rows[apart.vertex_index[len(rows) :]]])
            seams += [rows[seam] for seam in apart.seams]
    return Separation(Mesh(points, faces) if seams else mesh, index, tuple(seams))


def _component_unmerged(mesh: Mesh, least_distance: float) -> Separation:
    index = np.arange(mesh.n_vertices)
    size = np.abs(mesh.vertices).max() or 1.0  # divided by it, squares and products do not overflow
    parted = mesh.moved(mesh.vertices / size)
    inward = parted.volume < 0  # what is concave, and which way leads inward, is told by the winding
    parted = _turned(parted) if inward else parted
    while True:  # until another call would part nothing more, as where limbs meet that have moved
        further, origin = _parted_once(parted, least_distance)
        if len(origin) == len(index):
            break
        parted, index = further, index[origin]
    if len(index) == mesh.n_vertices:
        return Separation(mesh, index, ())
    several = np.bincount(index, minlength=mesh.n_vertices) > 1
    points = np.where(several[index][:, None], size * parted.vertices, mesh.vertices[index])
    seams = [np.flatnonzero(several)[rows] for rows in split_by(_near_one_another(mesh, several))]
    return Separation(Mesh(points, (_turned(parted) if inward else parted).faces), index, tuple(seams))


def _turned(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, [0, 2, 1]])


def _parted_once(mesh: Mesh, least_distance: float) -> tuple[Mesh, IntArray]:
    """Part limbs and move them apart; returns also the old number of each vertex."""
    parted, index = mesh, np.arange(mesh.n_vertices)
    marked, bends = crowded(mesh), _bends(mesh)
    for concave, rings in PASSES:
        if not marked.any():
            break
        contact = _contact(parted, marked, bends < -concave, rings)
        fan, vertex = _fans_of_sheets(parted, marked, contact)
        merged = _confirmed(parted, marked, fan, vertex, least_distance)
        if merged.any():
            parted, origin = copied(parted, fan, vertex, merged)
            index = index[origin]
            marked, bends = crowded(parted), _bends(parted)
    moves = (np.bincount(index, minlength=mesh.n_vertices) > 1)[index]
    if not moves.any():
        return mesh, index
    points = parted.vertices.copy()
    points[moves] -= APART * mesh.edge_lengths.mean() * parted.vertex_normals[moves]
    together = np.flatnonzero(moves & (first_equal(points) != np.arange(len(points))))
    if len(together):  # as normals of crumpled sheets may agree
        start, end = np.concatenate([parted.edges, parted.edges[:, ::-1]]).T
        count = np.maximum(np.bincount(start, minlength=len(points)), 1)
        middle = np.column_stack([np.bincount(start, x[end], len(points)) / count for x in parted.vertices.T])
        points[together] += APART * (middle[together] - points[together])
    return Mesh(points, parted.faces), index


def _bends(mesh: Mesh) -> FloatArray:
    """Least angle (n,), in degrees, by which the surface bends at an edge of each vertex, negative where concave."""
    ends, beside = inner_edges(mesh)
    agree = ~mesh.edge_table.clash[mesh.edge_table.n_faces == 2]  # elsewhere inside and outside meet
    least = np.zeros(mesh.n_vertices)
    np.minimum.at(least, ends[agree], bends_and_costs(mesh, ends, beside)[0][agree, None])
    return least


def _contact(mesh: Mesh, marked: BoolArray, concave: BoolArray, rings: int) -> BoolArray:
    """Vertices (n,) of contacts: the marks, and what is concave or at a hole and connected with them; with rings."""
    contact = marked | concave
    rim = mesh.edges[mesh.edge_table.n_faces == 1]
    _, hole = linked(mesh.n_vertices, tuple(rim.T))
    contact[rim[np.isin(hole[rim[:, 0]], hole[marked])]] = True
    piece = np.full(mesh.n_vertices, -1)
    piece[contact] = _near_one_another(mesh, contact)
    contact &= np.isin(piece, piece[marked])
    for _ in range(rings):
        contact = _with_neighbours(mesh, contact)
    return contact


def _with_neighbours(mesh: Mesh, inside: BoolArray) -> BoolArray:
    grown = inside.copy()
    grown[mesh.edges[inside[mesh.edges].any(axis=1)]] = True
    return grown


def _near_one_another(mesh: Mesh, inside: BoolArray) -> IntArray:
    """Label (k,) vertices alike that are connected with one another, or at most one neighbour of theirs apart."""
    grown = _with_neighbours(mesh, inside)
    _, label = linked(mesh.n_vertices, tuple(mesh.edges[grown[mesh.edges].all(axis=1)].T))
    return label[inside]


def _fans_of_sheets(mesh: Mesh, marked: BoolArray, contact: BoolArray) -> tuple[IntArray, IntArray]:
    """Fan of each corner of each face, (m, 3), and the vertex of each fan: one for each sheet, the largest first."""
    n = mesh.n_vertices
    graph = coo_array((mesh.edge_lengths, tuple(mesh.edges.T)), shape=(n, n)).tocsr()
    limit = AROUND * np.sqrt(mesh.area)
    away = dijkstra(graph, directed=False, indices=np.flatnonzero(marked), min_only=True, limit=limit)
    around = np.isfinite(away) & ~contact
    count, piece = linked(n, tuple(mesh.edges[around[mesh.edges].all(axis=1)].T))
    reach = np.zeros(count)
    np.maximum.at(reach, piece[around], away[around])
    sheet = np.where(around & (reach[piece] >= REACH * limit), piece, -1)

    faces = mesh.faces
    at_contact: BoolArray = np.any(contact[faces], axis=1)
    of_face = np.where(at_contact, sheet[faces].max(axis=1), -1)
    here, there, likeness = _neighbours(mesh, at_contact)
    _spread(of_face, here, there, np.argsort(-likeness, kind="stable"))
    corner, of_corner = faces.ravel(), np.repeat(of_face, 3)
    on_sheet = np.flatnonzero(of_corner >= 0)
    low, high = np.full(n, len(faces)), np.full(n, -1)
    np.minimum.at(low, corner[on_sheet], of_corner[on_sheet])
    np.maximum.at(high, corner[on_sheet], of_corner[on_sheet])
    # faces that are of no sheet, as beyond the contact, stay with one at each of their corners
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


def _neighbours(mesh: Mesh, at_contact: BoolArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs of faces (k,) that traverse an edge in opposite directions, one at a contact; the cosine of their normals."""
    table, start = mesh.edge_table, mesh.faces.ravel()
    edge = np.repeat(np.arange(len(table.ends)), table.n_faces)
    pairs = [
        np.column_stack([table.sides[:-step], table.sides[step:]])[edge[:-step] == edge[step:]]
        for step in range(1, int(table.n_faces.max()))
    ]
    sides = np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs])
    here, there = (sides[start[sides[:, 0]] != start[sides[:, 1]]] // 3).T
    here, there = (rows[at_contact[here] | at_contact[there]] for rows in (here, there))
    normals = face_normals(mesh)
    return here, there, np.einsum("ij,ij->i", normals[here], normals[there])


@compiled()
def _spread(sheet: IntArray, here: IntArray, there: IntArray, order: IntArray) -> None:
    """Give faces without a sheet, −1, that of their neighbours: a spanning forest whose trees are of one sheet each."""
    parent = np.arange(len(sheet))
    for k in order:
        i, j = root(parent, here[k]), root(parent, there[k])
        if i != j and (sheet[i] < 0 or sheet[j] < 0 or sheet[i] == sheet[j]):
            parent[j] = i
            sheet[i] = max(sheet[i], sheet[j])
    for f in range(len(sheet)):
        sheet[f] = sheet[root(parent, f)]


def _confirmed(
    mesh: Mesh, marked: BoolArray, fan: IntArray, vertex: IntArray, least_distance: float
) -> BoolArray:
    """Vertices (n,) with several fans, of contacts where sheets that are far apart face each other."""
    several = np.bincount(vertex, minlength=mesh.n_vertices) > 1
    if not several.any():
        return several
    apart = Mesh(mesh.vertices[vertex], fan)
    is_copy = vertex[1:] == vertex[:-1]
    facing = np.ones(mesh.n_vertices)
    normals = apart.vertex_normals
    np.minimum.at(facing, vertex[1:][is_copy], np.einsum("ij,ij->i", normals[1:], normals[:-1])[is_copy])
    places = np.flatnonzero(several)
    seams = [places[rows] for rows in split_by(_near_one_another(mesh, several))]
    merged = [v for v in seams if marked[v].mean() >= max(MARKED, SQUARE + facing[v].mean() / 2)]
    # bodies that share a corner, an edge or a wall stay one; those that were merged have lost triangles, so that at least
    # half of some hole is of the contact. Where a limb would be cut off, only marked vertices are parted
    component, rim = apart.components, apart.edges[apart.edge_table.n_faces == 1]
    _, hole = linked(len(vertex), tuple(rim.T))
    is_open = np.isin(np.arange(len(vertex)), rim)
    area = np.bincount(component[apart.faces[:, 0]], apart.face_areas) / apart.area

    def kept_of(seam: IntArray) -> IntArray:
        copies = np.isin(vertex, seam)
        bodies = np.unique(component[copies])
        if len(bodies) == 1:
            return seam
        torn = np.bincount(hole, is_open & copies) >= 0.5 * np.bincount(hole, is_open)
        if not np.isin(bodies, component[copies & is_open & torn[hole]]).all():
            return seam[:0]
        return seam if area[bodies].min() >= LEAST_BODY else seam[marked[seam]]

    far = far_copies(apart, vertex, [part for seam in merged if len(part := kept_of(seam))], least_distance)
    return np.isin(np.arange(mesh.n_vertices), np.concatenate([[-1], *far]))
