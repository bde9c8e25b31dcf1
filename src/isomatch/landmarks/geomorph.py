"""Landmarks of many specimens in files of R's geomorph: TPS, a table with a row for each, and which points slide."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from isomatch.errors import LandmarkError
from isomatch.landmarks.shape_landmarks import Landmarks
from isomatch.storage.files import write_text
from isomatch.storage.texts import write_csv


def write_specimens(path: str | Path, specimens: Mapping[str, Landmarks]) -> None:
    """Write the landmarks of many specimens for R.

    Parameters
    ----------
    path : path_like
        ``.tps``, or any other suffix for a table. A file of the same name that ends in ``_sliders.csv`` is written too if
        there are curves.
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
        twice = len(set(names)) < len(names)
        columns = [
            f"{name}_{axis}"
            for i, name in enumerate(names)
            for name in [f"{i + 1}_{name}" if twice else name]
            for axis in "XYZ"
        ]
        rows = (
            {"specimen": name, **dict(zip(columns, map(_cell, marks.positions[order].ravel().tolist())))}
            for name, marks in specimens.items()
        )
        write_csv(path, rows, ["specimen", *columns])
    if first.curves:
        sliders = path.with_name(f"{path.stem}_sliders.csv")
        write_csv(sliders, _sliders(first), ("before", "slide", "after"))


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


def _cell(value: float) -> float | str:
    return "NA" if np.isnan(value) else value


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
