"""``isomatch collect landmarks`` and ``--landmarks``: landmarks of some shapes of a collection, carried to all others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import nan
from os.path import isfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

import isomatch
import isomatch.landmarks as shape_landmarks
from isomatch import collections
from isomatch.cli.inputs import Force
from isomatch.cli.terminal import TALK, Talk, Tell, say
from isomatch.errors import InputError, IsomatchError
from isomatch.storage.files import claimed, legible, made_folder
from isomatch.storage.texts import write_csv

CurvePoints = Annotated[
    int | None,
    Parameter(help="Number of equally spaced points on each curve; by default as many as it was drawn with."),
]
Patches = Annotated[
    Path | None,
    Parameter(
        help="Surface semilandmarks of the shapes that have landmarks: a file or a folder, as of these, with as many "
        "points in one order."
    ),
]
SurfacePoints = Annotated[
    int, Parameter(help="How many semilandmarks to spread evenly over the first shape that has landmarks.")
]
Slide = Annotated[
    bool,
    Parameter(
        help="Slide the points of curves, patches and surfaces so that thin-plate splines from the mean shape bend least."
    ),
]
SUFFIXES = (".mrk.json", ".json", ".fcsv", ".pp", ".csv", ".txt")
ERRORS = ("specimen", "landmark", "expected_error", "spread", "error")  # columns of the table of errors
SLID = ("specimen", "mean", "largest", "energy_before", "energy_after")  # of how far points slid


def landmarks(
    folder: Path,
    marks: Path,
    to: Path,
    /,
    *,
    format: str = "mrk.json",
    curve_points: CurvePoints = None,
    patches: Patches = None,
    surface_points: SurfacePoints = 0,
    slide: Slide = False,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Carry the landmarks of some shapes to all others: the median of what each of them gives.

    Args:
        folder: The folder of a collection.
        marks: Folder of the landmarks of some of its shapes, named like them, or one such file: .mrk.json or .fcsv of 3D
            Slicer, .pp of MeshLab, or a table name,x,y,z. A file of another name is that of the template.
        to: Folder for a file of each shape, and for R's geomorph landmarks.csv, with a row for each, and landmarks.tps:
            in the unit of the collection, and reflected, x → −x, where a shape was matched as its mirror image.
            landmarks_errors.csv has the expected error of each, and that of the marked shapes, carried from the others;
            landmarks_slid.csv how far points slid, and the bending energy before and after.
        format: Suffix of the files: mrk.json (default), fcsv, pp or csv. They have the spread over templates, but those
            of pp.
    """
    suffix = f".{format.removeprefix('.')}"
    shape_landmarks.writer_of(Path(f"landmarks{suffix}"))
    collection = collections.Collection.open(folder)
    template = collection.chosen_template(collection.rows())
    files = landmark_files(marks, collection, template)
    patch_files = {} if patches is None else landmark_files(patches, collection, template)
    with talk.progress() as tell:
        record = write_all(
            collection, files, to, tell, suffix, curve_points, force, patch_files, surface_points, slide
        )
    talk.result(record, lambda: say_landmarks(record))


def landmark_files(marks: Path, collection: collections.Collection, template: str | None) -> dict[str, Path]:
    """Find the file of landmarks of each shape that has one, in the order of the shapes; `InputError` for none."""
    names = collection.names
    present = {legible(path.name): path for path in (marks.iterdir() if marks.is_dir() else [marks])}
    of = {name: [present[name + suffix] for suffix in SUFFIXES if name + suffix in present] for name in names}
    files = {name: paths[0] for name, paths in of.items() if paths}
    if not files and isfile(marks):
        if template is None:
            raise InputError(
                f"{marks}: it is not known of which shape; name it like one, or give the template (--template)"
            )
        return {template: marks}
    if not files:
        raise InputError(
            f"{marks}: no landmarks of a shape of the collection; give a folder of files such as {names[0]}.mrk.json"
        )
    return files


def write_all(
    collection: collections.Collection,
    files: dict[str, Path],
    to: Path,
    tell: Tell,
    suffix: str = ".mrk.json",
    curve_points: int | None = None,
    force: bool = True,
    patches: dict[str, Path] | None = None,
    surface_points: int = 0,
    slide: bool = False,
) -> dict[str, Any]:
    """Write the landmarks of all shapes and their tables; return what was written, as plain values."""
    rows = collection.rows()
    ends = {*files, collection.chosen_template(rows)}
    points: dict[str, isomatch.Landmarks] = {}
    lost: set[str] = set()
    failed: dict[str, IsomatchError] = {}
    slid: dict[str, dict[str, float]] = {}
    last = to / "landmarks.tps"
    tables = [to / "landmarks.csv", last]
    earlier = [*tables, *(to / f"{name}{suffix}" for name in collection.names)]
    with made_folder(to), claimed(last, [] if force else earlier):
        for name, carried in collections.collected_landmarks(
            collection, files, curve_points, patches=patches, surface_points=surface_points, failed=failed
        ):
            points[name] = carried
            tell(f"landmarks of {name}", len(points) / len(collection.names))
        if slide:
            tell("sliding", 1.0)
            moved, result = collections.slid_landmarks(collection, points)
            points |= moved
            columns = (
                result.moved.mean(axis=1),
                result.moved.max(axis=1),
                result.energy_before,
                result.energy_after,
            )
            slid = {name: dict(zip(SLID[1:], map(float, each))) for name, *each in zip(moved, *columns)}
            write_csv(
                to / "landmarks_slid.csv", ({"specimen": name, **each} for name, each in slid.items()), SLID
            )
        for name, carried in points.items():
            lost |= {*isomatch.write_landmarks(to / f"{name}{suffix}", carried)}
        left_out = {x.name: x for x in collections.landmarks_left_out(collection, files, curve_points)}
        write_csv(to / "landmarks_errors.csv", _errors(points, left_out), ERRORS)
        first = next(iter(points.values()))
        turned = rows.reflected(points)
        scales = collections.scales_of(collection.units, rows)
        axes = next((each.axes for each in points.values() if each.axes), None)
        alike = {
            name: _in_table(each.turned(axes), scales.get(name, 1.0), name in turned)
            for name, each in points.items()
            if each.is_like(first)
        }
        collections.draw_landmarks(to / "landmarks.png", collection, points)
        for table in tables:
            shape_landmarks.write_specimens(table, alike)
        if to.resolve() == collection.layout.landmarks.resolve():
            collections.keep_files(collection.layout, (path for path in earlier if path.exists()))
    spread = {name: each.spread for name, each in points.items() if np.isfinite(each.spread).any()}
    errors = {name: each.expected_error for name, each in points.items()}
    return {
        "folder": str(to),
        "format": suffix,
        "templates": sorted(files),
        "shapes": list(points),
        "expected_error": {n: float(np.nanmedian(e)) for n, e in errors.items() if np.isfinite(e).any()},
        "mean_spread": {name: float(np.nanmean(each)) for name, each in spread.items()},
        "largest_spread": {name: points[name].names[np.nanargmax(each)] for name, each in spread.items()},
        "left_out_errors": {name: _described(each) for name, each in left_out.items()},
        "not_written": sorted(lost),
        "other_landmarks": [name for name in points if name not in alike],
        "reflected": turned,
        "axes": axes,
        "half_turned": [name for name, each in points.items() if each.axes != axes],
        "doubtful": [pair for pair in rows.pairs if rows.is_doubtful(pair) and not ends.isdisjoint(pair)],
        "failed": {name: str(error) for name, error in failed.items()},
        "slid": slid,
        "not_slid": [name for name in points if slid and name not in slid],
        "left_out": [name for name in collection.names if name not in {*points, *failed}],
    }


def say_landmarks(record: dict[str, Any]) -> None:
    """Print what `write_all` did."""
    n = len(record["templates"])
    start = f"wrote the landmarks of {len(record['shapes'])} shapes to {record['folder']}"
    say(f"{start}, from {n} template{'s' * (n != 1)}")
    for name, mean in record["mean_spread"].items():
        say(f"{name}: mean spread {mean:.4g}, largest at {record['largest_spread'][name]}")
    for name, error in record["left_out_errors"].items():
        say(
            f"{name}, carried from the others: error {error['mean']:.4g} in the mean, at most {error['largest']:.4g} at "
            f"{error['at']}"
        )
    for name, error in record["failed"].items():
        say(f"{name} is left out: {error}", "bold red")
    if slid := list(record["slid"].values()):
        mean, before, after = (float(np.mean([each[key] for each in slid])) for key in (SLID[1], *SLID[3:]))
        say(
            f"slid by {mean:.4g} in the mean; bending energy {before:.4g}, then {after:.4g}: see landmarks_slid.csv"
        )
    doubtful, half_turned = [" and ".join(pair) for pair in record["doubtful"]], record["half_turned"]
    for told, names, style in (
        (f"not written, because {record['format']} has no place for them:", record["not_written"], ""),
        ("with other landmarks or curves, so not in the tables:", record["other_landmarks"], ""),
        ("reflected in the tables, as they were matched:", record["reflected"], ""),
        (f"brought into {record['axes']} in the tables, from the space of their files:", half_turned, ""),
        ("not used, because they are doubtful: the maps of", doubtful, "bold red"),
        ("not slid, as they have other landmarks, or few have a place:", record["not_slid"], ""),
        ("no map that is sure leads to:", record["left_out"], "bold red"),
    ):
        if names:
            say(f"{told} {', '.join(names)}", style)


def _in_table(landmarks: isomatch.Landmarks, scale: float, reflected: bool) -> isomatch.Landmarks:
    """Return landmarks in the unit of the collection, and as they were matched."""
    factors = scale * np.array([-1.0 if reflected else 1.0, 1.0, 1.0])
    return replace(landmarks, positions=landmarks.positions * factors)


def _errors(
    points: dict[str, isomatch.Landmarks], left_out: dict[str, collections.LeftOut]
) -> Iterator[dict[str, object]]:
    """Make a line for each landmark of each shape; of those marked by hand, of what the others give."""
    for name, own in points.items():
        marks = left_out[name].carried if name in left_out else own
        errors = left_out[name].error if name in left_out else np.full(len(marks), np.nan)
        columns = marks.expected_error, marks.spread, errors
        for landmark, *values in zip(marks.names, *(column.tolist() for column in columns)):
            cells = ("" if np.isnan(value) else value for value in values)
            yield dict(zip(ERRORS, (name, landmark, *cells)))


def _described(left_out: collections.LeftOut) -> dict[str, Any]:
    """Sum up the errors of a shape that was left out; of none, if nothing has a place."""
    errors = left_out.error[np.isfinite(left_out.error)]
    if not len(errors):
        return {"mean": nan, "median": nan, "largest": nan, "at": ""}
    largest = float(errors.max())
    worst = left_out.carried.names[int(np.nanargmax(left_out.error))]
    return {"mean": float(errors.mean()), "median": float(np.median(errors)), "largest": largest, "at": worst}
