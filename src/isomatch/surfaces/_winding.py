"""The winding of faces, that is the order of their corners, which defines the outer side: how to make it consistent."""

from __future__ import annotations

import numpy as np

from isomatch._arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch.surfaces._coincident import first_equal
from isomatch.surfaces._edges import edge_table, linked

NEARLY_CLOSED = 0.1
"""A piece is nearly closed if flat discs with the lengths of its boundary loops have at most this share of its area."""


def faces_to_rewind(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Find the faces to rewind, (m,), so that orientable pieces are wound consistently, and outward if nearly closed.

    A piece is a set of faces connected through edges of exactly two faces. In the orientation double cover each face
    has two copies, one as it is and one rewound, and copies with consistent winding are linked across an edge. An
    orientable piece gives two components of this cover, its two consistent windings. A one-sided piece gives one
    component, and is left as it is. A piece that is not nearly closed keeps the winding of most of its faces.
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

    unpaired = np.ones(3 * m, dtype=bool)
    unpaired[edges.meetings[edges.is_pair]] = False
    sign = np.where(rewound, -1.0, 1.0)
    volume = _volume_if_nearly_closed(vertices, faces, sign, np.flatnonzero(unpaired), piece, first)
    majority = np.bincount(piece, sign, n_pieces)
    reverse = np.where(volume == 0, majority, volume) < 0
    to_rewind: BoolArray = (rewound ^ reverse[piece]) & ~one_sided[piece]
    return to_rewind


def _volume_if_nearly_closed(
    vertices: FloatArray,
    faces: IntArray,
    sign: FloatArray,
    unpaired: IntArray,
    piece: IntArray,
    first: IntArray,
) -> FloatArray:
    """Signed volume of each piece, its holes closed by cones, in no particular unit; 0 if it is not nearly closed.

    The boundary of a piece is where more of its sides run along an edge in one direction than in the other. More than
    two faces may meet at an edge, as where vertices were welded, and still leave no boundary.
    """
    points = vertices / (np.abs(vertices).max(initial=0.0) or 1.0)
    n_pieces = len(first)
    origin = points[faces[first, 0]]

    def summed(of: IntArray, values: AnyArray, count: int = n_pieces) -> FloatArray:
        return np.bincount(of, values, count).astype(np.float64)

    def volumes(of: IntArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        volume: FloatArray = np.einsum("ij,ij->i", a - origin[of], np.cross(b - origin[of], c - origin[of]))
        return volume

    start, end, of = faces.ravel()[unpaired], faces[:, [1, 2, 0]].ravel()[unpaired], piece[unpaired // 3]
    low, high = np.minimum(start, end), np.maximum(start, end)
    edge = first_equal(np.column_stack([of, low, high]))
    excess = summed(edge, np.where(start < end, 1.0, -1.0) * sign[unpaired // 3], len(edge))
    rim = np.flatnonzero(excess)
    low, high, of, excess = low[rim], high[rim], of[rim], excess[rim]
    ends = first_equal(np.column_stack([np.tile(of, 2), np.concatenate([low, high])])).reshape(2, -1).T
    n_loops, label = linked(ends, ends.size)
    loop = label[ends[:, 0]]
    apex = np.column_stack([summed(loop, points[low, axis], n_loops) for axis in range(3)])[loop]
    apex /= summed(loop, np.ones(len(loop)), n_loops)[loop][:, None]

    a, b, c = (points[faces[:, i]] for i in range(3))
    volume = summed(piece, sign * volumes(piece, a, b, c))
    volume += summed(of, excess * volumes(of, points[high], points[low], apex))
    area = summed(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    length = np.abs(excess) * np.linalg.norm(points[high] - points[low], axis=1)
    discs = summed(of, summed(loop, length, n_loops)[loop] * length) / (4 * np.pi)
    return np.where(discs <= NEARLY_CLOSED * area, volume, 0.0)
