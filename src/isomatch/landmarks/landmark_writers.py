"""Files of the landmarks of one shape, written: 3D Slicer, MeshLab, tables, and TPS."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from isomatch.errors import FormatError
from isomatch.landmarks.geomorph import tps_text
from isomatch.landmarks.landmark_files import CURVES, SLICER
from isomatch.landmarks.shape_landmarks import Landmarks
from isomatch.storage.files import write_text
from isomatch.storage.texts import joined
from isomatch.values.arrays import FloatArray

SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
    "markups-schema-v1.0.3.json#"
)
FIDUCIAL_COLUMNS = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"


def write_landmarks(path: str | Path, landmarks: Landmarks) -> tuple[str, ...]:
    """Write the landmarks of a shape; an existing file is replaced.

    Parameters
    ----------
    path : path_like
        ``.mrk.json`` or ``.fcsv`` of 3D Slicer, ``.pp`` of MeshLab, ``.csv`` with the columns name, x, y, z, or ``.tps``.
    landmarks : Landmarks
        Names and order are kept; in ``.mrk.json``, the points of a curve follow each other. Files of 3D Slicer are in
        the system of ``landmarks.systems``.

    Returns
    -------
    tuple of str
        What the format has no place for: "names", "curves", "expected errors", "landmarks without a place".

    Raises
    ------
    FormatError
        If the suffix is unknown.
    UnwritableFileError
        If the file cannot be written.

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
    write_text(path, writer(landmarks, path.name.split(".")[0]))
    missing = {
        "names": any(landmarks.names),
        "curves": bool(landmarks.curves),
        "expected errors": bool(np.isfinite(landmarks.expected_error).any()),
        "landmarks without a place": not landmarks.placed.all(),
    }
    return tuple(what for what in left_out if missing[what])


def writer_of(path: Path) -> tuple[Callable[[Landmarks, str], str], tuple[str, ...]]:
    """Return what makes the text of a file by its suffix, and what it has no place for; `FormatError` if unknown."""
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise FormatError(
            f"{path}: suffix {suffix!r} is none of a file of landmarks; use .mrk.json, .fcsv, .pp, .csv or .tps"
        )
    return WRITERS[suffix]


def _markups(landmarks: Landmarks, title: str) -> str:
    markups = []
    for curve, group in groupby(range(len(landmarks)), landmarks.curve_of.__getitem__):
        rows = list(group)
        if curve is not None and rows[0] != curve.rows[0]:
            continue  # it is written already
        kind = "Fiducial" if curve is None else CURVES[curve.closed]
        markups.append(
            {
                "type": kind,
                "name": title if curve is None else curve.name,
                "coordinateSystem": landmarks.systems[1],
                "controlPoints": [_control_point(landmarks, row) for row in (curve.rows if curve else rows)],
            }
        )
    return json.dumps({"@schema": SCHEMA, "markups": markups}, indent=1, ensure_ascii=False) + "\n"


def _control_point(landmarks: Landmarks, row: int) -> dict[str, Any]:
    is_placed = bool(landmarks.placed[row])
    return {
        "id": str(row + 1),
        "label": landmarks.names[row],
        "description": _description(landmarks, row),
        "position": _in_file(landmarks)[row].tolist() if is_placed else [0.0, 0.0, 0.0],
        "positionStatus": "defined" if is_placed else "undefined",
    }


def _fiducials(landmarks: Landmarks, title: str) -> str:
    text = StringIO(newline="")
    text.write("# Markups fiducial file version = 4.11\n")
    text.write(f"# CoordinateSystem = {landmarks.systems[1]}\n# columns = {FIDUCIAL_COLUMNS}\n")
    rows = csv.writer(text, lineterminator="\n")
    positions = _in_file(landmarks)
    for row in np.flatnonzero(landmarks.placed).tolist():
        described = landmarks.names[row], _description(landmarks, row), ""
        rows.writerow([row + 1, *positions[row].tolist(), 0, 0, 0, 1, 1, 1, 0, *described])
    return text.getvalue()


def _picked_points(landmarks: Landmarks, title: str) -> str:
    lines = ["<!DOCTYPE PickedPoints>", "<PickedPoints>"]
    for name, place, is_placed in zip(landmarks.names, landmarks.positions, landmarks.placed):
        x, y, z = place.tolist() if is_placed else (0.0, 0.0, 0.0)
        lines.append(f' <point x="{x}" y="{y}" z="{z}" active="{int(is_placed)}" name={quoteattr(name)}/>')
    return "\n".join([*lines, "</PickedPoints>", ""])


def _table(landmarks: Landmarks, title: str) -> str:
    columns = list(_columns(landmarks))
    text = joined([[name for name, _ in columns], *zip(*(cells for _, cells in columns))])
    return re.sub(r"(?m)^#[^,]*", r'"\g<0>"', text)  # without quotes, a name begins a comment


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


def _in_file(landmarks: Landmarks) -> FloatArray:
    """(m, 3) positions in the coordinate system of the file."""
    own, written = landmarks.systems
    return landmarks.positions if own == written else landmarks.positions * SLICER


def _description(landmarks: Landmarks, row: int) -> str:
    parts = ("expected error", landmarks.expected_error[row]), ("spread", landmarks.spread[row])
    return ", ".join(f"{name} {value:.4g}" for name, value in parts if np.isfinite(value))


WRITERS: dict[str, tuple[Callable[[Landmarks, str], str], tuple[str, ...]]] = {
    ".json": (_markups, ()),
    ".fcsv": (_fiducials, ("curves", "landmarks without a place")),
    ".pp": (_picked_points, ("curves", "expected errors")),
    ".csv": (_table, ()),
    ".tps": (lambda landmarks, title: tps_text({title: landmarks}), ("names", "expected errors")),
}
