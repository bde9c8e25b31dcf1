"""Files of truth between two shapes: a map, pairs of vertices, or points in triangles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from isomatch._core import tables
from isomatch._core.array_file import read_array, read_mat
from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import FormatError, some
from isomatch.correspondence import IndexBase, index_base, read_map
from isomatch.surfaces import Mesh, PrecisePoints

# A weight is allowed to lie this far below 0, and the sum of three weights this far from 1, as published weights
# have few digits; chosen.
MAX_ROUNDING = 1e-2
# suffix of the maps of PARTIALSMAL: indices from 0, then a mask of the target vertices with a counterpart
MASKED_SUFFIX = ".map"
TRUTH_CONTENTS = (  # what a file of truth may hold, in messages
    "expected, for each vertex of the source, a vertex of the target or a triangle and three weights, or else rows of a "
    "source vertex and a target vertex"
)


class Truth(NamedTuple):
    """The truth between two shapes in a file."""

    rows: IntArray  # source and target vertex (q, 2): the corner of largest weight for a point in a triangle
    points: PrecisePoints | None  # the q images, if they are points in triangles
    alone: IntArray | None  # source vertices (m,) without a counterpart; None if the file does not say
    base: IndexBase  # the first index in the file


def read_truth(path: Path, source: Mesh, target: Mesh, counts_from: int | None = None) -> Truth:
    """Read the truth between two shapes from a text, ``.npy``, ``.mat``, or what `Correspondence.load` reads.

    One column: the target vertex of each source vertex, −1 if it has no counterpart. Two columns:
    source and target vertices that correspond. Four columns: for each source vertex a triangle of the
    target and its three barycentric weights. If vertices and triangles count from 1, 0 also means no
    counterpart; by default, `index_base` finds what they count from.
    """
    table = _table(path, source.n_vertices)
    if table is None:
        truth = _truth_of_map(path, source, target, counts_from)
    elif table.shape[1] == 2:
        truth = _truth_of_rows(path, table, source, target, counts_from)
    else:
        truth = _truth_of_triangles(path, table, source.n_vertices, target, counts_from)
    if not len(truth.rows):
        raise FormatError(f"{path}: no vertex has a counterpart; give a truth with at least one")
    return truth


def read_marked(of_source: Path, of_target: Path, target: Mesh) -> Truth:
    """Read the landmarks of two shapes as in SHREC'20; landmarks with the same number correspond.

    Each ``.mat`` file has the numbers of k landmarks, ``points``, their nearest vertices,
    ``verts``, and ``baryc`` (k, 4), a triangle and three weights. All count from 1.
    """
    sides = []
    for path in (of_source, of_target):
        arrays = read_mat(path, "landmarks", "points, verts and baryc")
        try:
            weights = np.reshape(arrays["baryc"], (-1, 4))
            sides.append((np.ravel(arrays["points"]), np.ravel(arrays["verts"]), weights))
        except (KeyError, ValueError) as error:
            raise FormatError(f"{path}: no landmarks ({error}); expected points, verts and baryc") from None
    _, on_source, on_target = np.intersect1d(sides[0][0], sides[1][0], return_indices=True)
    vertices = _whole_numbers(of_source, sides[0][1][on_source]) - 1
    triangles = sides[1][2][on_target].astype(np.float64)
    truth = _truth_of_triangles(of_target, triangles, len(vertices), target, 1)
    if not len(truth.rows):
        raise FormatError(f"{of_source}: has no landmark of {of_target}")
    return truth._replace(rows=np.column_stack([vertices[truth.rows[:, 0]], truth.rows[:, 1]]), alone=None)


def _table(path: Path, n_source: int) -> FloatArray | None:
    """Columns (rows, 2 or 4) of a file; None if it is a map, with one column."""
    suffix = path.suffix.lower()
    arrays: list[AnyArray] = []
    n_maps = 0
    if suffix == ".npz":
        return None
    if suffix == ".npy":
        arrays = [read_array(path)]
    elif suffix == ".mat":
        arrays = [x for x in read_mat(path, "a truth", TRUTH_CONTENTS).values() if isinstance(x, np.ndarray)]
        n_maps = sum(np.squeeze(x).shape == (n_source,) and x.dtype.kind in "iuf" for x in arrays)
    else:
        width = len(next((row.cells for row in tables.read_table(path).titled().filled), []))
        if width == 2:
            pair = "is not a pair; write a source vertex and a target vertex"
            return tables.read_integers(path, 2, pair).astype(np.float64)
        arrays = [read_numbers(path, 4)] if width == 4 else []
    arrays = [x for x in arrays if x.ndim == 2 and x.dtype.kind in "iuf"]
    arrays = [x for x in arrays if x.shape[1] == 2 or x.shape == (n_source, 4)]
    if len(arrays) + n_maps * bool(arrays) > 1:
        raise FormatError(f"{path}: several arrays could be the truth; save it alone")
    return arrays[0].astype(np.float64) if arrays else None


def _truth_of_map(path: Path, source: Mesh, target: Mesh, counts_from: int | None) -> Truth:
    n_source = source.n_vertices
    if path.suffix.lower() == MASKED_SUFFIX:
        image = tables.read_integers(path, 1, "is not a vertex; write one on each line")[:, 0]
        if len(image) == n_source + target.n_vertices:
            return _truth_of_image(path, image[:n_source], target, None, IndexBase(0))
    reading = read_map(path, target.n_vertices, n_source, counts_from=counts_from, allow_doubt=True)
    found, base = reading.map, IndexBase(*reading[1:])
    is_precise = (found.barycentric.max(axis=1) < 1).any()
    points = PrecisePoints(found.faces, found.barycentric) if is_precise else None
    return _truth_of_image(path, found.vertices, target, points, base)


def _truth_of_image(
    path: Path, image: IntArray, target: Mesh, points: PrecisePoints | None, base: IndexBase
) -> Truth:
    _require_within(path, "target vertices", image, -1, target.n_vertices)
    matched = np.flatnonzero(image >= 0)
    if points is not None:
        points = PrecisePoints(points.corners[matched], points.barycentric[matched])
    return Truth(np.column_stack([matched, image[matched]]), points, np.flatnonzero(image < 0), base)


def _truth_of_rows(
    path: Path, table: FloatArray, source: Mesh, target: Mesh, counts_from: int | None
) -> Truth:
    """Read rows of a source vertex and a target vertex, −1 if it has none; one base for both columns."""
    rows = _whole_numbers(path, table)
    base = IndexBase(counts_from or 0)
    # each row names a source vertex, and none is 0: the file might count from 1
    if counts_from is None and (rows[:, 0] != 0).all():
        base = index_base(path, rows[:, 0], source.n_vertices, "source vertices")
        if not base.is_certain:
            base = index_base(path, rows[:, 1], target.n_vertices)
    rows = np.where(rows == -1, -1, rows - base.counts_from)
    _require_within(path, "source vertices", rows[:, 0], 0, source.n_vertices)
    _require_within(path, "target vertices", rows[:, 1], -1, target.n_vertices)
    matched = rows[:, 1] >= 0
    alone = np.setdiff1d(rows[~matched, 0], rows[matched, 0])
    is_complete = len(alone) or len(np.unique(rows[:, 0])) == source.n_vertices
    return Truth(rows[matched], None, alone if is_complete else None, base)


def _truth_of_triangles(
    path: Path, table: FloatArray, n_source: int, target: Mesh, counts_from: int | None
) -> Truth:
    """Read a triangle, negative for no counterpart, and three weights for each source vertex."""
    if len(table) != n_source:
        message = f"{path}: {len(table)} rows for the {n_source} vertices of the source; give one for each"
        raise FormatError(message)
    triangle = np.where(np.isfinite(table).all(axis=1) & (table[:, 0] >= 0), table[:, 0], -1)
    triangle = _whole_numbers(path, triangle)
    base = IndexBase(counts_from or 0)
    if counts_from is None:
        base = index_base(path, triangle, target.n_faces, "triangles of the target")
    matched = np.flatnonzero(triangle >= base.counts_from)
    faces, weights = triangle[matched] - base.counts_from, table[matched, 1:]
    _require_within(path, "triangles of the target", faces, 0, target.n_faces)
    sums = weights.sum(axis=1)
    bad = matched[(weights < -MAX_ROUNDING).any(axis=1) | (np.abs(sums - 1) > MAX_ROUNDING)]
    if len(bad):
        message = f"{path}: weights of vertices {some(bad)} are negative or do not sum to 1; {TRUTH_CONTENTS}"
        raise FormatError(message)
    weights = np.maximum(weights, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    corners = target.faces[faces]
    nearest = corners[np.arange(len(matched)), weights.argmax(axis=1)]
    alone = np.setdiff1d(np.arange(n_source), matched)
    return Truth(np.column_stack([matched, nearest]), PrecisePoints(corners, weights), alone, base)


def _whole_numbers(path: Path, table: FloatArray) -> IntArray:
    if not (np.isfinite(table).all() and (table == np.rint(table)).all()):
        raise FormatError(f"{path}: fractions are no vertices; {TRUTH_CONTENTS}")
    return table.astype(np.int64)


def _require_within(path: Path, what: str, indices: IntArray, least: int, n: int) -> None:
    if indices.min(initial=0) < least or indices.max(initial=-1) >= n:
        raise FormatError(
            f"{path}: names {what} {indices.min()}…{indices.max()}, outside 0…{n - 1}, counted from 0; give the truth of "
            "these two shapes in this direction, and say what it counts from"
        )


def read_indices(path: Path) -> IntArray:
    """Read vertices from text, one a line, counted from 1 as in ``.vts`` files; return them counted from 0."""
    return counted_from(1, path, read_numbers(path)[:, 0])


def counted_from(first: int, path: Path, indices: AnyArray) -> IntArray:
    """Turn indices that count from ``first`` into integers from 0."""
    if indices.dtype.kind not in "fiu":
        raise FormatError(f"{path}: indices of type {indices.dtype}; expected whole numbers")
    if indices.dtype.kind == "f":
        indices = indices.astype(np.float64)
    bad = np.flatnonzero(~((indices >= first) & (indices < 2**53) & (indices == np.rint(indices))))
    if len(bad):
        raise FormatError(
            f"{path}: entries {some(bad)} are not whole numbers from {first}, where indices start in such a file; export "
            "it again with such indices, or use the original"
        )
    return indices.astype(np.int64) - first


def read_numbers(path: Path, columns: int = 1) -> FloatArray:
    """Numbers of a text file, (rows, at least ``columns``); ``#`` and ``%`` start comments."""
    table = tables.read_table(path).titled()
    table.require_width()
    if table.width < columns or not table.filled:
        found = f"{len(table.filled)} rows of {table.width} numbers"
        raise FormatError(f"{path}: {found}, expected rows of {columns}; copy or export it again")
    table = replace(table, rows=table.filled) if columns > 1 else table
    return np.column_stack([table.numbers(i) for i in range(table.width)])
