"""`Landmarks`: named points of one shape, of two, and of several templates; and curves through some of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from isomatch._core.arrays import BoolArray, FloatArray, IntArray, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import LandmarkError
from isomatch._core.skipped import tell_skipped
from isomatch.correspondence import geometric_median
from isomatch.io import TURN, Asset, Axes, Frame, SurfaceLike, read_asset, surface_from
from isomatch.landmarks.curves import respaced_curve
from isomatch.landmarks.landmark_files import (
    PAIRS,
    POINTS,
    MarkedPoint,
    marked_pairs,
    placed_positions,
)
from isomatch.landmarks.specimen_files import specimen_points
from isomatch.surfaces import Graph, Mesh, PointCloud, nearest_on_surface

COMMON = 0.5  # share of a template's expected error that all have in common; measured with 3, 6, 19


class Curve(NamedTuple):
    """Landmarks that follow each other along a curve.

    Parameters
    ----------
    name : str
    rows : tuple of int
        The landmarks, from its beginning to its end, each once.
    closed : bool
        Whether it goes on from the last one to the first.
    """

    name: str
    rows: tuple[int, ...]
    closed: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Landmarks:
    """Named points of one shape.

    Parameters
    ----------
    positions : (m, 3) or (m, 2) array_like of float
        In the coordinates of the surface, or in the plane; nan where a landmark has no place.
    names : sequence of str
        Their names; empty where there is none.
    curves : sequence of Curve
        Curves through some of them. They may share landmarks, as `read_specimens` gives them; of one shape, each goes
        through its own, and a landmark where two meet is given twice, as in files of 3D Slicer.
    expected_error : (m,) array_like of float, optional
        Estimate of the error of each, in the units of the surface; by default unknown, nan.
    spread : (m,) array_like of float, optional
        Mean distance of the points that several templates give from the one returned; nan of one template.
    axes : {"RAS", "LPS"}, optional
        Where x, y and z of the coordinates point; None where neither the surface nor the landmarks say that.
    unit : str
        Unit of the coordinates, as a file of 3D Slicer says it; empty if none does.

    Raises
    ------
    LandmarkError
        If the arrays do not fit, or a curve goes through others, or through one twice.

    Examples
    --------
    >>> marks = Landmarks([[0, 0, 0], [1, 0, 0]], ["nose", "tail"])
    >>> marks, marks["tail"].tolist()
    (Landmarks(2 points, 0 curves), [1.0, 0.0, 0.0])
    """

    positions: FloatArray
    names: tuple[str, ...]
    curves: tuple[Curve, ...]
    expected_error: FloatArray
    spread: FloatArray
    axes: Axes | None
    unit: str

    def __init__(
        self,
        positions: ArrayLike,
        names: Sequence[str] | None = None,
        curves: Sequence[Curve] = (),
        expected_error: ArrayLike | None = None,
        spread: ArrayLike | None = None,
        axes: Axes | None = None,
        unit: str = "",
    ) -> None:
        placed = numbers_of(positions, "landmarks", LandmarkError)
        placed = placed if placed.ndim == 2 and placed.shape[1] == 2 else placed.reshape(-1, 3)
        m = len(placed)
        names = ("",) * m if names is None else tuple(names)
        given = (np.full(m, np.nan) if each is None else each for each in (expected_error, spread))
        errors, spreads = (np.asarray(each, dtype=np.float64) for each in given)
        if len(names) != m or errors.shape != (m,) or spreads.shape != (m,):
            raise LandmarkError(
                f"{m} landmarks with {len(names)} names, {errors.size} expected errors and {spreads.size} spreads; give "
                "one for each"
            )
        curves = tuple(Curve(name, tuple(rows), closed) for name, rows, closed in curves)
        _check_curves(curves, m)
        fields = {"positions": placed, "names": names, "curves": curves, "expected_error": errors}
        for field, value in {**fields, "spread": spreads, "axes": axes, "unit": unit}.items():
            object.__setattr__(self, field, value)

    def __repr__(self) -> str:
        return f"Landmarks({len(self)} points, {len(self.curves)} curves)"

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> FloatArray:
        """Position (3,) of the first landmark of a name."""
        if name not in self.names:
            raise LandmarkError(f"no landmark {name!r}; there are {', '.join(self.names)[:200]}")
        return np.asarray(self.positions[self.names.index(name)])

    @cached_property
    def placed(self) -> BoolArray:
        """(m,) which landmarks have a place."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))

    def turned(self, axes: Axes | None) -> Landmarks:
        """Return the same in coordinates with these axes; unchanged where either is unknown."""
        positions = self.positions * (1 if None in (axes, self.axes) or axes == self.axes else TURN)
        return replace(self, positions=positions, axes=axes or self.axes)

    def apart(self) -> Landmarks:
        """Return the same with curves that go through landmarks of their own, in order, as in a file of one shape."""
        of = [row for curve in self.curves for row in curve.rows]
        if len(of) == len({*of}) and all([*curve.rows] == sorted(curve.rows) for curve in self.curves):
            return self
        rows = [row for row in range(len(self)) if row not in {*of}] + of
        ends = np.cumsum([len(rows) - len(of), *(len(curve.rows) for curve in self.curves)])
        curves = [
            Curve(c.name, tuple(range(a, b)), c.closed)
            for c, a, b in zip(self.curves, ends.tolist(), ends[1:].tolist())
        ]
        values = self.positions[rows], [self.names[row] for row in rows], curves
        return Landmarks(*values, self.expected_error[rows], self.spread[rows], self.axes, self.unit)

    @property
    def curve_of(self) -> list[Curve | None]:
        """The curve that each landmark is on."""
        of = {row: curve for curve in self.curves for row in curve.rows}
        return [of.get(row) for row in range(len(self))]

    @property
    def patch(self) -> list[int]:
        """Those that may lie anywhere on the surface, by their names: surface-1, surface-2 and so on."""
        return [row for row, name in enumerate(self.names) if re.fullmatch(r"surface-\d+", name)]

    @property
    def semilandmarks(self) -> list[int]:
        """Those on curves, and those of the patch."""
        return sorted({*self.patch, *(row for curve in self.curves for row in curve.rows)})

    def with_patch(self, positions: FloatArray) -> Landmarks:
        """Append points that may lie anywhere on the surface."""
        names = *self.names, *(f"surface-{i}" for i, _ in enumerate(positions, len(self.patch) + 1))
        return Landmarks([*self.positions, *positions], names, self.curves, None, None, self.axes, self.unit)

    @classmethod
    def read(cls, path: str | PathLike[str], surface: SurfaceLike | None = None) -> Landmarks:
        r"""Read landmarks of a surface.

        Parameters
        ----------
        path : path
            ``.mrk.json`` or ``.fcsv`` of 3D Slicer, ``.pp`` of MeshLab, ``.pts`` of Landmark Editor, ``.label`` of
            FreeSurfer, ``.tps`` of one specimen; text with an index or a position on each line, or a table with ``x``,
            ``y``, ``z`` or ``vertex``, and perhaps ``name``, ``curve`` and ``closed``. Points that are nan, 9999, "-" or
            empty have no place.
        surface : Asset, or what `surface_from` takes, optional
            The surface; an asset or a file may say its space. Without one, positions of 3D Slicer are in LPS, others as
            they are.

        Raises
        ------
        FormatError
            If a file cannot be read.
        LandmarkError
            If there are none, one is farther than 0.1 √area from the surface, or a vertex of a surface that is not given.

        Examples
        --------
        >>> import tempfile
        >>> from isomatch import Mesh
        >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "landmarks.csv"
        ...     _ = file.write_text("name,x,y,z\nnose,0.5,0.2,0\n")
        ...     Landmarks.read(file, square).names
        ('nose',)
        """
        points, dim = specimen_points(Path(path))
        if not points:
            raise LandmarkError(f"{path}: no landmarks; {POINTS}")
        if surface is None:
            return landmarks_of(points, dim)
        if dim != 3:
            raise LandmarkError(
                f"{path}: has landmarks in the plane; those of a surface have three coordinates"
            )
        names = [point.name for point in points]
        given, frame = with_frame(surface)
        shape = _with_positions(given)

        def distance(positions: FloatArray) -> FloatArray:
            nearest = nearest_on_surface(shape, positions).interpolated(shape.vertices)
            return np.asarray(np.linalg.norm(nearest - positions, axis=1))

        unit = float(np.sqrt(shape.area))
        positions, axes = placed_positions(points, shape.vertices, unit, distance, frame, "surface", "points")
        return cls(positions, names, _curves(points), axes=axes, unit=points[0].unit)


def with_frame(given: Asset | SurfaceLike) -> tuple[SurfaceLike, Frame | None]:
    """Return the surface that is given, with the points of its file, and the frame of its coordinates, if any."""
    if isinstance(given, str | PathLike):
        given = read_asset(given)
    if not isinstance(given, Asset):
        return given, None
    mesh = Mesh(given.placed_points, given.polygons.triangles)
    return mesh if mesh.n_faces else PointCloud(mesh.vertices), given.frame


def _with_positions(surface: SurfaceLike) -> Mesh | PointCloud:
    shape = surface_from(surface)
    if isinstance(shape, Graph):
        raise LandmarkError("landmarks have positions, and a graph has none; give a mesh or points")
    return shape


def landmarks_of(points: Sequence[MarkedPoint], dim: int = 3) -> Landmarks:
    """Take points of a file as landmarks; positions of 3D Slicer are in LPS."""
    axes: Axes | None = "LPS" if any(point.axes for point in points) else None
    names = [point.name for point in points]
    return Landmarks(_positions(points, dim), names, _curves(points), axes=axes, unit=points[0].unit)


def _positions(points: Sequence[MarkedPoint], dim: int) -> FloatArray:
    """Return the positions (m, dim) that a file has, nan where there is none."""
    at = [point.at or (np.nan,) * dim for point in points]
    vertex = next((point for point, place in zip(points, at) if len(place) == 1), None)
    if vertex:
        raise LandmarkError(f"{vertex.where}: a vertex says nothing without its surface; give positions")
    return np.array(at)


def _check_curves(curves: Sequence[Curve], m: int) -> None:
    for name, rows, _ in curves:
        if len(rows) != len({*rows}.intersection(range(m))):
            shown = str(rows)[:80]
            raise LandmarkError(
                f"curve {name!r} goes through landmarks {shown}; give some of 0 to {m - 1}, each once"
            )


def _curves(points: Sequence[MarkedPoint]) -> list[Curve]:
    rows: dict[str, list[int]] = {}
    for i, point in enumerate(points):
        if point.curve:
            rows.setdefault(point.curve, []).append(i)
    return [Curve(name, tuple(of), points[of[0]].closed) for name, of in rows.items()]


def read_landmarks(
    path: str | PathLike[str],
    source: SurfaceLike,
    target: SurfaceLike,
    target_path: str | PathLike[str] | None = None,
) -> IntArray:
    r"""Read landmarks from a file of pairs, or from one file of points for each shape.

    Parameters
    ----------
    path : path
        Pairs as text: two vertex indices on each line, or two positions, separated by commas or blanks; or a table whose
        header has the columns ``source`` and ``target``, or ``source_x`` … ``target_z``. With ``target_path``, points
        marked on the source.
    source, target : Asset, or what `surface_from` takes
        The shapes.
    target_path : path, optional
        Points marked on the target. Points of the two files are joined by name if they share any, otherwise in order.
        They may be files of 3D Slicer (``.mrk.json``, ``.fcsv``), of MeshLab (``.pp``), ``.tps``, or text: one index or
        position on each line, or a table whose header has ``x``, ``y``, ``z`` or ``vertex``, and ``name`` if there are
        names.

    Returns
    -------
    (m, 2) array of int
        Rows (source vertex, target vertex).

    Raises
    ------
    FormatError
        If a file cannot be read.
    LandmarkError
        If there are none, or a position is farther than 0.1 √area from all vertices.

    Notes
    -----
    A position stands for the nearest vertex. Positions of 3D Slicer are brought into the space that the file of the
    shape says. Where it says none, they are taken in LPS, in which 3D Slicer writes meshes, or in RAS if they fit better.

    Examples
    --------
    >>> import tempfile
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "landmarks.csv"
    ...     _ = file.write_text("name,source,target\nnose,0,2\ntail,3,1\n")
    ...     read_landmarks(file, square, square)
    array([[0, 2],
           [3, 1]])
    """
    first = Path(path)
    if target_path is None:
        pairs = marked_pairs(first)
        here, there = [a for a, _ in pairs], [b for _, b in pairs]
    else:
        files = map(Path, (path, target_path))
        here, there = map(_placed_points, files)
        here, there = _joined(here, there, f"{first} and {target_path}")
    if not here:
        raise LandmarkError(f"{first}: no landmarks; {PAIRS if target_path is None else POINTS}")
    return np.column_stack([_vertices(here, source, "source"), _vertices(there, target, "target")])


def _placed_points(path: Path) -> list[MarkedPoint]:
    """Read the points of a file that have a place, and tell of the others."""
    points = specimen_points(path)[0]
    if lost := [point.name or point.where for point in points if not point.at]:
        tell_skipped(f"{path}: without a place, so left out: {', '.join(lost)}")
    return [point for point in points if point.at]


def nearest_landmarks(
    source: SurfaceLike, target: SurfaceLike, source_points: ArrayLike, target_points: ArrayLike
) -> IntArray:
    """Take the vertices nearest to positions as landmarks.

    Parameters
    ----------
    source, target : Mesh, PointCloud, path_like, tuple or object
        The shapes, as for `match`.
    source_points, target_points : (m, 3) array_likes
        Positions in the coordinates of each shape.

    Returns
    -------
    (m, 2) array of int
        Rows (source vertex, target vertex).

    Raises
    ------
    LandmarkError
        If the positions do not fit, or one is farther than 0.1 √area from all vertices.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> nearest_landmarks(square, square, [[0.01, 0, 0]], [[1, 1.01, 0]])
    array([[0, 2]])
    """
    sides = []
    for side, points in (("source", source_points), ("target", target_points)):
        positions = numbers_of(points, f"{side} landmarks", LandmarkError)
        if positions.ndim != 2 or positions.shape[1] != 3:
            raise LandmarkError(f"{side} landmarks have shape {positions.shape}; expected (m, 3) positions")
        if not np.isfinite(positions).all():
            first = int(np.argmin(np.isfinite(positions).all(axis=1)))
            raise LandmarkError(
                f"{side} landmark {first} is not finite; give a position for each, or leave out the pair"
            )
        rows = enumerate(positions.tolist())
        sides.append([MarkedPoint("", tuple(row), f"landmark {i}") for i, row in rows])
    if len(sides[0]) != len(sides[1]):
        raise LandmarkError(f"{len(sides[0])} source and {len(sides[1])} target landmarks; give as many")
    return np.column_stack([_vertices(sides[0], source, "source"), _vertices(sides[1], target, "target")])


def _vertices(points: list[MarkedPoint], surface: SurfaceLike, side: str) -> IntArray:
    """Vertex (m,) of each point: the nearest one to a position."""
    placed = [i for i, point in enumerate(points) if len(point.at) == 3]
    vertices = np.array([int(point.at[0]) if len(point.at) == 1 else -1 for point in points], dtype=np.int64)
    if not placed:
        return vertices
    given, frame = with_frame(surface)
    surface = surface_from(given)
    if isinstance(surface, Graph):
        raise LandmarkError(f"the {side} is a graph, without positions; give vertex indices as landmarks")
    tree = cKDTree(surface.vertices)
    marked, unit = [points[i] for i in placed], np.sqrt(surface.area)
    positions, _ = placed_positions(
        marked, surface.vertices, unit, lambda x: np.asarray(tree.query(x)[0]), frame, side, "vertices"
    )
    vertices[placed] = tree.query(positions)[1]
    return vertices


def _joined(
    here: list[MarkedPoint], there: list[MarkedPoint], files: str
) -> tuple[list[MarkedPoint], list[MarkedPoint]]:
    """Join points by name, if any name is shared, or else in order."""
    named = [{point.name: point for point in points if point.name} for points in (here, there)]
    shared = [name for name in named[0] if name in named[1]]
    if not shared:
        if len(here) != len(there):
            raise LandmarkError(
                f"{files}: {len(here)} and {len(there)} points that share no names; give as many in the same order, or "
                "equal names to those that belong together"
            )
        return here, there
    for points, by_name in zip((here, there), named):
        if len(by_name) < len(points):
            raise LandmarkError(
                f"{files}: several points have one name, or none; give each a name of its own"
            )
    alone = len(here) + len(there) - 2 * len(shared)
    if alone:
        names = ", ".join(sorted(named[0].keys() ^ named[1].keys()))
        tell_skipped(f"{files}: {alone} points without a partner of their name are left out: {names}")
    return [named[0][name] for name in shared], [named[1][name] for name in shared]


def median_landmarks(several: Sequence[Landmarks], surface: SurfaceLike) -> Landmarks:
    """Join the landmarks that several templates give for one shape.

    Parameters
    ----------
    several : sequence of Landmarks
        Of one shape, such as `carry_landmarks` returns for each template. They are joined by name, or in order if all
        have the same names.
    surface : Mesh, PointCloud, path_like, tuple or object
        The shape.

    Returns
    -------
    Landmarks
        The geometric medians, moved to the nearest points of the surface, in the order of the first template; points of a
        curve are equally spaced again. ``spread`` is the mean distance of the given points from them, nan of one.
        ``expected_error`` is the root of e² / 4 + spread² / t, where e is the median of those given by t templates; of
        one template it is e.

    Raises
    ------
    LandmarkError
        If there are none, or the names do not tell which belong together.

    Notes
    -----
    The geometric median minimises the sum of distances (Weiszfeld 1937), so that one wrong template in three moves a
    point little. Zhang et al., *Automated landmarking via multiple templates*, PLOS ONE 2022, use medians likewise. What
    templates do not have in common averages out; the other half of their error stays.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> several = [Landmarks([[1, 1, 0]]), Landmarks([[1, 1, 0]]), Landmarks([[4, 4, 0]])]
    >>> joined = median_landmarks(several, square)
    >>> joined.positions.round(6).tolist(), joined.spread.round(3).tolist()
    ([[1.0, 1.0, 0.0]], [1.414])
    """
    if not several:
        raise LandmarkError("no landmarks to join; give those of at least one template")
    shape, first = _with_positions(surface), several[0]
    rows = _rows_of(several)
    points = np.stack([_taken(each.positions, own) for each, own in zip(several, rows)])  # (t, m, 3)
    errors = np.stack([_taken(each.expected_error, own) for each, own in zip(several, rows)])
    positions = geometric_median(points)
    placed = np.asarray(np.isfinite(positions).all(axis=1))
    if placed.any():
        near = nearest_on_surface(shape, positions[placed])
        positions[placed] = near.interpolated(shape.vertices)
    for curve in first.curves:
        of = list(curve.rows)
        if placed[of].all() and len(of) > 1:
            positions[of] = respaced_curve(shape, positions[of], len(of), curve.closed, curve.name)
    # The error of a template is a part that all have in common, c e, and an own one. The own parts differ by the spread,
    # and the median of t of them has it over √t; so it is √((c e)² + spread² / t), c = ½.
    apart = np.linalg.norm(points - positions, axis=2)
    count = np.isfinite(apart).sum(axis=0)
    apart[:, count == 1] = np.nan  # one template has no spread
    spread, alone = _over_templates(np.mean, apart), _over_templates(np.median, errors)
    together = np.hypot(COMMON * alone, spread / np.sqrt(np.maximum(count, 1)))
    expected = np.where(count == 1, alone, together)
    return Landmarks(positions, first.names, first.curves, expected, spread, first.axes, first.unit)


def _rows_of(several: Sequence[Landmarks]) -> list[list[int | None]]:
    """For each template, which of its landmarks belongs to each of the first."""
    names = several[0].names
    if all(each.names == names for each in several):
        return [list(range(len(names))) for _ in several]
    rows = []
    for each in several:
        place = {name: i for i, name in enumerate(each.names)}
        if len(place) < len(each) or "" in place:
            raise LandmarkError(
                "templates with different landmarks, of which several have one name, or none; give each a name of its own"
            )
        if alone := set(names) ^ set(place):
            tell_skipped(f"not in all templates: {', '.join(sorted(alone))}")
        rows.append([place.get(name) for name in names])
    return rows


def _taken(values: FloatArray, rows: list[int | None]) -> FloatArray:
    padded = np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])
    return np.asarray(padded[[-1 if row is None else row for row in rows]])


def _over_templates(statistic: Callable[[FloatArray], Any], values: FloatArray) -> FloatArray:
    """Statistic over templates (t, m) of what is known; nan where nothing is."""
    columns = (column[np.isfinite(column)] for column in values.T)
    return np.array([statistic(column) if len(column) else np.nan for column in columns])
