"""The winding of faces, that is the order of their corners, which defines the outer side: how to make it consistent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only
from isomatch._core.cached import cached_method
from isomatch._core.compiled import compiled
from isomatch.surfaces import Mesh, first_equal, label_components

# An open surface has an inside if its volume, closed by cones, is at least this times area^(3/2); chosen: a
# cat has 0.03, a ball 0.09, parts of them more, a rough sheet 0.002.
MIN_VOLUME_RATIO = 0.01
# A piece is nearly closed if its openings have at most this share of its area, each taken as a flat disc
# whose circumference is as long as its boundary; chosen.
MAX_OPENING_SHARE = 0.1


def faces_to_rewind(mesh: Mesh) -> BoolArray:
    """Find the faces to rewind, (m,): pieces become consistent, and look outward if nearly closed."""
    # A piece that cannot be oriented is left as it is. A void, or a piece that is not nearly closed, keeps
    # the winding of most of its faces; any other piece gets a positive volume. A face is turned over if one,
    # and only one, is true: it is wound unlike the first face of its piece, or the piece is reversed.
    pieces = _pieces(mesh)
    volume = np.where(pieces.openings <= MAX_OPENING_SHARE, pieces.volume, 0.0)
    reverse = np.where(volume == 0, pieces.majority, volume) < 0
    inward = np.flatnonzero((volume != 0) & (reverse != (pieces.majority < 0)) & ~pieces.one_sided)
    voids = inward[_depth(mesh, pieces, inward, volume != 0) % 2 == 1]
    reverse[voids] = pieces.majority[voids] < 0
    to_rewind: BoolArray = (pieces.rewound ^ reverse[pieces.piece]) & ~pieces.one_sided[pieces.piece]
    return to_rewind


def rewind_faces(mesh: Mesh, rewound: BoolArray | None = None) -> Mesh:
    """Rewind some faces (m,) of a mesh, all by default."""
    turned_over = mesh.faces[:, [0, 2, 1]]
    faces = turned_over if rewound is None else np.where(rewound[:, None], turned_over, mesh.faces)
    return Mesh(mesh.vertices, faces)


def shells(mesh: Mesh) -> tuple[BoolArray, BoolArray]:
    """Find the faces (m,) of nearly closed pieces: solids, and voids, which lie in a solid."""
    pieces = _pieces(mesh)
    closed = (pieces.openings <= MAX_OPENING_SHARE) & ~pieces.one_sided & (pieces.volume != 0)
    inward = np.flatnonzero(closed & (pieces.volume * np.sign(pieces.majority) < 0))
    is_void = np.zeros(len(closed), dtype=bool)
    is_void[inward] = _depth(mesh, pieces, inward, closed) % 2 == 1
    return (closed & ~is_void)[pieces.piece], is_void[pieces.piece]


def _depth(mesh: Mesh, pieces: _Pieces, asked: IntArray, closed: BoolArray) -> IntArray:
    """Count the closed pieces around each asked piece, by the winding number of its first corner."""
    depth = np.zeros(len(asked), dtype=np.int64)
    if not len(asked) or len(closed) < 2:
        return depth
    corners = mesh.vertices[mesh.faces]
    lowest, highest = np.full((len(closed), 3), np.inf), np.full((len(closed), 3), -np.inf)
    np.minimum.at(lowest, pieces.piece, corners.min(axis=1))
    np.maximum.at(highest, pieces.piece, corners.max(axis=1))
    for row, i in enumerate(asked.tolist()):
        around = closed & (lowest <= lowest[i]).all(axis=1) & (highest >= highest[i]).all(axis=1)
        around[i] = False
        for j in np.flatnonzero(around):
            faces = np.flatnonzero(pieces.piece == j)
            sign = np.where(pieces.rewound[faces], -1.0, 1.0)
            place = corners[np.argmax(pieces.piece == i), 0]
            depth[row] += abs((sign * _solid_angles(corners[faces] - place)).sum()) > 2 * np.pi
    return depth


def _solid_angles(corners: FloatArray) -> FloatArray:
    """Signed solid angle (m,) of triangles (m, 3, 3) seen from the origin (Van Oosterom & Strackee 1983)."""
    a, b, c = corners.transpose(1, 0, 2)
    x, y, z = (np.linalg.norm(vector, axis=1) for vector in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", *two) for two in ((a, b), (b, c), (c, a)))
    angles: FloatArray = 2 * np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y)
    return angles


def seems_inside_out(mesh: Mesh) -> bool:
    """Whether the largest piece of a consistently wound mesh with large openings looks inward.

    Cones close the openings; the sign of the volume inside says where the faces look. Even a fifth
    of a body bulges outward, but a scan of a cavity does not, so nothing is turned over. False if
    the piece is nearly closed, one-sided, or so flat that the volume says nothing.
    """
    if (mesh.edge_table.n_faces == 2).all():
        return False  # the mesh has no openings
    pieces = _pieces(mesh)
    largest = int(pieces.area.argmax())
    volume = pieces.volume[largest] * np.sign(pieces.majority[largest])
    return bool(
        pieces.openings[largest] > MAX_OPENING_SHARE
        and not pieces.one_sided[largest]
        and volume < -MIN_VOLUME_RATIO * pieces.area[largest] ** 1.5
    )


@dataclass(frozen=True)
class _Pieces:
    """Sets of faces that are connected across edges of exactly two faces."""

    piece: IntArray  # the piece of each face, (m,)
    rewound: BoolArray  # whether each face is wound unlike the first face of its piece, (m,)
    one_sided: BoolArray  # whether each piece cannot be oriented, (p,)
    majority: FloatArray  # number of faces wound like the first face, minus the other faces, (p,)
    volume: FloatArray  # signed volume with openings closed by cones, in (largest coordinate)³, (p,)
    area: FloatArray  # area in (largest coordinate)², (p,)
    openings: FloatArray  # area of the openings as flat discs, over the area of the piece, (p,)


@cached_method
def _pieces(mesh: Mesh) -> _Pieces:
    opposite = mesh.edge_table.opposite
    piece, rewound = np.full(mesh.n_faces, -1, dtype=np.int64), np.zeros(mesh.n_faces, dtype=bool)
    first, one_sided = np.empty(mesh.n_faces, dtype=np.int64), np.zeros(mesh.n_faces, dtype=bool)
    reached = np.empty(mesh.n_faces, dtype=np.int32)
    n_pieces = _flood(read_only(mesh.faces), opposite, reached, piece, rewound, first, one_sided)
    first, one_sided = first[:n_pieces], one_sided[:n_pieces]
    rewound &= ~one_sided[piece]
    sign = np.where(rewound, -1.0, 1.0)
    measured = _measure_pieces(mesh, sign, np.flatnonzero(opposite < 0), piece, first)
    balance = np.bincount(piece, sign, n_pieces).astype(np.float64)
    return _Pieces(piece, rewound, one_sided, balance, *measured)


@compiled()
def _flood(
    faces: IntArray,
    opposite: AnyArray,
    reached: AnyArray,
    piece: IntArray,
    rewound: BoolArray,
    first: IntArray,
    one_sided: BoolArray,
) -> int:
    """Label the pieces of faces and count them; set the first face of each, and which pieces are one-sided."""
    n_pieces = 0
    for start in range(len(faces)):
        if piece[start] >= 0:
            continue
        first[n_pieces] = reached[0] = start
        piece[start] = n_pieces
        n_reached = 1
        while n_reached:
            n_reached -= 1
            f = reached[n_reached]
            for i in range(3):
                next_side = opposite[3 * f + i]
                if next_side < 0:
                    continue
                # Two faces agree if they traverse their edge in opposite directions, so that it
                # starts at different vertices. If two ways to a face disagree, the piece is one-sided.
                g = next_side // 3
                is_rewound = rewound[f] ^ (faces[f, i] == faces[g, next_side % 3])
                if piece[g] < 0:
                    piece[g] = n_pieces
                    rewound[g] = is_rewound
                    reached[n_reached] = g
                    n_reached += 1
                elif rewound[g] != is_rewound:
                    one_sided[n_pieces] = True
        n_pieces += 1
    return n_pieces


def _measure_pieces(
    mesh: Mesh, sign: FloatArray, unpaired: IntArray, piece: IntArray, first: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the signed volume of each piece with holes closed by cones, its area, and `openings`."""
    size = np.abs(mesh.vertices).max(initial=0.0) or 1.0
    unit = mesh if size == 1 else mesh.moved(mesh.vertices / size)
    points, faces = unit.vertices, unit.faces
    n_pieces = len(first)
    origin = points[faces[first, 0]]

    def summed(owner: IntArray, values: AnyArray, count: int = n_pieces) -> FloatArray:
        return np.bincount(owner, values, count).astype(np.float64)

    owner, following = piece[unpaired // 3], unpaired + np.where(unpaired % 3 == 2, -2, 1)
    start, end = faces.ravel()[unpaired], faces.ravel()[following]
    low, high = np.minimum(start, end), np.maximum(start, end)
    # The boundary of a piece is where more of its sides run along an edge in one direction than in
    # the other. More than two faces may meet at an edge without a boundary, as at welded vertices.
    edge = first_equal(np.column_stack([owner, low, high]))
    excess = summed(edge, np.where(start < end, 1.0, -1.0) * sign[unpaired // 3], len(edge))
    rim_rows = np.flatnonzero(excess)
    low, high, owner, excess = low[rim_rows], high[rim_rows], owner[rim_rows], excess[rim_rows]
    ends = first_equal(np.column_stack([np.tile(owner, 2), np.concatenate([low, high])])).reshape(2, -1)
    n_loops, label = label_components(ends.size, (ends[0], ends[1]))
    loop = label[ends[0]]
    apex = np.column_stack([summed(loop, points[low, axis], n_loops) for axis in range(3)])[loop]
    apex /= summed(loop, np.ones(len(loop)), n_loops)[loop][:, None]

    # The volume V of a piece with origin o is 6 V = Σ det(a − o, b − o, c − o) over its faces (a, b, c) and
    # over the faces (high, low, apex) of the cones that close its holes.
    volumes = np.zeros(len(faces))
    _fill_volumes(points, faces, origin, piece, volumes)
    volume = summed(piece, sign * volumes)
    cones = np.cross(points[low] - origin[owner], apex - origin[owner])
    volume += summed(owner, excess * np.einsum("ij,ij->i", points[high] - origin[owner], cones))
    area = summed(piece, unit.face_areas)
    length = np.abs(excess) * np.linalg.norm(points[high] - points[low], axis=1)
    discs = summed(owner, summed(loop, length, n_loops)[loop] * length) / (4 * np.pi)
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
