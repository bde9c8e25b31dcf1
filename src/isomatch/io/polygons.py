"""Polygons of different sizes in one concatenated array; triangles, renumbering, texture seams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mapbox_earcut import triangulate_float64
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, array_of, read_only
from isomatch._core.cached import cached_property
from isomatch._core.errors import MeshError
from isomatch.io.attribute import Attribute, without_labels
from isomatch.surfaces import first_equal, weld_points

# rounding error of a corner's position, over the largest coordinate; chosen: 16 units in the last place
_CORNER_ROUNDING = 16 * np.finfo(np.float64).eps
# cross products and incircle determinants up to this are taken as 0, in polygons scaled to the extent 1; chosen
_COCIRCULAR_TOLERANCE = 1e-12
_MAX_OVERLAP_SHARE = 1e-9  # share of a polygon's area that may be covered twice; chosen above rounding


@dataclass(frozen=True, eq=False, repr=False)
class Polygons:
    """Triangles, quads and other polygons, in the order of a file.

    Parameters
    ----------
    corners : (c,) array_like of int
        Point of each corner, from 0, of all polygons one after another.
    sizes : (p,) array_like of int
        Number of corners of each polygon, at least 3.
    points : (n, 3) array of float, optional
        Positions for cutting concave polygons; an `Asset` gives its own. Without them, all polygons are
        cut as if they were convex.

    Raises
    ------
    MeshError
        If the sizes do not fit the corners.

    Examples
    --------
    >>> Polygons([0, 1, 2, 3, 3, 2, 4], [4, 3]).triangles.tolist()
    [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    >>> arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]])
    >>> Polygons([0, 1, 2, 3], [4], arrow).triangles.tolist()
    [[0, 1, 3], [1, 2, 3]]
    """

    corners: IntArray
    sizes: IntArray
    points: FloatArray | None

    def __init__(self, corners: ArrayLike, sizes: ArrayLike, points: FloatArray | None = None) -> None:
        if points is not None:
            points = read_only(np.ascontiguousarray(points, dtype=np.float64))
        object.__setattr__(self, "points", points)
        for name, values in (("corners", corners), ("sizes", sizes)):
            array = array_of(values, name, MeshError)
            if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
                found = f"shape {array.shape} and type {array.dtype}"
                raise MeshError(f"{name} have {found}, expected (k,) integers")
            object.__setattr__(self, name, read_only(np.array(array, dtype=np.int64)))
        if (self.sizes < 3).any() or self.sizes.sum() != len(self.corners):
            found = f"at least {self.sizes.min(initial=3)} and together {self.sizes.sum()}"
            remedy = "give the number of corners of each, at least 3"
            raise MeshError(f"sizes of polygons, {found}, do not fit {len(self.corners)} corners; {remedy}")

    @classmethod
    def of_triangles(cls, faces: IntArray) -> Polygons:
        """Make polygons of (m, 3) triangles, or of (m, k) polygons of k corners each."""
        return cls(faces.ravel(), np.full(len(faces), faces.shape[1]))

    def __len__(self) -> int:
        return len(self.sizes)

    @cached_property
    def _cut(self) -> tuple[IntArray, IntArray, IntArray]:
        """The rows of `corner_of_triangle` that are no fans, their triangles, and `uncut`."""
        rows, triangles, left = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3), dtype=np.int64)], list[int]()
        for polygon, places, flat, rounding in self._concave():
            start, size = int(self.starts[polygon]), len(flat)
            first = int(np.lexsort(places.T)[0])  # always the same corner, wherever the polygon begins
            ears = _cut_ears(np.roll(flat, -first, axis=0), rounding)
            if ears is None:
                left.append(polygon)
            else:
                ears = (ears + first) % size
                ears = np.take_along_axis(ears, (ears.argmin(axis=1)[:, None] + range(3)) % 3, axis=1)
                rows.append(np.arange(size - 2) + start - 2 * polygon)
                triangles.append(start + ears[np.lexsort(ears.T[::-1])])
        return np.concatenate(rows), np.concatenate(triangles), np.array(left, dtype=np.int64)

    def _concave(self) -> list[tuple[int, FloatArray, FloatArray, float]]:
        """Find the concave polygons, with their corners in space, in their planes, (k, 2), and the rounding."""
        if self.points is None:
            return []
        sound = (self.corners >= 0) & (self.corners < len(self.points))
        sound[sound] = np.isfinite(self.points[self.corners[sound]]).all(axis=1)
        n_sound = np.add.reduceat(sound, self.starts) if len(self) else self.sizes
        found = []
        for size in np.unique(self.sizes[self.sizes > 3]).tolist():
            rows = np.flatnonzero((self.sizes == size) & (n_sound == size))
            places = self.points[self.corners[self.starts[rows, None] + np.arange(size)]]
            flat, rounding = _flatten(places)
            concave = np.flatnonzero(~_are_convex(flat, rounding)).tolist()
            found += [(int(rows[i]), places[i], flat[i], float(rounding[i])) for i in concave]
        return sorted(found, key=lambda polygon: polygon[0])

    @cached_property
    def corner_of_triangle(self) -> IntArray:
        """(m, 3) corners of each triangle; convex polygons are cut into fans."""
        rows, ears, _ = self._cut
        second = spans(self.starts + 1, self.sizes - 2)
        first = np.repeat(self.starts, self.sizes - 2)
        triangles = np.stack([first, second, second + 1], axis=1)
        triangles[rows] = ears
        return triangles

    @property
    def uncut(self) -> IntArray:
        """Concave polygons that are cut into fans, because their outline crosses itself or has no area."""
        return self._cut[2]

    @property
    def triangles(self) -> IntArray:
        """(m, 3) points of each triangle."""
        if (self.sizes == 3).all():
            return self.corners.reshape(-1, 3)
        return self.corners[self.corner_of_triangle]

    def at(self, points: FloatArray) -> Polygons:
        """Cut the polygons at these points, unless they have points already."""
        if self.points is not None or (self.sizes == 3).all():
            return self
        return Polygons(self.corners, self.sizes, points)

    def between(self, corners: IntArray) -> Polygons:
        """Replace the numbers of the corners, and cut the polygons in the same way."""
        polygons = Polygons(corners, self.sizes, self.points)
        polygons.__dict__["_cut"] = self._cut  # the cut refers to corners, whose order is the same
        return polygons

    @cached_property
    def starts(self) -> IntArray:
        """(p,) the first corner of each polygon."""
        return np.cumsum(self.sizes) - self.sizes

    @property
    def of_triangle(self) -> IntArray:
        """(m,) the polygon of each triangle."""
        return np.repeat(np.arange(len(self)), self.sizes - 2)

    def from_triangles(self, values: IntArray) -> IntArray:
        """Return the value of the last triangle of each polygon, (p,), of values of all triangles, (m,)."""
        return values[np.cumsum(self.sizes - 2) - 1]

    @property
    def of_corner(self) -> IntArray:
        """(c,) the polygon of each corner."""
        return np.repeat(np.arange(len(self)), self.sizes)


def triangles_of_strips(corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Return the triangles (m, 3) of strips, every second one turned over, and the strip (m,) of each."""
    counts = np.maximum(sizes - 2, 0)
    first = spans(np.cumsum(sizes) - sizes, counts)
    triangles = corners[first[:, None] + np.arange(3)]
    is_odd = spans(np.zeros(len(counts), dtype=np.int64), counts) % 2 == 1
    triangles[is_odd] = triangles[is_odd][:, [1, 0, 2]]
    return triangles, np.repeat(np.arange(len(sizes)), counts)


def spans(starts: IntArray, counts: IntArray) -> IntArray:
    """Concatenate the ranges start, start + 1, … of the given lengths."""
    before = np.cumsum(counts) - counts
    return np.repeat(starts - before, counts) + np.arange(counts.sum(), dtype=np.int64)


def _flatten(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Scale polygons to extent 1, project them, (p, k, 2), so that they turn left; return also the rounding."""
    scale = np.abs(points).max(axis=(1, 2), keepdims=True)
    points = points / np.where(scale > 0, scale, 1)
    points = points - points[:, :1]
    extent = np.abs(points).max(axis=(1, 2), keepdims=True)
    extent[extent == 0] = 1
    points = points / extent
    normal = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)  # twice the vector area (Newell)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1)
    right = np.cross(np.eye(3)[np.abs(normal).argmin(axis=1)], normal)
    right = right / np.where(length > 0, np.linalg.norm(right, axis=1, keepdims=True), 1)
    up = np.cross(normal, right)
    flat = np.stack([(points * axis[:, None]).sum(axis=2) for axis in (right, up)], axis=2)
    return flat, _CORNER_ROUNDING / extent[:, 0, 0]


def _are_convex(flat: FloatArray, rounding: FloatArray) -> BoolArray:
    """Whether outlines (p, k, 2) turn left at every corner, and once around: (p,)."""
    after = np.roll(flat, -1, axis=1) - flat
    before, size = after.copy(), flat.shape[1]
    for i in range(-size, 2 * size):  # ``before`` becomes the last edge of nonzero length before each corner
        corner, previous = i % size, (i - 1) % size
        no_edge = np.abs(after[:, previous]).max(axis=1) <= rounding
        before[:, corner] = np.where(no_edge[:, None], before[:, previous], after[:, previous])
    turn = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
    turn[np.abs(after).max(axis=2) <= rounding[:, None]] = 0
    around = np.arctan2(np.maximum(turn, 0), (before * after).sum(axis=2)).sum(axis=1)
    tolerance = rounding[:, None] * (np.abs(before) + np.abs(after)).sum(axis=2)
    return np.asarray((turn >= -tolerance).all(axis=1) & (around < 3 * np.pi) & (_area(flat) > rounding))


def _area(flat: FloatArray) -> FloatArray:
    """Compute twice the signed area of outlines (…, k, 2), positive if they turn left."""
    after = np.roll(flat, -1, axis=-2)
    return np.asarray((flat[..., 0] * after[..., 1] - flat[..., 1] * after[..., 0]).sum(axis=-1))


def _cut_ears(flat: FloatArray, rounding: float) -> IntArray | None:
    """Cut a polygon into triangles, (k - 2, 3) corners; None if they do not cover its outline once."""
    n, area = len(flat), _area(flat)
    if area <= rounding:
        return None
    cut = triangulate_float64(flat.astype(np.float64), np.array([n], np.uint32)).reshape(-1, 3).tolist()
    triangles = np.array(_insert_corners(cut, n)).reshape(-1, 3)
    parts = _area(flat[triangles])
    if len(triangles) != n - 2 or np.abs(parts).sum() > (1 + _MAX_OVERLAP_SHARE) * area:
        return None
    return _flip_to_delaunay(flat, triangles if parts.sum() > 0 else triangles[:, ::-1])


def _flip_to_delaunay(flat: FloatArray, triangles: IntArray) -> IntArray:
    """Flip inner edges until no circumcircle contains the corner across an edge (Lawson 1977)."""
    # Long triangles, as earcut makes, mislead fast marching: in an L-shaped prism, a distance of 4.47
    # becomes 5.32.
    faces = triangles.tolist()
    for _ in range(4 * len(faces)):  # a bound on the rounds, as rounding could flip an edge again and again
        across = {(face[i - 2], face[i - 1]): (t, face[i]) for t, face in enumerate(faces) for i in range(3)}
        flipped: set[int] = set()
        for (b, c), (t, a) in across.items():
            u, d = across.get((c, b), (t, a))
            if u != t and not flipped & {t, u} and _is_better(*(flat[[b, c, d]] - flat[a]).tolist()):
                faces[t], faces[u] = [a, b, d], [a, d, c]
                flipped |= {t, u}
        if not flipped:
            break
    return np.array(faces)


def _is_better(b: list[float], c: list[float], d: list[float]) -> bool:
    """Whether d is in the circumcircle of (0, b, c), with b and c on different sides of the line 0 d."""

    def cross(p: list[float], q: list[float]) -> float:
        return p[0] * q[1] - p[1] * q[0]

    b2, c2, d2 = (p[0] ** 2 + p[1] ** 2 for p in (b, c, d))
    inside = b2 * cross(c, d) - c2 * cross(b, d) + d2 * cross(b, c)
    return min(cross(b, d), cross(d, c)) > _COCIRCULAR_TOLERANCE and inside < -_COCIRCULAR_TOLERANCE


def _insert_corners(triangles: list[list[int]], n: int) -> list[list[int]]:
    """Insert the corners on straight lines that earcut leaves out; each splits a triangle."""
    used = sorted({used_corner for triangle in triangles for used_corner in triangle})
    for a, b in zip(used, [*used[1:], *(used[:1] and [used[0] + n])]):
        for between in range(a + 1, b):
            ends = {(between - 1) % n, b % n}
            for i, triangle in enumerate(triangles):
                if ends <= set(triangle):
                    triangles[i] = [between % n if corner == b % n else corner for corner in triangle]
                    last = (between - 1) % n
                    triangles.append([between % n if corner == last else corner for corner in triangle])
                    break
    return triangles


@dataclass(frozen=True, eq=False)
class Renumbering:
    """Old numbers of the points, corners and polygons of a new asset.

    ``point_index`` (n_new,) is the old point of each new one, ``new_point`` (n_old,) the new point of
    each old one or −1; ``polygon_index`` and ``corner_index`` are those of the new ``polygons``.
    """

    point_index: IntArray
    new_point: IntArray
    polygons: Polygons
    polygon_index: IntArray
    corner_index: IntArray

    @classmethod
    def of(
        cls,
        polygons: Polygons,
        point_index: IntArray,
        new_point: IntArray,
        kept: IntArray,
        turned: BoolArray,
        faces: IntArray,
    ) -> Renumbering:
        """Renumber polygons, given the triangles that are kept, those turned over, and their new points.

        A polygon stays one if all its triangles are kept and meet at the same new points; otherwise it
        becomes triangles.
        """
        owner = polygons.of_triangle[kept]
        n_kept, n_turned = (np.bincount(rows, minlength=len(polygons)) for rows in (owner, owner[turned]))
        triangles = polygons.corner_of_triangle[kept]
        triangles[turned] = triangles[turned][:, [0, 2, 1]]
        point = np.zeros(len(polygons.corners), dtype=np.int64)
        point[triangles] = faces
        n_torn = np.bincount(owner, (point[triangles] != faces).any(axis=1), len(polygons))
        whole = (n_kept == polygons.sizes - 2) & ((n_turned == 0) | (n_turned == n_kept)) & (n_torn == 0)
        alone = ~whole[owner]
        triangles, new_corners = triangles[alone], faces[alone]
        of_whole, sizes = np.flatnonzero(whole), polygons.sizes[whole]
        offset = spans(np.zeros(len(sizes), dtype=np.int64), sizes)
        backwards = np.repeat((n_turned > 0)[whole], sizes)
        offset = np.where(backwards, -offset % np.repeat(sizes, sizes), offset)
        of_whole_corners = np.repeat(polygons.starts[whole], sizes) + offset
        corners = np.concatenate([of_whole_corners, triangles.ravel()])
        points = np.concatenate([point[of_whole_corners], new_corners.ravel()])
        index = np.concatenate([of_whole, owner[alone]])
        sizes = np.concatenate([sizes, np.full(len(triangles), 3)])
        order = np.argsort(index, kind="stable")
        rows = spans((np.cumsum(sizes) - sizes)[order], sizes[order])
        made = Polygons(points[rows], sizes[order])
        return cls(point_index, new_point, made, index[order], corners[rows])


@dataclass(frozen=True)
class Split:
    """Points with one value of each attribute, so that no attribute is of corners."""

    source: IntArray  # (n_new,) the old point of each new one, increasing
    corners: IntArray  # (c,) the new point of each corner
    attributes: tuple[Attribute, ...]


def split_at_seams(polygons: Polygons, n_points: int, attributes: Sequence[Attribute]) -> Split:
    """Move the values of corners to points; a point is split if its corners differ."""
    corners = polygons.corners
    of_corners = [a for a in attributes if a.domain == "corner"]
    if not of_corners:
        return Split(np.arange(n_points), corners, tuple(attributes))
    kept, place = weld_points(np.column_stack([corners, *(_codes(a.values) for a in of_corners)]))
    unused = np.ones(n_points, dtype=bool)
    unused[corners] = False
    source = np.concatenate([corners[kept], np.flatnonzero(unused)])
    order = np.argsort(source, kind="stable")
    corner = np.append(kept, np.zeros(unused.sum(), dtype=np.int64))
    made = []
    for attribute in attributes:
        if attribute.domain == "corner":
            made.append(_blank_rows(attribute.at(corner[order], "point"), unused[source[order]]))
        else:
            made.append(attribute.at(source[order]) if attribute.domain == "point" else attribute)
    return Split(source[order], np.argsort(order, kind="stable")[place], tuple(made))


def merge_corners(polygons: Polygons, n_points: int, attribute: Attribute) -> Attribute | None:
    """Move an attribute from corners to points; None if the corners of a point differ."""
    if not len(attribute):
        return None
    split = split_at_seams(polygons, n_points, [attribute])
    return split.attributes[0] if len(split.source) == n_points else None


def _blank_rows(attribute: Attribute, rows: BoolArray) -> Attribute:
    """Blank some rows: with nan, −1 or an empty text, or with 0 in kinds without such a value."""
    if attribute.kind == "label":
        return replace(attribute, values=without_labels(attribute.values, rows))
    values = np.array(attribute.values)
    may_be_nan = values.dtype.kind == "f" and attribute.kind not in ("colour", "weights")
    values[rows] = np.nan if may_be_nan else 0
    return replace(attribute, values=values)


def _codes(values: AnyArray) -> IntArray:
    """Assign a number to each row, equal rows alike; nan equals nan here."""
    if values.dtype.kind == "U":
        return np.unique(values, return_inverse=True)[1]
    table = values.reshape(len(values), -1).astype(np.float64)
    return first_equal(np.where(np.isnan(table), np.finfo(np.float64).max, table))
