"""Files of landmarks, written: 3D Slicer, MeshLab, tables, TPS, and those of many specimens for R's geomorph."""

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
from isomatch._core.texts import joined, write_csv
from isomatch.landmarks.landmark_files import CURVES
from isomatch.landmarks.landmarks import Landmarks

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
        Names and order are kept; in ``.mrk.json``, the points of a curve follow each other. Files of 3D Slicer say the
        axes of the coordinates, LPS if these are unknown.

    Returns
    -------
    tuple of str
        What the format has no place for: "names", "curves", "expected errors", "landmarks without a place", "the
        space" with its axes.

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
    left = [what for what in left_out if missing[what]]
    says_axes = path.suffix.lower() in SAY_AXES
    return (*left, *([f"the space ({landmarks.axes})"] if landmarks.axes and not says_axes else []))


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
        markup = {
            "type": "Fiducial" if curve is None else CURVES[curve.closed],
            "name": title if curve is None else curve.name,
            "coordinateSystem": landmarks.axes or "LPS",
            **({"coordinateUnits": landmarks.unit} if landmarks.unit else {}),
            "controlPoints": [_control_point(landmarks, row) for row in (curve.rows if curve else rows)],
        }
        markups.append(markup)
    return json.dumps({"@schema": SCHEMA, "markups": markups}, indent=1, ensure_ascii=False) + "\n"


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
        described = landmarks.names[row], _description(landmarks, row), ""
        rows.writerow([row + 1, *landmarks.positions[row].tolist(), 0, 0, 0, 1, 1, 1, 0, *described])
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


def _description(landmarks: Landmarks, row: int) -> str:
    parts = ("expected error", landmarks.expected_error[row]), ("spread", landmarks.spread[row])
    return ", ".join(f"{name} {value:.4g}" for name, value in parts if np.isfinite(value))


SAY_AXES = ".json", ".fcsv"
WRITERS: dict[str, tuple[Callable[[Landmarks, str], str], tuple[str, ...]]] = {
    ".json": (_markups, ()),
    ".fcsv": (_fiducials, ("curves", "landmarks without a place")),
    ".pp": (_picked_points, ("curves", "expected errors")),
    ".csv": (_table, ()),
    ".tps": (lambda landmarks, title: tps_text({title: landmarks}), ("names", "expected errors")),
}


def write_specimens(path: str | Path, specimens: Mapping[str, Landmarks]) -> None:
    """Write the landmarks of many specimens for R.

    Parameters
    ----------
    path : path_like
        ``.tps``, or any other suffix for a table. Files of the same name that end in ``_sliders.csv`` and
        ``_surfaces.csv`` are written too if there are curves and a patch.
    specimens : mapping of str to Landmarks
        The landmarks of each specimen, as many of each and in one order.

    Raises
    ------
    LandmarkError
        If they have other landmarks, or there are none.
    UnwritableFileError
        If a file cannot be written.

    Notes
    -----
    In R, ``readland.tps("s.tps", specID = "ID", readcurves = TRUE)`` reads fixed landmarks first, then those of the
    curves, one after the other, and missing ones as ``NA``; the table has its columns in the same order:
    ``arrayspecs(read.csv("s.csv", row.names = 1), p, 3)``. The sliders are for
    ``gpagen(..., curves = read.csv("s_sliders.csv"))``: the ends of a curve, and the first point of a closed one, stay.
    ``surfaces = read.csv("s_surfaces.csv")$slide`` are the points of a patch.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_specimens(f"{folder}/all.csv", {"a": Landmarks([[0, 1, 2]], ["nose"])})
    ...     Path(f"{folder}/all.csv").read_text().split()
    ['specimen,nose_X,nose_Y,nose_Z', 'a,0.0,1.0,2.0']
    """
    path = Path(path)
    first = _same_landmarks(specimens)
    if path.suffix.lower() == ".tps":
        write_text(path, tps_text(specimens))
    else:
        order = _order(first)
        names = [first.names[row] or str(row + 1) for row in order]
        if len(set(names)) < len(names):
            names = [f"{i}_{name}" for i, name in enumerate(names, start=1)]
        columns = [f"{name}_{axis}" for name in names for axis in "XYZ"]
        rows = []
        for name, marks in specimens.items():
            cells = ["NA" if np.isnan(x) else x for x in marks.positions[order].ravel().tolist()]
            rows.append({"specimen": name, **dict(zip(columns, cells))})
        write_csv(path, rows, ["specimen", *columns])
    if first.curves:
        sliders = path.with_name(f"{path.stem}_sliders.csv")
        write_csv(sliders, _sliders(first), ("before", "slide", "after"))
    if patch := {*first.patch}:
        rows = [{"slide": i} for i, row in enumerate(_order(first), start=1) if row in patch]
        write_csv(path.with_name(f"{path.stem}_surfaces.csv"), rows, ("slide",))


def tps_text(specimens: Mapping[str, Landmarks]) -> str:
    """Make the text of a TPS file; where all landmarks are on curves, they are written like fixed ones."""
    lines: list[str] = []
    for name, marks in specimens.items():
        fixed = _fixed(marks)
        has_curves = bool(marks.curves) and bool(fixed)
        lines += [f"LM3={len(fixed) if has_curves else len(marks)}"]
        lines += [_line(marks, row) for row in (fixed if has_curves else _order(marks))]
        if has_curves:
            lines.append(f"CURVES={len(marks.curves)}")
            for curve in marks.curves:
                lines += [f"POINTS={len(curve.rows)}", *(_line(marks, row) for row in curve.rows)]
        lines.append(f"ID={name}")
    return "\n".join([*lines, ""])


def _line(marks: Landmarks, row: int) -> str:
    return " ".join(map(repr, marks.positions[row].tolist())) if marks.placed[row] else "NA NA NA"


def _fixed(marks: Landmarks) -> list[int]:
    on_curves = {row for curve in marks.curves for row in curve.rows}
    return [row for row in range(len(marks)) if row not in on_curves]


def _order(marks: Landmarks) -> list[int]:
    """Rows of fixed landmarks, then of those on curves."""
    return [*_fixed(marks), *(row for curve in marks.curves for row in curve.rows)]


def _sliders(marks: Landmarks) -> list[dict[str, int]]:
    """Points between which each inner point of a curve slides, counted from 1 in the order of the files."""
    rows, start = [], len(_fixed(marks)) + 1
    for curve in marks.curves:
        n = len(curve.rows)
        rows += [
            {"before": start + i - 1, "slide": start + i, "after": start + (i + 1) % n}
            for i in range(1, n if curve.closed else n - 1)
        ]
        start += n
    return rows


def _same_landmarks(specimens: Mapping[str, Landmarks]) -> Landmarks:
    if not specimens:
        raise LandmarkError("no specimens; give the landmarks of at least one")
    first_name, first = next(iter(specimens.items()))
    for name, marks in specimens.items():
        if marks.names != first.names or marks.curves != first.curves:
            raise LandmarkError(f"{name} has other landmarks than {first_name}; give the same ones of each")
    return first
