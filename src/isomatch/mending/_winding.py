"""The winding of faces, that is the order of their corners, which defines the outer side: how to make it consistent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.surfaces import Meetings, Mesh, first_equal, linked, meetings
from isomatch.values.arrays import AnyArray, BoolArray, FloatArray, IntArray

LEAST_VOLUME = 0.01
"""Volume over area^(3/2) that tells where an open surface looks: 0.03 of a cat and 0.09 of a ball, and more of parts of
them; 0.002 of a rough sheet."""
NEARLY_CLOSED = 0.1
"""A piece is nearly closed if flat discs with the lengths of its boundary loops have at most this share of its area."""


def faces_to_rewind(mesh: Mesh, met: Meetings | None = None) -> BoolArray:
    """Find the faces to rewind, (m,), so that orientable pieces are wound consistently, and outward if nearly closed.

    A piece is a set of faces connected through edges of exactly two faces. In the orientation double cover each face
    has two copies, one as it is and one rewound, and copies with consistent winding are linked across an edge. An
    orientable piece gives two components of this cover, its two consistent windings. A one-sided piece gives one
    component, and is left as it is. A piece that is not nearly closed keeps the winding of most of its faces.
    """
    pieces = _pieces(mesh, met)
    volume = np.where(pieces.openings <= NEARLY_CLOSED, pieces.volume, 0.0)
    reverse = np.where(volume == 0, pieces.majority, volume) < 0
    to_rewind: BoolArray = (pieces.rewound ^ reverse[pieces.piece]) & ~pieces.one_sided[pieces.piece]
    return to_rewind


def seems_inside_out(mesh: Mesh) -> bool:
    """Whether the largest piece of a mesh, which keeps its winding as its openings are large, looks inward.

    It is closed over its openings by cones; the sign of the volume inside says where its faces look. Seen from outside, a
    half or a fifth of a body still bulges towards who looks; a scan of a cavity does not, so nothing is turned over.

    Parameters
    ----------
    mesh : Mesh
        Wound consistently, as by `repair`.

    Returns
    -------
    bool
        False also if it is nearly closed, one-sided, or almost flat, so that the volume says nothing.

    Examples
    --------
    Five sides of a box, of which the bottom is missing:

    >>> corners = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    >>> sides = [[0, 1, 5], [0, 5, 4], [1, 3, 7], [1, 7, 5], [3, 2, 6], [3, 6, 7], [2, 0, 4], [2, 4, 6]]
    >>> outward = np.array([*sides, [4, 5, 7], [4, 7, 6]])
    >>> seems_inside_out(Mesh(corners, outward)), seems_inside_out(Mesh(corners, outward[:, ::-1]))
    (False, True)
    """
    if not mesh.n_faces:
        return False
    pieces = _pieces(mesh, None)
    largest = int(pieces.area.argmax())
    volume = pieces.volume[largest] * np.sign(pieces.majority[largest])
    return bool(
        pieces.openings[largest] > NEARLY_CLOSED
        and not pieces.one_sided[largest]
        and volume < -LEAST_VOLUME * pieces.area[largest] ** 1.5
    )


@dataclass(frozen=True)
class _Pieces:
    """Sets of faces that are connected through edges of exactly two faces.

    Parameters
    ----------
    piece : (m,) array of int
        The piece of each face.
    rewound : (m,) array of bool
        Whether a face is wound otherwise than the first one of its piece.
    one_sided : (p,) array of bool
        Whether a piece cannot be oriented.
    majority : (p,) array of float
        How many more faces are wound like the first one than otherwise.
    volume, area, openings : (p,) array of float
        Signed volume if wound like the first face, its openings closed by cones, and area, in some unit; the area of flat
        discs with the lengths of the openings, as a share of the area.
    """

    piece: IntArray
    rewound: BoolArray
    one_sided: BoolArray
    majority: FloatArray
    volume: FloatArray
    area: FloatArray
    openings: FloatArray


def _pieces(mesh: Mesh, met: Meetings | None) -> _Pieces:
    m = mesh.n_faces
    met = met or meetings(mesh.edge_table, mesh.faces)
    paired = met.sides if met.is_pair.all() else met.sides[met.is_pair]
    here, there = (paired // 3).T
    n_pieces, piece = linked(m, (here, there))
    first = np.zeros(n_pieces, dtype=np.int64)
    first[piece[::-1]] = np.arange(m)[::-1]
    rewound, one_sided = np.zeros(m, dtype=bool), np.zeros(n_pieces, dtype=bool)
    if (met.same_direction & met.is_pair).any():
        turn = m * met.same_direction[met.is_pair]
        _, winding = linked(2 * m, (here, there + turn), (here + m, there + m - turn))
        rewound = winding[:m] != winding[first][piece]  # relative to the first face of the piece
        one_sided = (winding[:m] == winding[m:])[first]

    unpaired = np.ones(3 * m, dtype=bool)
    unpaired[paired] = False
    sign = np.where(rewound, -1.0, 1.0)
    measured = _measured(mesh, sign, np.flatnonzero(unpaired), piece, first)
    return _Pieces(
        piece, rewound, one_sided, np.bincount(piece, sign, n_pieces).astype(np.float64), *measured
    )


def _measured(
    mesh: Mesh, sign: FloatArray, unpaired: IntArray, piece: IntArray, first: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Signed volume of each piece, its holes closed by cones, its area, and the share of its openings.

    The boundary of a piece is where more of its sides run along an edge in one direction than in the other. More than
    two faces may meet at an edge, as where vertices were welded, and still leave no boundary.
    """
    size = np.abs(mesh.vertices).max(initial=0.0) or 1.0
    unit = mesh if size == 1 else mesh.moved(mesh.vertices / size)
    points, faces = unit.vertices, unit.faces
    n_pieces = len(first)
    origin = points[faces[first, 0]]

    def summed(of: IntArray, values: AnyArray, count: int = n_pieces) -> FloatArray:
        return np.bincount(of, values, count).astype(np.float64)

    start, end, of = faces.ravel()[unpaired], faces[:, [1, 2, 0]].ravel()[unpaired], piece[unpaired // 3]
    low, high = np.minimum(start, end), np.maximum(start, end)
    edge = first_equal(np.column_stack([of, low, high]))
    excess = summed(edge, np.where(start < end, 1.0, -1.0) * sign[unpaired // 3], len(edge))
    rim = np.flatnonzero(excess)
    low, high, of, excess = low[rim], high[rim], of[rim], excess[rim]
    ends = first_equal(np.column_stack([np.tile(of, 2), np.concatenate([low, high])])).reshape(2, -1)
    n_loops, label = linked(ends.size, (ends[0], ends[1]))
    loop = label[ends[0]]
    apex = np.column_stack([summed(loop, points[low, axis], n_loops) for axis in range(3)])[loop]
    apex /= summed(loop, np.ones(len(loop)), n_loops)[loop][:, None]

    volumes = np.zeros(len(faces))
    _fill_volumes(points, faces, origin, piece, volumes)
    volume = summed(piece, sign * volumes)
    cones = np.cross(points[low] - origin[of], apex - origin[of])
    volume += summed(of, excess * np.einsum("ij,ij->i", points[high] - origin[of], cones))
    area = summed(piece, unit.face_areas)
    length = np.abs(excess) * np.linalg.norm(points[high] - points[low], axis=1)
    discs = summed(of, summed(loop, length, n_loops)[loop] * length) / (4 * np.pi)
    none = np.where(discs > 0, np.inf, 0.0)
    return volume / 6, area, np.divide(discs, area, out=none, where=area > 0)


@compiled()
def _fill_volumes(
    points: FloatArray, faces: IntArray, origin: FloatArray, piece: IntArray, volumes: FloatArray
) -> None:
    """Compute six times the signed volume between each face and the origin of its piece."""
    for f in range(len(faces)):
        a, b, c, o = faces[f, 0], faces[f, 1], faces[f, 2], piece[f]
        x, y, z = origin[o, 0], origin[o, 1], origin[o, 2]
        ux, uy, uz = points[b, 0] - x, points[b, 1] - y, points[b, 2] - z
        vx, vy, vz = points[c, 0] - x, points[c, 1] - y, points[c, 2] - z
        volumes[f] = (
            (points[a, 0] - x) * (uy * vz - uz * vy)
            + (points[a, 1] - y) * (uz * vx - ux * vz)
            + (points[a, 2] - z) * (ux * vy - uy * vx)
        )
