"""Writers of landmark files: 3D Slicer, MeshLab, tables, TPS, and many specimens for R's geomorph."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator, Mapping
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import FormatError, LandmarkError
from isomatch._core.files import write_text
from isomatch._core.texts import table_text, write_csv
from isomatch.landmarks.landmark_files import CURVES
from isomatch.landmarks.landmarks import Landmarks
from isomatch.landmarks.specimens import join_places

MARKUPS_SCHEMA = (  # address in each file of markups, which tells 3D Slicer the version of the format
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
    "markups-schema-v1.0.3.json#"
)
# titles of the columns of .fcsv files, in their order
FIDUCIAL_COLUMNS = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"


def write_landmarks(path: str | Path, landmarks: Landmarks) -> tuple[str, ...]:
    """Write the landmarks of a shape; an existing file is replaced.

    Parameters
    ----------
    path : path_like
        ``.mrk.json`` or ``.fcsv`` of 3D Slicer, ``.pp`` of MeshLab, ``.csv`` with the columns name,
        x, y, z, or ``.tps``.
    landmarks : Landmarks
        Names and order are kept; in ``.mrk.json``, the points of a curve follow each other, and
        surface semilandmarks are in a separate list. Files of 3D Slicer contain the axes of the
        coordinates, LPS if these are unknown.

    Returns
    -------
    tuple of str
        Parts that the format cannot hold: "names", "curves", "expected errors", "landmarks without
        a place", "the space" with its axes.

    Raises
    ------
    FormatError, LandmarkError, UnwritableFileError
        If the suffix is unknown, has no place for landmarks in the plane, or the file cannot be written.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_landmarks(f"{folder}/marks.csv", Landmarks([[0, 0.5, 0]], ["nose"]))
    ...     print(Path(f"{folder}/marks.csv").read_text().split())
    ()
    ['name,x,y,z', 'nose,0.0,0.5,0.0']
    """
    path = Path(path)
    writer, left_out = writer_of(path)
    if landmarks.positions.shape[1] == 2 and path.suffix.lower() not in (".tps", ".csv"):
        raise LandmarkError(f"{path}: has no place for landmarks in the plane; write .tps or .csv")
    landmarks = landmarks.with_separate_curves()
    write_text(path, writer(landmarks, path.name.split(".")[0]))
    missing = {
        "names": any(landmarks.names),
        "curves": bool(landmarks.curves),
        "expected errors": bool(np.isfinite(landmarks.expected_error).any()),
        "landmarks without a place": not landmarks.placed.all(),
    }
    lost = [part for part in left_out if missing[part]]
    if landmarks.axes and path.suffix.lower() not in SUFFIXES_WITH_AXES:
        lost.append(f"the space ({landmarks.axes})")
    return tuple(lost)


def writer_of(path: Path) -> tuple[Callable[[Landmarks, str], str], tuple[str, ...]]:
    """Return the writer for a suffix, and the parts that it leaves out; `FormatError` if there is none."""
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise FormatError(
            f"{path}: suffix {suffix!r} is not that of a landmark file; use .mrk.json, .fcsv, .pp, .csv or .tps"
        )
    return WRITERS[suffix]


def _markups(landmarks: Landmarks, title: str) -> str:
    markups, curve_of, patch = [], landmarks.curve_of, {*landmarks.patch}
    for (curve, is_patch), group in groupby(range(len(landmarks)), lambda row: (curve_of[row], row in patch)):
        rows = list(group)
        if curve is not None and rows[0] != curve.rows[0]:
            continue  # the curve is written already
        markup = {
            "type": "Fiducial" if curve is None else CURVES[curve.closed],
            "name": curve.name if curve else f"{title}{' semilandmarks' * is_patch}",
            "coordinateSystem": landmarks.axes or "LPS",
            **({"coordinateUnits": landmarks.unit} if landmarks.unit else {}),
            "controlPoints": [_control_point(landmarks, row) for row in (curve.rows if curve else rows)],
        }
        markups.append(markup)
    record = {"@schema": MARKUPS_SCHEMA, "markups": markups}
    return json.dumps(record, indent=1, ensure_ascii=False) + "\n"


def _control_point(landmarks: Landmarks, row: int) -> dict[str, Any]:
    is_placed = bool(landmarks.placed[row])
    return {
        "id": str(row + 1),
        "label": landmarks.names[row],
        "description": _description(landmarks, row),
        "position": landmarks.positions[row].tolist() if is_placed else [0.0, 0.0, 0.0],
        "positionStatus": "defined" if is_placed else "undefined",
    }


def _fiducials(landmarks: Landmarks, title: str) -> str:
    text = StringIO(newline="")
    text.write("# Markups fiducial file version = 4.11\n")
    text.write(f"# CoordinateSystem = {landmarks.axes or 'LPS'}\n# columns = {FIDUCIAL_COLUMNS}\n")
    rows = csv.writer(text, lineterminator="\n")
    for row in np.flatnonzero(landmarks.placed).tolist():
        texts = landmarks.names[row], _description(landmarks, row), ""
        rows.writerow([row + 1, *landmarks.positions[row].tolist(), 0, 0, 0, 1, 1, 1, 0, *texts])
    return text.getvalue()


def _picked_points(landmarks: Landmarks, title: str) -> str:
    lines = ["<!DOCTYPE PickedPoints>", "<PickedPoints>"]
    for name, place, is_placed in zip(landmarks.names, landmarks.positions, landmarks.placed):
        x, y, z = place.tolist() if is_placed else (0.0, 0.0, 0.0)
        lines.append(f' <point x="{x}" y="{y}" z="{z}" active="{int(is_placed)}" name={quoteattr(name)}/>')
    return "\n".join([*lines, "</PickedPoints>", ""])


def _table(landmarks: Landmarks, title: str) -> str:
    columns = list(_columns(landmarks))
    text = table_text([[name for name, _ in columns], *zip(*(cells for _, cells in columns))])
    return re.sub(r"(?m)^#[^,]*", r'"\g<0>"', text)  # in quotes, as a name with # would begin a comment


def _columns(landmarks: Landmarks) -> Iterator[tuple[str, list[Any]]]:
    yield "name", list(landmarks.names)
    for axis, values in zip("xyz", landmarks.positions.T):
        yield axis, _cells(values)
    for name, values in (("expected_error", landmarks.expected_error), ("spread", landmarks.spread)):
        if np.isfinite(values).any():
            yield name, _cells(values)
    if landmarks.curves:
        yield "curve", ["" if curve is None else curve.name for curve in landmarks.curve_of]
        yield "closed", ["" if curve is None else int(curve.closed) for curve in landmarks.curve_of]


def _cells(values: FloatArray) -> list[Any]:
    return ["" if np.isnan(value) else value for value in values.tolist()]


def _description(landmarks: Landmarks, row: int) -> str:
    parts = ("expected error", landmarks.expected_error[row]), ("spread", landmarks.spread[row])
    return ", ".join(f"{name} {value:.4g}" for name, value in parts if np.isfinite(value))


SUFFIXES_WITH_AXES = ".json", ".fcsv"  # suffixes of files that name the axes of their coordinates
# for each suffix: its writer, and the parts of landmarks that such files cannot hold
WRITERS: dict[str, tuple[Callable[[Landmarks, str], str], tuple[str, ...]]] = {
    ".json": (_markups, ()),
    ".fcsv": (_fiducials, ("curves", "landmarks without a place")),
    ".pp": (_picked_points, ("curves", "expected errors")),
    ".csv": (_table, ()),
    ".tps": (lambda landmarks, title: tps_text({title: landmarks}), ("names", "curves", "expected errors")),
}


def write_specimens(path: str | Path, specimens: Mapping[str, Landmarks]) -> list[str]:
    """Write the landmarks of many specimens for R, every place once, see `join_places`.

    Parameters
    ----------
    path : path_like
        ``.tps``, or any other suffix for a table. Files of the same name that end in
        ``_sliders.csv`` and ``_surfaces.csv`` are written too if there are curves and a patch.
    specimens : mapping of str to Landmarks
        The landmarks of each specimen, the same ones in the same order.

    Returns
    -------
    list of str
        Names that geomorph takes for commands of TPS, such as SCALE5: it reads wrong coordinates.

    Raises
    ------
    LandmarkError, UnwritableFileError
        If specimens have different landmarks, there are none, or a file cannot be written.

    Notes
    -----
    In R, ``readland.tps("s.tps", specID = "ID")`` reads landmarks first, then points of curves, one
    curve after the other, then a patch, and missing ones as ``NA``; the table has its columns in
    the same order: ``arrayspecs(read.csv("s.csv", row.names = 1), p, 3)``. The sliders are for
    ``gpagen(..., curves = read.csv("s_sliders.csv"))``: landmarks, ends of curves, places where
    curves meet, and the first point of a closed one, stay. ``surfaces =
    read.csv("s_surfaces.csv")$slide`` are the points of a patch.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_specimens(f"{folder}/all.csv", {"a": Landmarks([[0, 1, 2]], ["nose"])})
    ...     Path(f"{folder}/all.csv").read_text().split()
    ['specimen,nose_X,nose_Y,nose_Z', 'a,0.0,1.0,2.0']
    """
    path = Path(path)
    if not specimens:
        raise LandmarkError("no specimens; give the landmarks of at least one")
    first_name, first = next(iter(specimens.items()))
    for name, marks in specimens.items():
        if marks.names != first.names or marks.curves != first.curves:
            raise LandmarkError(f"{name} has other landmarks than {first_name}; give the same ones of each")
    joined_places, _ = join_places(specimens)
    first, is_tps = next(iter(joined_places.values())), path.suffix.lower() == ".tps"
    if is_tps:
        write_text(path, tps_text(joined_places))
    else:
        names = [name or str(row) for row, name in enumerate(first.names, start=1)]
        if len(set(names)) < len(names):
            names = [f"{i}_{name}" for i, name in enumerate(names, start=1)]
        columns = [f"{name}_{axis}" for name in names for axis in "XYZ"[: first.positions.shape[1]]]
        rows = []
        for name, marks in joined_places.items():
            cells = ["NA" if np.isnan(x) else x for x in marks.positions.ravel().tolist()]
            rows.append({"specimen": name, **dict(zip(columns, cells))})
        write_csv(path, rows, ["specimen", *columns])
    if first.curves:  # each inner point of a curve slides between two others, all counted from 1
        titles, sliders = ("before", "slide", "after"), []
        for _, members, closed in first.curves:
            numbers = [row + 1 for row in ((*members, members[0]) if closed else members)]
            sliders += [dict(zip(titles, row)) for row in zip(numbers, numbers[1:], numbers[2:])]
        write_csv(path.with_name(f"{path.stem}_sliders.csv"), sliders, titles)
    if first.patch:
        slide = [{"slide": row + 1} for row in first.patch]
        write_csv(path.with_name(f"{path.stem}_surfaces.csv"), slide, ("slide",))
    return [name for name in specimens if is_tps and MISREAD_NAMES.search(name)]


# matches names that the R package geomorph takes for lines of TPS
MISREAD_NAMES = re.compile(r"SCALE|(?i:LM3?=|COMMENT=)|ID=|^\s*$")


def tps_text(specimens: Mapping[str, Landmarks]) -> str:
    """Make the text of a TPS file; points of curves are written like landmarks."""
    lines: list[str] = []
    for name, marks in specimens.items():
        missing = " ".join(["NA"] * marks.positions.shape[1])
        lines.append(f"{'LM3' if marks.positions.shape[1] == 3 else 'LM'}={len(marks)}")
        for position, is_placed in zip(marks.positions.tolist(), marks.placed):
            lines.append(" ".join(map(repr, position)) if is_placed else missing)
        lines.append(f"ID={name}")
    return "\n".join([*lines, ""])
