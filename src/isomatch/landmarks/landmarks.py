"""`Landmarks`: named points of one shape, of two, or of several templates, and curves through them."""

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
from isomatch.landmarks.curves import respace_curve
from isomatch.landmarks.landmark_files import PAIRS, POINTS, MarkedPoint, marked_pairs, place_points
from isomatch.landmarks.specimen_files import specimen_points
from isomatch.surfaces import Graph, Mesh, PointCloud, nearest_on_surface

# part of a template's expected error that is the same with all templates; measured with 3, 6 and 19 templates
COMMON_ERROR_SHARE = 0.5


class Curve(NamedTuple):
    """Landmarks that follow each other along a curve.

    Parameters
    ----------
    name : str
    rows : tuple of int
        The landmarks, from its beginning to its end, each once.
    closed : bool
        Whether it returns from the last landmark to the first.
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
        Their names; empty if a landmark has none.
    curves : sequence of Curve
        Curves through some of them. Curves of `read_specimens` may share landmarks. In files of one
        shape, such as the files of 3D Slicer, a landmark where two curves meet is given twice.
    expected_error : (m,) array_like of float, optional
        Estimate of the error of each landmark, in the units of the surface; by default unknown,
        nan.
    spread : (m,) array_like of float, optional
        Mean distance of the points of several templates from their median; nan for one template.
    axes : {"RAS", "LPS"}, optional
        Directions of x, y and z; None if neither the surface nor the landmarks say them.
    unit : str
        Unit of the coordinates in a file of 3D Slicer; empty if unknown.

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
        points = numbers_of(positions, "landmarks", LandmarkError)
        points = points if points.ndim == 2 and points.shape[1] == 2 else points.reshape(-1, 3)
        m = len(points)
        names = ("",) * m if names is None else tuple(names)
        errors, spreads = (
            np.full(m, np.nan) if values is None else np.asarray(values, dtype=np.float64)
            for values in (expected_error, spread)
        )
        if len(names) != m or errors.shape != (m,) or spreads.shape != (m,):
            raise LandmarkError(
                f"{m} landmarks with {len(names)} names, {errors.size} expected errors and {spreads.size} spreads; give "
                "one for each"
            )
        curves = tuple(Curve(name, tuple(rows), closed) for name, rows, closed in curves)
        for name, rows, _ in curves:
            if len(rows) != len({*rows}.intersection(range(m))):
                raise LandmarkError(
                    f"curve {name!r} goes through landmarks {str(rows)[:80]}; give some of 0 to {m - 1}, each once"
                )
        fields = {"positions": points, "names": names, "curves": curves, "expected_error": errors}
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
        """(m,) whether each landmark has a place."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))

    def in_axes(self, axes: Axes | None) -> Landmarks:
        """Return the same in coordinates with these axes; unchanged if either is unknown."""
        positions = self.positions * (1 if None in (axes, self.axes) or axes == self.axes else TURN)
        return replace(self, positions=positions, axes=axes or self.axes)

    def with_separate_curves(self) -> Landmarks:
        """Return the same with curves that share no landmarks, in order, as in a file of one shape."""
        on_curves = [row for curve in self.curves for row in curve.rows]
        are_in_order = all([*curve.rows] == sorted(curve.rows) for curve in self.curves)
        if are_in_order and len(on_curves) == len({*on_curves}):
            return self
        rows, curves = [row for row in range(len(self)) if row not in {*on_curves}], []
        for name, members, closed in self.curves:
            curves.append(Curve(name, tuple(range(len(rows), len(rows) + len(members))), closed))
            rows += members
        values = self.positions[rows], [self.names[row] for row in rows], curves
        return Landmarks(*values, self.expected_error[rows], self.spread[rows], self.axes, self.unit)

    @property
    def curve_of(self) -> list[Curve | None]:
        """The curve that each landmark is on."""
        curves = {row: curve for curve in self.curves for row in curve.rows}
        return [curves.get(row) for row in range(len(self))]

    @property
    def patch(self) -> list[int]:
        """Landmarks that may lie anywhere on the surface, named surface-1, surface-2 and so on."""
        return [row for row, name in enumerate(self.names) if re.fullmatch(r"surface-\d+", name)]

    @property
    def semilandmarks(self) -> list[int]:
        """Landmarks on curves, and in the patch."""
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
            ``.mrk.json`` or ``.fcsv`` of 3D Slicer, ``.pp`` of MeshLab, ``.pts`` of Landmark
            Editor, ``.label`` of FreeSurfer, ``.tps`` of one specimen; text with an index or a
            position on each line, or a table with ``x``, ``y``, ``z`` or ``vertex``, and perhaps
            ``name``, ``curve`` and ``closed``. Points that are nan, 9999, "-" or empty have no
            place.
        surface : Asset, or what `surface_from` takes, optional
            The surface; an asset or a file may say its space. Without one, positions of 3D Slicer
            are in LPS, others as they are.

        Raises
        ------
        FormatError, LandmarkError
            If the file cannot be read or has no landmarks, one is farther than 0.1 √area from the
            surface, or it is a vertex and no surface is given.

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
            message = f"{path}: has landmarks in the plane; those of a surface have three coordinates"
            raise LandmarkError(message)
        surface, frame = with_frame(surface)
        shape = _shape_with_positions(surface)

        def distance(positions: FloatArray) -> FloatArray:
            nearest = nearest_on_surface(shape, positions).interpolated(shape.vertices)
            return np.asarray(np.linalg.norm(nearest - positions, axis=1))

        return _with_places(points, *place_points(points, shape, distance, frame, "surface", "points"))


def with_frame(surface: Asset | SurfaceLike) -> tuple[SurfaceLike, Frame | None]:
    """Return a surface with the points of its file, and the frame of its coordinates, if known."""
    if isinstance(surface, str | PathLike):
        surface = read_asset(surface)
    if not isinstance(surface, Asset):
        return surface, None
    mesh = Mesh(surface.placed_points, surface.polygons.triangles)
    return mesh if mesh.n_faces else PointCloud(mesh.vertices), surface.frame


def _shape_with_positions(surface: SurfaceLike) -> Mesh | PointCloud:
    shape = surface_from(surface)
    if isinstance(shape, Graph):
        raise LandmarkError("landmarks have positions, and a graph has none; give a mesh or points")
    return shape


def landmarks_of(points: Sequence[MarkedPoint], dim: int = 3) -> Landmarks:
    """Make landmarks with ``dim`` coordinates of the points of a file; positions of 3D Slicer are in LPS."""
    for point in points:
        if len(point.at) == 1:
            raise LandmarkError(f"{point.where}: a vertex says nothing without its surface; give positions")
    positions = np.array([point.at or (np.nan,) * dim for point in points])
    return _with_places(points, positions, "LPS" if any(point.axes for point in points) else None)


def _with_places(points: Sequence[MarkedPoint], positions: FloatArray, axes: Axes | None) -> Landmarks:
    """Make landmarks with the names and curves of the points of a file, given their positions."""
    rows: dict[str, list[int]] = {}
    for i, point in enumerate(points):
        if point.curve:
            rows.setdefault(point.curve, []).append(i)
    curves = [Curve(name, tuple(members), points[members[0]].closed) for name, members in rows.items()]
    return Landmarks(positions, [point.name for point in points], curves, axes=axes, unit=points[0].unit)


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
        Pairs as text: two vertex indices on each line, or two positions, separated by commas or
        blanks; or a table whose header has the columns ``source`` and ``target``, or ``source_x`` …
        ``target_z``. With ``target_path``, points marked on the source.
    source, target : Asset, or what `surface_from` takes
        The shapes.
    target_path : path, optional
        Points marked on the target. Points of the two files are joined by name if they share any,
        otherwise in order. They may be files of 3D Slicer (``.mrk.json``, ``.fcsv``), of MeshLab
        (``.pp``), ``.tps``, or text: one index or position on each line, or a table whose header
        has ``x``, ``y``, ``z`` or ``vertex``, and ``name`` if there are names.

    Returns
    -------
    (m, 2) array of int
        Rows (source vertex, target vertex).

    Raises
    ------
    FormatError, LandmarkError
        If a file cannot be read or has no landmarks, or one is farther than 0.1 √area from all vertices.

    Notes
    -----
    A position stands for the nearest vertex. Positions of 3D Slicer are brought into the space that
    the file of the shape says. If it says none, they are in LPS, in which 3D Slicer writes meshes,
    or in RAS if they fit better.

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
    path = Path(path)
    if target_path is None:
        pairs = marked_pairs(path)
    else:
        points = _placed_points(path), _placed_points(Path(target_path))
        pairs = _pair_points(*points, f"{path} and {target_path}")
    if not pairs:
        raise LandmarkError(f"{path}: no landmarks; {PAIRS if target_path is None else POINTS}")
    on_source, on_target = ([pair[side] for pair in pairs] for side in (0, 1))
    return np.column_stack([_vertices(on_source, source, "source"), _vertices(on_target, target, "target")])


def _placed_points(path: Path) -> list[MarkedPoint]:
    """Read the points of a file that have a place, and report the others."""
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
    rows = [i for i, point in enumerate(points) if len(point.at) == 3]
    vertices = np.array([int(point.at[0]) if len(point.at) == 1 else -1 for point in points], dtype=np.int64)
    if not rows:
        return vertices
    surface, frame = with_frame(surface)
    shape = surface_from(surface)
    if isinstance(shape, Graph):
        raise LandmarkError(f"the {side} is a graph, without positions; give vertex indices as landmarks")
    tree = cKDTree(shape.vertices)
    marked = [points[i] for i in rows]
    positions, _ = place_points(marked, shape, lambda x: tree.query(x)[0], frame, side, "vertices")
    vertices[rows] = tree.query(positions)[1]
    return vertices


def _pair_points(
    on_source: list[MarkedPoint], on_target: list[MarkedPoint], files: str
) -> list[tuple[MarkedPoint, MarkedPoint]]:
    """Pair points by name if they share any, otherwise in order."""
    sides = on_source, on_target
    by_name = [{point.name: point for point in points if point.name} for points in sides]
    shared = [name for name in by_name[0] if name in by_name[1]]
    if not shared:
        if len(on_source) != len(on_target):
            raise LandmarkError(
                f"{files}: {len(on_source)} and {len(on_target)} points that share no names; give as many in the "
                "same order, or equal names to those that belong together"
            )
        return list(zip(on_source, on_target))
    if any(len(names) < len(points) for names, points in zip(by_name, sides)):
        raise LandmarkError(f"{files}: several points have one name, or none; give each a name of its own")
    if unpaired := sorted(by_name[0].keys() ^ by_name[1].keys()):
        names = f"{len(unpaired)} points without a partner of their name are left out: {', '.join(unpaired)}"
        tell_skipped(f"{files}: {names}")
    return [(by_name[0][name], by_name[1][name]) for name in shared]


def median_landmarks(several: Sequence[Landmarks], surface: SurfaceLike) -> Landmarks:
    """Join the landmarks that several templates give for one shape.

    Parameters
    ----------
    several : sequence of Landmarks
        Landmarks of one shape, such as `carry_landmarks` returns for each template. They are joined
        by name, or in order if all have the same names.
    surface : Mesh, PointCloud, path_like, tuple or object
        The shape.

    Returns
    -------
    Landmarks
        The geometric medians, moved to the nearest points of the surface, in the order of the first
        template; points of a curve are equally spaced again. ``spread`` is the mean distance of the
        given points from the median, nan if there is one. ``expected_error`` is the root of e² / 4
        + spread² / t, where e is the median of the expected errors of t templates; for one template
        it is e.

    Raises
    ------
    LandmarkError
        If there are none, or the names do not tell which belong together.

    Notes
    -----
    The geometric median minimises the sum of distances (Weiszfeld 1937), so that one wrong template
    in three moves a point little. Zhang et al., *Automated landmarking via multiple templates*,
    PLOS ONE 2022, use medians likewise. The part of the error that templates do not share averages
    out; the other half stays.

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
    shape, first = _shape_with_positions(surface), several[0]
    rows = _rows_of(several)
    points = np.stack([_take(marks.positions, row) for marks, row in zip(several, rows)])  # (t, m, 3)
    errors = np.stack([_take(marks.expected_error, row) for marks, row in zip(several, rows)])
    positions = geometric_median(points)
    placed = np.asarray(np.isfinite(positions).all(axis=1))
    if placed.any():
        near = nearest_on_surface(shape, positions[placed])
        positions[placed] = near.interpolated(shape.vertices)
    for name, members, closed in first.curves:
        on_curve = list(members)
        if placed[on_curve].all() and len(on_curve) > 1:
            positions[on_curve] = respace_curve(shape, positions[on_curve], len(on_curve), closed, name)
    # Let e be the expected error of a template. All templates share an error c e, c = COMMON_ERROR_SHARE. The
    # rest differs from template to template by the spread, so the median of t templates has spread / √t of
    # it. Both together are √((c e)² + spread² / t).
    distance = np.linalg.norm(points - positions, axis=2)
    count = np.isfinite(distance).sum(axis=0)
    distance[:, count == 1] = np.nan  # one template has no spread
    spread, error = _over_templates(np.mean, distance), _over_templates(np.median, errors)
    shared = np.hypot(COMMON_ERROR_SHARE * error, spread / np.sqrt(np.maximum(count, 1)))
    expected = np.where(count == 1, error, shared)
    return Landmarks(positions, first.names, first.curves, expected, spread, first.axes, first.unit)


def _rows_of(several: Sequence[Landmarks]) -> list[list[int]]:
    """For each template, its landmark that belongs to each landmark of the first; −1 if it has none."""
    names = several[0].names
    if all(marks.names == names for marks in several):
        return [list(range(len(names))) for _ in several]
    rows = []
    for marks in several:
        row_of = {name: i for i, name in enumerate(marks.names)}
        if len(row_of) < len(marks) or "" in row_of:
            raise LandmarkError(
                "templates with different landmarks, of which several have one name, or none; give each a name of its own"
            )
        if missing := set(names) ^ set(row_of):
            tell_skipped(f"not in all templates: {', '.join(sorted(missing))}")
        rows.append([row_of.get(name, -1) for name in names])
    return rows


def _take(values: FloatArray, rows: list[int]) -> FloatArray:
    """Take rows of values; nan for −1."""
    return np.asarray(np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[rows])


def _over_templates(statistic: Callable[[FloatArray], Any], values: FloatArray) -> FloatArray:
    """Statistic of the known values over templates (t, m); nan if none is known."""
    columns = (column[np.isfinite(column)] for column in values.T)
    return np.array([statistic(column) if len(column) else np.nan for column in columns])
