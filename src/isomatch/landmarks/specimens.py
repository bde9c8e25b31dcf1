"""Landmarks of several specimens: TPS, NTSYS, morphologika, tables and folders, read; and each place given once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, LandmarkError, MissingFileError
from isomatch._core.files import legible
from isomatch._core.tables import read_table
from isomatch._core.texts import natural_order
from isomatch.landmarks.landmark_files import MarkedPoint
from isomatch.landmarks.landmarks import Curve, Landmarks, landmarks_of
from isomatch.landmarks.specimen_files import SEVERAL, Read, landmark_numbers, specimens_in

SAME_PLACE = (
    1e-4  # of a specimen's centroid size over √m: two points that are nearer in all specimens are one
)
ONE_EACH = ".mrk.json", ".json", ".fcsv", ".pts", ".pp"  # files of one specimen
OWN = ("landmarks.csv", "landmarks.tps")  # of a folder that has them beside the files of single specimens
KINDS = "a .tps, .nts, .dta, morphologika or .csv file, or a folder of files such as .fcsv or .mrk.json"


def read_specimens(source: str | PathLike[str]) -> dict[str, Landmarks]:
    r"""Read the landmarks of several specimens, by name, as many of each in one order.

    Parameters
    ----------
    source : path_like
        ``.tps``, ``.nts``, ``.dta`` of Landmark Editor, ``.txt`` of morphologika, a table, or a folder. A table has a row
        for each specimen and columns such as ``nose_X``, ``nose_Y``, ``nose_Z``; or a row for each landmark, and columns
        ``specimen``, ``landmark``, ``x``, ``y``, ``z``. A folder has a file for each specimen, all of one kind, see
        `Landmarks.read`, or is one that isomatch wrote. Tables ``NAME_sliders.csv`` and ``NAME_surfaces.csv`` beside a
        file tell its curves and patch.

    Returns
    -------
    dict of str to Landmarks
        Positions are (m, 2) or (m, 3), nan where a landmark has no place; those of TPS are in the units of its scale.
        Each place is given once: curves share the landmarks at which they begin, end or meet, see `join_places`.

    Raises
    ------
    FormatError, MissingFileError
        If a file cannot be read.
    LandmarkError
        If specimens do not have the same landmarks, some are in the plane and some in space, or two have one name.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "wings.tps"
    ...     _ = file.write_text("LM=2\n0 0\n3 4\nID=a\nSCALE=0.5\nLM=2\n0 0\n1 1\nID=b\n")
    ...     {name: marks.positions.tolist() for name, marks in read_specimens(file).items()}
    {'a': [[0.0, 0.0], [1.5, 2.0]], 'b': [[0.0, 0.0], [1.0, 1.0]]}
    """
    path = Path(source)
    if path.is_dir() and (own := [path / name for name in OWN if (path / name).is_file()]):
        path = own[0]
    found = list(_of_folder(path) if path.is_dir() else specimens_in(path))
    if not found or (empty := [each.name for each in found if not each.points]):
        raise LandmarkError(f"{path}: no landmarks{f' of {empty[0]}' if found else ''}; give {KINDS}")
    first, names = found[0], [each.name for each in found]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise LandmarkError(
            f"{path}: several specimens are named {', '.join(twice)[:80]}; give each one of its own (ID)"
        )
    for each in found:
        if each.dim != first.dim:
            told = f"{each.name} has {each.dim} coordinates for each landmark, {first.name} {first.dim}"
            raise LandmarkError(f"{path}: {told}; give those in the plane and those in space apart")
    specimens = {}
    for each in found:
        points = _in_order(each, first, path)
        marks = landmarks_of(points, each.dim)
        links = [Curve(f"link {i}", pair) for i, pair in enumerate(each.links, start=1)]
        specimens[each.name] = replace(marks, curves=(*marks.curves, *links))
    usual = specimens[first.name]
    if other := [name for name, each in specimens.items() if each.curves != usual.curves]:
        raise LandmarkError(
            f"{path}: {other[0]} has other curves than {first.name}; draw the same, with as many points"
        )
    sliders, surfaces = (path.with_name(f"{path.stem}_{each}.csv") for each in ("sliders", "surfaces"))
    m, curves = len(usual), usual.curves
    if sliders.is_file() and not curves:
        curves = curves_of_sliders(sliders, m)
    patch = landmark_numbers(surfaces, ["slide"], m)[:, 0].tolist() if surfaces.is_file() else []
    place = {row: f"surface-{i}" for i, row in enumerate(patch, start=1)}
    marks_of = tuple(place.get(row, name) for row, name in enumerate(usual.names))
    joined, _ = join_places({n: replace(s, curves=curves, names=marks_of) for n, s in specimens.items()})
    return joined


def is_of_landmarks(path: str | PathLike[str]) -> bool:
    """Tell whether a path is a file of landmarks, or a folder with such files."""
    path = Path(path)
    files = path.iterdir() if path.is_dir() else [path]
    return any(legible(file.name).lower().endswith((*ONE_EACH, *SEVERAL)) for file in files)


def _of_folder(folder: Path) -> Iterator[Read]:
    """Read the files of the one kind that a folder has; tables count where there is nothing else."""
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: no such folder; give {KINDS}")
    kinds: dict[str, list[Path]] = {}
    for file in sorted(folder.iterdir(), key=lambda each: natural_order(each.name)):
        suffix = next((s for s in (*ONE_EACH, *SEVERAL) if file.name.lower().endswith(s)), "")
        if suffix and file.is_file() and not file.name.startswith("."):
            kinds.setdefault(suffix, []).append(file)
    of_points = {
        suffix: files for suffix, files in kinds.items() if suffix not in (".txt", ".csv", ".tsv")
    } or kinds
    if len(of_points) > 1:
        raise FormatError(f"{folder}: has files of several kinds, {', '.join(of_points)}; keep those of one")
    for file in next(iter(of_points.values()), []):
        yield from specimens_in(file)


def _in_order(each: Read, first: Read, path: Path) -> list[MarkedPoint]:
    """Return the points of a specimen in the order of the first: by name if they share names, else as they are."""
    names, wanted = ([point.name for point in own.points] for own in (each, first))
    shared = {*names} & {*wanted} - {""}
    if names == wanted or (len(names) == len(wanted) and not shared):
        return each.points
    if not shared or len({*names}) < len(names) or len({*wanted}) < len(wanted):
        told = f"{each.name} has {len(names)} landmarks, {first.name} {len(wanted)}, not all with a name of its own"
        raise LandmarkError(f"{path}: {told}; give the same ones of each, NA for one without a place")
    if alone := [name for name in (*wanted, *names) if name not in shared]:
        told = f"{each.name} and {first.name} do not both have the landmark {alone[0]!r}"
        raise LandmarkError(f"{path}: {told}; mark it in both, or as one without a place")
    place = dict(zip(names, each.points))
    return [place[name] for name in wanted]


def curves_of_sliders(path: Path, m: int) -> tuple[Curve, ...]:
    """Read curves of a table of sliders, as for R: landmarks before, at and after each that slides, counted from 1."""
    runs: list[list[int]] = []
    for before, slide, after in landmark_numbers(path, ("before", "slide", "after"), m).tolist():
        if runs and runs[-1][-2:] == [before, slide] and runs[-1][-1] != runs[-1][0]:
            runs[-1].append(after)
        else:
            runs.append([before, slide, after])
    closed = [len(run) > 3 and run[0] == run[-1] for run in runs]
    rows = [tuple(run[:-1] if is_ring else run) for run, is_ring in zip(runs, closed)]
    return tuple(Curve(f"curve {i}", *each) for i, each in enumerate(zip(rows, closed), start=1))


def read_landmark_pairs(path: Path, names: Sequence[str]) -> list[tuple[int, int]]:
    """Read pairs of landmarks, by their names or by their numbers from 1, of a table with two columns, as rows from 0."""
    table = read_table(path)
    number = {name: i for i, name in enumerate(names) if name}
    number |= {str(i): i - 1 for i in range(1, len(names) + 1) if str(i) not in number}
    pairs = list[tuple[int, int]]()
    for row in table.filled:
        cells = [cell for cell in row.cells if cell]
        if row is table.filled[0] and len(cells) == 2 and not {*cells} & {*number}:
            continue  # a header
        if len(cells) != 2 or not {*cells} <= {*number}:
            remedy = f"write two of their names, or numbers from 1 to {len(names)}"
            table.refuse(row, f"is no pair of landmarks; {remedy}")
        pairs.append((number[cells[0]], number[cells[1]]))
    return pairs


def join_places(specimens: Mapping[str, Landmarks]) -> tuple[dict[str, Landmarks], IntArray]:
    """Give each place once: points that coincide in all specimens become the first of them, which curves share.

    Returns the specimens, whose landmarks come first, then points of curves, then those of the patch, each otherwise in
    order; and the row (m,) there of each landmark. Points coincide if they are nearer than 10⁻⁴ of the size in all
    specimens in which both have a place, and in one at least. A curve ends at a landmark that it leads through and at a
    place of another curve, and goes on from there as one of its own, so that such a place does not slide.
    """
    first = next(iter(specimens.values()))
    m = len(first)
    head = _heads(specimens)
    on_curves = [head[list(curve.rows)].tolist() for curve in first.curves]
    marked = {*range(m)} - {row for curve in first.curves for row in curve.rows}  # those of their own
    landmarks, patch = {*head[sorted(marked.difference(first.patch))].tolist()}, {*head[first.patch].tolist()}
    on_any = {row for rows in on_curves for row in rows}
    rank = {
        row: 0 if row in landmarks else 1 if row in on_any else 2 if row in patch else 0
        for row in head.tolist()
    }
    inner = {
        row for rows, curve in zip(on_curves, first.curves) for row in (rows if curve.closed else rows[1:-1])
    }
    order = sorted(rank)
    ranks = [rank[row] for row in order if row in inner or row not in on_any]  # an end may be a landmark
    order = order if ranks == sorted(ranks) else sorted(rank, key=lambda row: (rank[row], row))
    place = np.full(m, -1)
    place[order] = np.arange(len(order))
    counts = Counter(row for rows in on_curves for row in {*rows})
    ends = {row for row in on_any if row in landmarks or counts[row] > 1}
    pieces = [
        Curve(f"{curve.name} {i}" if i > 1 else curve.name, tuple(place[piece].tolist()), closed)
        for curve, rows in zip(first.curves, on_curves)
        for i, (piece, closed) in enumerate(_split(rows, curve.closed, ends), start=1)
    ]
    members = [np.flatnonzero(head == row) for row in order] if len(order) < m else [[row] for row in order]
    joined = {}
    for name, marks in specimens.items():
        rows = [int(own[int(marks.placed[own].argmax())]) for own in members]  # the first with a place
        values = marks.positions[rows], [marks.names[row] for row in order], pieces
        errors = marks.expected_error[rows], marks.spread[rows]
        joined[name] = Landmarks(*values, *errors, marks.axes, marks.unit)
    return joined, place[head]


def _heads(specimens: Mapping[str, Landmarks]) -> IntArray:
    """Find the first of the points (m,) that are at one place in all specimens."""
    pairs = np.zeros((0, 2), dtype=np.int64)
    for marks in specimens.values():
        placed = np.flatnonzero(marks.placed)
        near = cKDTree(marks.positions[placed]).query_pairs(_tolerance(marks), output_type="ndarray")
        pairs = np.unique(np.concatenate([pairs, placed[near]]), axis=0)
    for marks in specimens.values():
        apart = np.linalg.norm(np.subtract(*marks.positions[pairs.T]), axis=1)
        pairs = pairs[~(apart > _tolerance(marks))]
    head = np.arange(len(marks))
    for i, j in pairs.tolist():
        head[head == head[j]] = head[i]
    return head


def _tolerance(marks: Landmarks) -> float:
    known = marks.positions[marks.placed]
    return (
        SAME_PLACE * float(np.sqrt(((known - known.mean(axis=0)) ** 2).sum(axis=1).mean()))
        if len(known)
        else 0.0
    )


def _split(rows: list[int], closed: bool, ends: Container[int]) -> Iterator[tuple[list[int], bool]]:
    """Split a curve where it passes ends; a closed one with one end begins there."""
    rows = [row for i, row in enumerate(rows) if i == 0 or row != rows[i - 1]]
    closed, rows = (True, rows[:-1]) if len(rows) > 3 and rows[0] == rows[-1] else (closed, rows)
    at = [i for i, row in enumerate(rows) if row in ends]
    if closed and at:
        rows = [*rows[at[0] :], *rows[: at[0]]]
        at, rows, closed = (
            ([i - at[0] for i in at[1:]], [*rows, rows[0]], False) if at[1:] else ([], rows, True)
        )
    cuts = [0, *(i for i in at if 0 < i < len(rows) - 1), len(rows) - 1]
    yield from ([(rows, True)] if closed else [(rows[a : b + 1], False) for a, b in pairwise(cuts) if a < b])
