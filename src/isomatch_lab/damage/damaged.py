"""A damaged mesh with its truth, and a benchmark pair with one damaged shape or two."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import InputError, MeshError, SettingError
from isomatch.repair import check
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch_lab.sets import BenchmarkPair

SHARE_RANGE = (0.0, 1.0)  # allowed shares of a surface
EDGE_LENGTH_RANGE = (1e-100, 1e100)  # allowed edge lengths in mesh units: areas neither vanish nor overflow


@dataclass(frozen=True, eq=False)
class Damaged:
    """A mesh made from a whole one, and the relation of their vertices.

    Parameters
    ----------
    whole : Mesh
        The mesh before the damage.
    mesh : Mesh
        The damaged mesh, n vertices.
    original : (n,) array of int
        Vertex of the whole mesh that each damaged vertex was.
    twin : (n,) array of int, optional
        Where two vertices were merged into one, the second of them; −1 elsewhere.
    stand_in : (n_whole,) array of int, optional
        Where vertices were thinned out but the surface is still there, the damaged vertex that stands for each vertex of
        the whole; −1 for those that are gone.
    """

    whole: Mesh
    mesh: Mesh
    original: IntArray
    twin: IntArray | None = None
    stand_in: IntArray | None = None

    @property
    def damaged_vertex(self) -> IntArray:
        """(n_whole,) damaged vertex that each vertex of the whole became; −1 where it is gone or was merged."""
        if self.stand_in is not None:
            return self.stand_in
        became = np.full(self.whole.n_vertices, -1, dtype=np.int64)
        single = np.ones(len(self.original), dtype=bool) if self.twin is None else self.twin < 0
        became[self.original[single]] = np.flatnonzero(single)
        return became

    @property
    def merged(self) -> IntArray:
        """Vertices of the whole that were merged with others."""
        if self.twin is None:
            return np.zeros(0, dtype=np.int64)
        pairs = self.twin >= 0
        return np.concatenate([self.original[pairs], self.twin[pairs]])

    @property
    def with_twins(self) -> IntArray:
        """(n,) ``original``, with the twin in place of the first of two merged vertices."""
        return self.original if self.twin is None else np.where(self.twin < 0, self.original, self.twin)


def with_faces(whole: Mesh, faces: IntArray) -> Damaged:
    """Make a mesh of (m, 3) faces between vertices of a whole one, without the vertices that they do not use."""
    original = np.unique(faces)
    renumber = np.zeros(whole.n_vertices, dtype=np.int64)
    renumber[original] = np.arange(len(original))
    return Damaged(whole, Mesh(whole.vertices[original], renumber[faces]), original)


def undamaged(mesh: Mesh) -> Damaged:
    """Return a mesh as its own original."""
    return Damaged(mesh, mesh, np.arange(mesh.n_vertices))


def require_usable(mesh: Mesh, name: str, level: float, bounds: tuple[float, float]) -> None:
    """Raise `MeshError` unless a mesh is a surface, and `SettingError` unless a level lies between its bounds."""
    fatal = check(mesh, wall=0.0).fatal
    if fatal:
        raise MeshError("; ".join(fatal))
    longest = float(mesh.edge_lengths.max())
    if not EDGE_LENGTH_RANGE[0] < longest < EDGE_LENGTH_RANGE[1]:
        message = f"the longest edge of {mesh!r} is {longest:g}, whose square is no number; scale the mesh"
        raise MeshError(message)
    require_between(name, level, bounds)


def require_between(name: str, value: float, bounds: tuple[float, float]) -> None:
    """Raise `SettingError` unless a value lies strictly between two bounds."""
    low, high = bounds
    if not low < value < high:
        raise SettingError(f"{name} = {value} does not lie between {low:g} and {high:g}")


@dataclass(frozen=True, eq=False)
class DamagedPair:
    """A damaged pair and the whole pair it was made from.

    Errors are measured on the whole target, in units of its √area: distances along a damaged surface, around holes or
    across welds, are not those between the points of the body. `lifted` carries a map there.

    Parameters
    ----------
    given : BenchmarkPair
        The damaged shapes, as a method is given them, with the truth in their vertices.
    whole : BenchmarkPair
        The shapes before the damage, with the rows of the truth whose vertices both remain or have a stand-in. The
        order stays. Vertices that were merged with others have no truth.
    source, target : Damaged
        What was done to each shape.
    alone : (m,) array of int
        Vertices of the damaged source whose counterparts are gone, or that had none.
    """

    given: BenchmarkPair
    whole: BenchmarkPair
    source: Damaged
    target: Damaged
    alone: IntArray

    def lifted(self, image: IntArray) -> tuple[IntArray, ...]:
        """Carry a map between the damaged shapes to the whole ones.

        Parameters
        ----------
        image : (n_damaged_source,) array of int
            Target vertex of each vertex of the damaged source; −1 where there is none.

        Returns
        -------
        tuple of (n_whole_source,) array of int
            Vertex of the whole target of each vertex of the whole source; −1 for those that are gone or have no image.
            A second array, if target vertices were merged, has the other one of the two in their place; of both, the one
            with the smaller error counts.
        """
        became = self.source.damaged_vertex
        lifts = []
        for original in (self.target.original, self.target.with_twins):
            on_target = np.append(original, -1)[image]
            lifts.append(np.append(on_target, -1)[became])
        return tuple(lifts[: 1 if self.target.twin is None else 2])


def damaged_pair(
    pair: BenchmarkPair, source: Damaged | None = None, target: Damaged | None = None
) -> DamagedPair:
    """Replace the shapes of a pair by damaged ones, and restrict the truth to the vertices that remain.

    Parameters
    ----------
    pair : BenchmarkPair
        Whole shapes with truth.
    source, target : Damaged, optional
        The damage of its source and target; none by default.

    Returns
    -------
    DamagedPair
        If mirrored truth is known, the rows that remain are those whose mirrored image remains too.

    Raises
    ------
    InputError
        If nothing of the truth remains.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> half = Damaged(square, Mesh(square.vertices[[0, 2, 3]], [[0, 1, 2]]), np.array([0, 2, 3]))
    >>> pair = BenchmarkPair("a-b", square, square, np.column_stack([np.arange(4), np.arange(4)]))
    >>> cut = damaged_pair(pair, target=half)
    >>> cut.given.truth.tolist(), cut.lifted(np.array([0, 0, 1, 2]))[0].tolist()
    ([[0, 0], [2, 1], [3, 2]], [0, 0, 2, 3])
    """
    source = undamaged(pair.source) if source is None else source
    target = undamaged(pair.target) if target is None else target
    became = source.damaged_vertex, target.damaged_vertex

    def moved(rows: IntArray) -> IntArray:
        return np.column_stack([side[column] for side, column in zip(became, rows.T)])

    truths = [rows for rows in (pair.truth, pair.mirrored) if rows is not None]
    left = np.all([(moved(rows) >= 0).all(axis=1) for rows in truths], axis=0)
    if not left.any():
        message = f"{pair.name}: nothing of the truth remains after the damage; damage less of the shapes"
        raise InputError(message)
    whole = [rows[left] for rows in truths]
    remaining = [moved(rows) for rows in whole]
    points = pair.points and PrecisePoints(pair.points.corners[left], pair.points.barycentric[left])
    on_source, on_target = moved(pair.truth).T
    merged = np.isin(pair.truth[:, 1], target.merged)
    gone = on_source[(on_source >= 0) & (on_target < 0) & ~merged]
    before = np.zeros(0, dtype=np.int64) if pair.alone is None else became[0][pair.alone]
    alone = np.setdiff1d(np.concatenate([gone, before[before >= 0]]), remaining[0][:, 0])
    damaged = replace(
        pair,
        source=source.mesh,
        target=target.mesh,
        truth=remaining[0],
        mirrored=(*remaining, None)[1],
        alone=alone if len(alone) or pair.alone is not None else None,
        points=None,
        moved=None,
    )
    return DamagedPair(
        damaged,
        replace(pair, truth=whole[0], mirrored=(*whole, None)[1], points=points),
        source,
        target,
        alone,
    )
