"""`Landmarks`: named points of one shape in their order, the curves through some of them, and their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from isomatch.assets import SurfaceLike, surface_from
from isomatch.errors import LandmarkError
from isomatch.landmarks.landmark_files import POINTS, MarkedPoint, System, marked_points
from isomatch.landmarks.placing import nearest_on_surface, placed_positions
from isomatch.surfaces import Graph
from isomatch.values.arrays import BoolArray, FloatArray, numbers_of


class Curve(NamedTuple):
    """Landmarks that follow each other along a curve.

    Parameters
    ----------
    name : str
        Its name.
    rows : tuple of int
        The landmarks, from its beginning to its end, in ascending order.
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
    positions : (m, 3) array_like of float
        In the coordinates of the surface; nan where a landmark has no place.
    names : sequence of str
        Their names; empty where there is none.
    curves : sequence of Curve
        Curves through some of them, each through its own. One where two curves meet is given twice.
    expected_error : (m,) array_like of float, optional
        Estimate of the error of each, in the units of the surface; by default unknown, nan.
    spread : (m,) array_like of float, optional
        Mean distance of the points that several templates give from the one returned; nan of one template.
    systems : (str, str)
        "LPS" or "RAS": the coordinate system of the surface, and that of the file of 3D Slicer that they were read from,
        in which they are written again.

    Raises
    ------
    LandmarkError
        If the arrays do not fit, or the curves go through others, through one twice, or not in order.

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
    systems: tuple[System, System]

    def __init__(
        self,
        positions: ArrayLike,
        names: Sequence[str] | None = None,
        curves: Sequence[Curve] = (),
        expected_error: ArrayLike | None = None,
        spread: ArrayLike | None = None,
        systems: tuple[System, System] = ("LPS", "LPS"),
    ) -> None:
        placed = numbers_of(positions, "landmarks", LandmarkError).reshape(-1, 3)
        m = len(placed)
        names = ("",) * m if names is None else tuple(names)
        errors, spreads = (
            np.full(m, np.nan) if each is None else np.asarray(each, dtype=np.float64)
            for each in (expected_error, spread)
        )
        if len(names) != m or errors.shape != (m,) or spreads.shape != (m,):
            raise LandmarkError(
                f"{m} landmarks with {len(names)} names, {errors.size} expected errors and {spreads.size} spreads; give "
                "one for each"
            )
        curves = tuple(Curve(name, tuple(rows), closed) for name, rows, closed in curves)
        _check_curves(curves, m)
        for field, value in (
            ("positions", placed),
            ("names", names),
            ("curves", curves),
            ("expected_error", errors),
            ("spread", spreads),
            ("systems", systems),
        ):
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

    @property
    def placed(self) -> BoolArray:
        """(m,) which landmarks have a place."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))

    @property
    def curve_of(self) -> list[Curve | None]:
        """The curve that each landmark is on."""
        of = {row: curve for curve in self.curves for row in curve.rows}
        return [of.get(row) for row in range(len(self))]

    @classmethod
    def read(cls, path: str | PathLike[str], surface: SurfaceLike | None = None) -> Landmarks:
        r"""Read landmarks of a surface.

        Parameters
        ----------
        path : path
            ``.mrk.json`` or ``.fcsv`` of 3D Slicer, ``.pp`` of MeshLab, or text with an index or a position on each line,
            or a table with ``x``, ``y``, ``z`` or ``vertex``, and perhaps ``name``, ``curve`` and ``closed``.
        surface : Mesh, PointCloud, path_like, tuple or object, optional
            The surface, as for `match`. Without one, positions are taken as they are, those of 3D Slicer in LPS.

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
        points = marked_points(Path(path))
        if not points:
            raise LandmarkError(f"{path}: no landmarks; {POINTS}")
        if surface is None:
            return cls(_positions(points), [point.name for point in points], _curves(points))
        shape = surface_from(surface)
        if isinstance(shape, Graph):
            raise LandmarkError("landmarks have positions, and a graph has none; give a mesh or points")

        def distance(positions: FloatArray) -> FloatArray:
            nearest = nearest_on_surface(shape, positions).interpolated(shape.vertices)
            return np.asarray(np.linalg.norm(nearest - positions, axis=1))

        unit = float(np.sqrt(shape.area))
        positions, system = placed_positions(points, shape.vertices, unit, distance, "surface", "points")
        written = next((point.system for point in points if point.system), system)
        return cls(positions, [point.name for point in points], _curves(points), systems=(system, written))


def _positions(points: Sequence[MarkedPoint]) -> FloatArray:
    """Return the positions (m, 3) that a file has, nan where there is none."""
    at = [point.at or (np.nan,) * 3 for point in points]
    vertex = next((point for point, place in zip(points, at) if len(place) == 1), None)
    if vertex:
        raise LandmarkError(f"{vertex.where}: a vertex says nothing without its surface; give positions")
    return np.array(at)


def _check_curves(curves: Sequence[Curve], m: int) -> None:
    of: dict[int, str] = {}
    for name, rows, _ in curves:
        if list(rows) != sorted(set(rows).intersection(range(m))):
            raise LandmarkError(
                f"curve {name!r} goes through landmarks {str(rows)[:80]}; give some of 0 to {m - 1}, in ascending order"
            )
        if shared := of.keys() & set(rows):
            row = min(shared)
            raise LandmarkError(
                f"landmark {row} is on the curves {of[row]!r} and {name!r}; give it twice, so that each has its own"
            )
        of |= dict.fromkeys(rows, name)


def _curves(points: Sequence[MarkedPoint]) -> list[Curve]:
    rows: dict[str, list[int]] = {}
    for i, point in enumerate(points):
        if point.curve:
            rows.setdefault(point.curve, []).append(i)
    return [Curve(name, tuple(of), points[of[0]].closed) for name, of in rows.items()]
