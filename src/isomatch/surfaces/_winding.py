"""The winding of faces, that is the order of their corners, which defines the outer side: how to make it consistent."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import BoolArray, FloatArray, IntArray
from isomatch.surfaces._edges import edge_table, linked


def faces_to_rewind(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Find the faces to rewind, (m,), so that orientable pieces are wound consistently, and outward if closed.

    A piece is a set of faces connected through edges of exactly two faces. In the orientation double cover each face
    has two copies, one as it is and one rewound, and copies with consistent winding are linked across an edge. An
    orientable piece gives two components of this cover, its two consistent windings. A one-sided piece gives one
    component, and is left as it is.
    """
    m = len(faces)
    edges = edge_table(faces, len(vertices))
    here, there = (edges.meetings[edges.is_pair] // 3).T
    turn = m * edges.same_direction[edges.is_pair]
    links = np.concatenate(
        [np.column_stack([here, there + turn]), np.column_stack([here + m, there + m - turn])]
    )
    _, winding = linked(links, 2 * m)
    n_pieces, piece = linked(np.column_stack([here, there]), m)
    first = np.zeros(n_pieces, dtype=np.int64)
    first[piece[::-1]] = np.arange(m)[::-1]
    rewound = winding[:m] != winding[first][piece]  # relative to the first face of the piece
    one_sided = (winding[:m] == winding[m:])[first]

    open_piece = np.zeros(n_pieces, dtype=bool)
    side_is_paired = np.zeros(3 * m, dtype=bool)
    side_is_paired[edges.meetings[edges.is_pair]] = True
    open_piece[piece[~side_is_paired.reshape(m, 3).all(axis=1)]] = True
    sign = np.where(rewound, -1.0, 1.0)
    volume = np.bincount(piece, sign * signed_volumes(vertices, faces), n_pieces)
    majority = np.bincount(piece, sign, n_pieces)
    reverse = np.where(open_piece | (volume == 0), majority, volume) < 0
    to_rewind: BoolArray = (rewound ^ reverse[piece]) & ~one_sided[piece]
    return to_rewind


def signed_volumes(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute the signed volume of the tetrahedron of each face and the mean vertex, (m,).

    The unit is the cube of the largest coordinate. The sum over a closed surface is positive if its faces are oriented
    outward.
    """
    if not len(faces):
        return np.zeros(0)
    points = vertices / (np.abs(vertices).max() or 1.0)
    a, b, c = (points[faces[:, i]] for i in range(3))
    volumes: FloatArray = np.einsum("ij,ij->i", a - points.mean(axis=0), np.cross(b - a, c - a)) / 6
    return volumes
