"""Landmarks of several specimens, from TPS, NTSYS, morphologika, tables and folders."""

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
from isomatch._core.errors import FormatError, LandmarkError
from isomatch._core.files import legible
from isomatch._core.tables import read_table
from isomatch._core.texts import natural_order
from isomatch.landmarks.landmark_files import MarkedPoint
from isomatch.landmarks.landmarks import Curve, Landmarks, landmarks_of
from isomatch.landmarks.specimen_files import SUFFIXES_OF_MANY, Specimen, landmark_numbers, specimens_in

# distance of two points over the specimen's size (root mean square distance from its mean point), up to which
# the points are at one place; chosen
SAME_PLACE_RATIO = 1e-4
SUFFIXES_OF_ONE = ".mrk.json", ".json", ".fcsv", ".pts", ".pp"  # suffixes of files with one specimen
SUFFIXES_OF_TABLES = ".txt", ".csv", ".tsv"  # suffixes of tables, which do not always hold landmarks
FOLDER_FILES = "landmarks.csv", "landmarks.tps"  # names of files that hold all specimens of a folder
INPUTS = "a .tps, .nts, .dta, morphologika or .csv file, or a folder of files such as .fcsv or .mrk.json"


def read_specimens(source: str | PathLike[str]) -> dict[str, Landmarks]:
    r"""Read the landmarks of several specimens, by name, the same ones in the same order.

    Parameters
    ----------
    source : path_like
        ``.tps``, ``.nts``, ``.dta`` of Landmark Editor, ``.txt`` of morphologika, a table, or a
        folder. A table has a row for each specimen and columns such as ``nose_X``, ``nose_Y``,
        ``nose_Z``; or a row for each landmark, and columns ``specimen``, ``landmark``, ``x``,
        ``y``, ``z``. A folder has a file for each specimen, all of one kind, see `Landmarks.read`,
        or is one that isomatch wrote. Tables ``NAME_sliders.csv`` and ``NAME_surfaces.csv`` beside
        a file tell its curves and patch.

    Returns
    -------
    dict of str to Landmarks
        Positions are (m, 2) or (m, 3), nan if a landmark has no place; in TPS they are in the units
        of its scale. Every place is given once, see `join_places`.

    Raises
    ------
    FormatError, LandmarkError
        If a file cannot be read, specimens do not have the same landmarks, some are in the plane and
        some in space, or two have one name.

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
    if path.is_dir():
        path = next((path / name for name in FOLDER_FILES if (path / name).is_file()), path)
    specimens = list(_specimens_in_folder(path) if path.is_dir() else specimens_in(path))
    if not specimens or (empty := [specimen.name for specimen in specimens if not specimen.points]):
        raise LandmarkError(f"{path}: no landmarks{f' of {empty[0]}' if specimens else ''}; give {INPUTS}")
    first, counts = specimens[0], Counter(specimen.name for specimen in specimens)
    if twice := sorted(name for name, count in counts.items() if count > 1):
        raise LandmarkError(
            f"{path}: several specimens are named {', '.join(twice)[:80]}; give each one of its own (ID)"
        )
    landmarks = {}
    for name, points, dim, links in specimens:
        if dim != first.dim:
            raise LandmarkError(
                f"{path}: {name} has {dim} coordinates for each landmark, {first.name} {first.dim}; "
                "give those in the plane and those in space apart"
            )
        marks = landmarks_of(_in_order(name, points, first, path), dim)
        wireframe = [Curve(f"link {i}", pair) for i, pair in enumerate(links, start=1)]
        landmarks[name] = replace(marks, curves=(*marks.curves, *wireframe))
    usual = landmarks[first.name]
    if other := [name for name, marks in landmarks.items() if marks.curves != usual.curves]:
        message = f"{path}: {other[0]} has other curves than {first.name}; draw the same, with as many points"
        raise LandmarkError(message)
    sliders, surfaces = (path.with_name(f"{path.stem}_{kind}.csv") for kind in ("sliders", "surfaces"))
    m, curves = len(usual), usual.curves
    if sliders.is_file() and not curves:
        curves = curves_of_sliders(sliders, m)
    names = list(usual.names)
    patch = landmark_numbers(surfaces, ["slide"], m)[:, 0].tolist() if surfaces.is_file() else []
    for i, row in enumerate(patch, start=1):
        names[row] = f"surface-{i}"
    renamed = {name: replace(s, curves=curves, names=tuple(names)) for name, s in landmarks.items()}
    return join_places(renamed)[0]


def is_of_landmarks(path: str | PathLike[str]) -> bool:
    """Return whether a path is a file of landmarks, or a folder with such files."""
    path = Path(path)
    files = path.iterdir() if path.is_dir() else [path]
    return any(legible(file.name).lower().endswith((*SUFFIXES_OF_ONE, *SUFFIXES_OF_MANY)) for file in files)


def _specimens_in_folder(folder: Path) -> Iterator[Specimen]:
    """Read the files of a folder, all of one kind; tables are read only if there is no other kind."""
    kinds: dict[str, list[Path]] = {}
    for file in sorted(folder.iterdir(), key=lambda path: natural_order(path.name)):
        suffix = next((s for s in (*SUFFIXES_OF_ONE, *SUFFIXES_OF_MANY) if file.name.lower().endswith(s)), "")
        if suffix and file.is_file() and not file.name.startswith("."):
            kinds.setdefault(suffix, []).append(file)
    kinds = {suffix: kinds[suffix] for suffix in kinds if suffix not in SUFFIXES_OF_TABLES} or kinds
    if len(kinds) > 1:
        raise FormatError(f"{folder}: has files of several kinds, {', '.join(kinds)}; keep those of one")
    for file in next(iter(kinds.values()), []):
        yield from specimens_in(file)


def _in_order(name: str, points: list[MarkedPoint], first: Specimen, path: Path) -> list[MarkedPoint]:
    """Return the points of a specimen in the order of the first specimen if they share names, else as they are."""
    names, order = [point.name for point in points], [point.name for point in first.points]
    shared = {*names} & {*order} - {""}
    if names == order or (len(names) == len(order) and not shared):
        return points
    if not shared or len({*names}) < len(names) or len({*order}) < len(order):
        raise LandmarkError(
            f"{path}: {name} has {len(names)} landmarks, {first.name} {len(order)}, not all with a name of its own; "
            "give the same ones of each, NA for one without a place"
        )
    if alone := [mark for mark in (*order, *names) if mark not in shared]:
        raise LandmarkError(
            f"{path}: {name} and {first.name} do not both have the landmark {alone[0]!r}; mark it in both, "
            "or as one without a place"
        )
    point_of = dict(zip(names, points))
    return [point_of[mark] for mark in order]


def curves_of_sliders(path: Path, m: int) -> tuple[Curve, ...]:
    """Read curves from a table of sliders, as for R: rows of a landmark between its neighbours, from 1."""
    runs: list[list[int]] = []
    for before, slide, after in landmark_numbers(path, ("before", "slide", "after"), m).tolist():
        if runs and runs[-1][-2:] == [before, slide] and runs[-1][-1] != runs[-1][0]:
            runs[-1].append(after)
        else:
            runs.append([before, slide, after])
    closed = [len(run) > 3 and run[0] == run[-1] for run in runs]
    rows = [tuple(run[:-1] if is_ring else run) for run, is_ring in zip(runs, closed)]
    return tuple(Curve(f"curve {i}", *curve) for i, curve in enumerate(zip(rows, closed), start=1))


def read_landmark_pairs(path: Path, names: Sequence[str]) -> list[tuple[int, int]]:
    """Read pairs of landmarks, names or numbers from 1, from a table with two columns, as rows from 0."""
    table = read_table(path)
    number = {name: i for i, name in enumerate(names) if name}
    number |= {str(i): i - 1 for i in range(1, len(names) + 1) if str(i) not in number}
    pairs = list[tuple[int, int]]()
    for row in table.filled:
        cells = [cell for cell in row.cells if cell]
        if row is table.filled[0] and len(cells) == 2 and not {*cells} & {*number}:
            continue  # the row is a header
        if len(cells) != 2 or not {*cells} <= {*number}:
            remedy = f"write two of their names, or numbers from 1 to {len(names)}"
            table.refuse(row, f"is no pair of landmarks; {remedy}")
        pairs.append((number[cells[0]], number[cells[1]]))
    return pairs


def join_places(specimens: Mapping[str, Landmarks]) -> tuple[dict[str, Landmarks], IntArray]:
    """Give every place once: points that coincide in all specimens become one, which curves share.

    Returns the specimens, with landmarks first, then points of curves, then the patch, each in the
    given order; and the row (m,) there of each landmark. Points coincide if they are nearer than
    10⁻⁴ of the size in all specimens in which both have a place, and in one at least. A curve is
    split at a landmark that it passes and at a place of another curve, so that such a place does
    not slide.
    """
    first = next(iter(specimens.values()))
    m = len(first)
    head = _heads(specimens)
    on_curves = [head[list(curve.rows)].tolist() for curve in first.curves]
    single = {*range(m)} - {row for curve in first.curves for row in curve.rows} - {*first.patch}
    landmarks, patch = {*head[sorted(single)].tolist()}, {*head[first.patch].tolist()}
    on_any = {row for rows in on_curves for row in rows}
    rank = dict.fromkeys(head.tolist(), 0)  # 0 for landmarks, 1 for points of curves, 2 for the patch
    rank |= dict.fromkeys(patch, 2) | dict.fromkeys(on_any, 1) | dict.fromkeys(landmarks, 0)
    inner = set[int]()
    for rows, curve in zip(on_curves, first.curves):
        inner.update(rows if curve.closed else rows[1:-1])
    order = sorted(rank)
    ranks = [rank[row] for row in order if row in inner or row not in on_any]  # curves' ends have no order
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
        # of the points at one place, the first that has a position is taken
        rows = [int(group[int(marks.placed[group].argmax())]) for group in members]
        values = marks.positions[rows], [marks.names[row] for row in order], pieces
        errors = marks.expected_error[rows], marks.spread[rows]
        joined[name] = Landmarks(*values, *errors, marks.axes, marks.unit)
    return joined, place[head]


def _heads(specimens: Mapping[str, Landmarks]) -> IntArray:
    """Find, for each of m points, the first point that is at the same place in all specimens."""
    pairs = np.zeros((0, 2), dtype=np.int64)
    for marks in specimens.values():
        placed = np.flatnonzero(marks.placed)
        near = cKDTree(marks.positions[placed]).query_pairs(_same_place(marks), output_type="ndarray")
        pairs = np.unique(np.concatenate([pairs, placed[near]]), axis=0)
    for marks in specimens.values():
        distance = np.linalg.norm(np.subtract(*marks.positions[pairs.T]), axis=1)
        pairs = pairs[~(distance > _same_place(marks))]
    head = np.arange(len(marks))
    for i, j in pairs.tolist():
        head[head == head[j]] = head[i]
    return head


def _same_place(marks: Landmarks) -> float:
    """Largest distance of points at the same place."""
    known = marks.positions[marks.placed]
    if not len(known):
        return 0.0
    return SAME_PLACE_RATIO * float(np.sqrt(((known - known.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _split(rows: list[int], closed: bool, ends: Container[int]) -> Iterator[tuple[list[int], bool]]:
    """Split a curve where it passes ends; a closed curve with one end begins there."""
    rows = [row for i, row in enumerate(rows) if i == 0 or row != rows[i - 1]]
    if len(rows) > 3 and rows[0] == rows[-1]:
        closed, rows = True, rows[:-1]
    cuts = [i for i, row in enumerate(rows) if row in ends]
    if closed and cuts:
        rows = [*rows[cuts[0] :], *rows[: cuts[0]]]
        if len(cuts) > 1:
            cuts, rows, closed = [i - cuts[0] for i in cuts[1:]], [*rows, rows[0]], False
    if closed:
        yield rows, True
        return
    cuts = [0, *(i for i in cuts if 0 < i < len(rows) - 1), len(rows) - 1]
    yield from ((rows[a : b + 1], False) for a, b in pairwise(cuts) if a < b)
