"""``isomatch collect landmarks`` and ``--landmarks``: landmarks of some shapes of a collection, carried to all others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import nan
from os.path import isfile
from pathlib import Path
from typing import Any

import numpy as np
from cyclopts import Parameter

import isomatch
import isomatch.landmarks as shape_landmarks
from isomatch import cohort
from isomatch._core.errors import InputError
from isomatch._core.files import claimed, legible, made_folder
from isomatch._core.texts import write_csv
from isomatch.cli.inputs import Force
from isomatch.cli.terminal import TALK, Talk, Tell, say
from isomatch.cohort.shape_statistics import slid_semilandmarks
from isomatch.surfaces import reflected


@Parameter(name="*")
@dataclass(frozen=True)
class Semilandmarks:
    """What is carried beside landmarks, and whether it slides.

    Args:
        curve_points: Number of equally spaced points on each curve; by default as many as it was drawn with.
        patches: Surface semilandmarks of the shapes that have landmarks, in files like theirs.
        surface_points: How many more to spread evenly over the first of these shapes.
        slide: Slide points of curves and surfaces so that thin-plate splines from the mean shape bend least.
    """

    curve_points: int | None = None
    patches: Path | None = None
    surface_points: int = 0
    slide: bool = False


SUFFIXES = (".mrk.json", ".json", ".fcsv", ".pp", ".csv", ".txt")
ERRORS = ("specimen", "landmark", "expected_error", "spread", "error")  # columns of the table of errors
LEAST_PLACED = 0.5  # share of the landmarks of a shape that slide
LEAST_SURE = 3  # landmarks that are named
SLID = ("specimen", "mean", "largest", "energy_before", "energy_after")  # columns of that of distances


def landmarks(
    folder: Path,
    marks: Path,
    to: Path,
    /,
    *,
    format: str = "mrk.json",
    semilandmarks: Semilandmarks | None = None,
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
            landmarks_slid.csv how far points slid, and bending energies.
        format: Suffix of the files: mrk.json (default), fcsv, pp or csv. They have the spread over templates, but those
            of pp.
    """
    suffix = f".{format.removeprefix('.')}"
    shape_landmarks.writer_of(Path(f"landmarks{suffix}"))
    collection = cohort.Collection.open(folder)
    files = landmark_files(marks, collection, collection.chosen_template(collection.rows()))
    with talk.progress() as tell:
        record = write_all(collection, files, to, tell, semilandmarks, suffix, force)
    talk.result(record, lambda: say_landmarks(record))


def landmark_files(marks: Path, collection: cohort.Collection, template: str | None) -> dict[str, Path]:
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
    collection: cohort.Collection,
    files: dict[str, Path],
    to: Path,
    tell: Tell,
    semilandmarks: Semilandmarks | None,
    suffix: str = ".mrk.json",
    force: bool = True,
) -> dict[str, Any]:
    """Write the landmarks of all shapes and their tables; return what was written, as plain values."""
    rows = collection.rows()
    more, template = semilandmarks or Semilandmarks(), collection.chosen_template(rows)
    ends = {*files, template}
    patches = {} if more.patches is None else landmark_files(more.patches, collection, template)
    given = files, more.curve_points
    points: dict[str, isomatch.Landmarks] = {}
    lost: set[str] = set()
    last = to / "landmarks.tps"
    tables = [to / "landmarks.csv", last]
    earlier = [*tables, *(to / f"{name}{suffix}" for name in collection.names)]
    with made_folder(to), claimed(last, [] if force else earlier):
        found = cohort.collected_landmarks(collection, *given, patches, more.surface_points)
        for name, carried in found:
            points[name] = carried
            tell(f"landmarks of {name}", len(points) / len(collection.names))
        turned = rows.reflected(points)
        slid = _slid(collection, points, turned) if more.slide else []
        if more.slide:
            write_csv(to / "landmarks_slid.csv", slid, SLID)
        for name, carried in points.items():
            lost |= {*isomatch.write_landmarks(to / f"{name}{suffix}", carried)}
        left_out = {x.name: x for x in cohort.landmarks_left_out(collection, *given)}
        write_csv(to / "landmarks_errors.csv", _errors(points, left_out), ERRORS)
        first = next(iter(points.values()))
        scales = cohort.scales_of(collection.units, rows)
        axes = next((each.axes for each in points.values() if each.axes), None)
        alike = {
            name: _in_table(each.turned(axes), scales.get(name, 1.0), name in turned)
            for name, each in points.items()
            if (each.names, each.curves) == (first.names, first.curves)
        }
        cohort.draw_landmarks(to / "landmarks.png", collection, points)
        for table in tables:
            shape_landmarks.write_specimens(table, alike)
        if to.resolve() == collection.layout.landmarks.resolve():
            cohort.keep_files(collection.layout, (path for path in earlier if path.exists()))
    spread = {name: each.spread for name, each in points.items() if np.isfinite(each.spread).any()}
    errors = {name: each.expected_error for name, each in points.items()}
    return {
        "folder": str(to),
        "format": suffix,
        "templates": sorted(files),
        "shapes": list(points),
        "expected_error": {n: float(np.nanmedian(e)) for n, e in errors.items() if np.isfinite(e).any()},
        "check_first": _least_sure(points.values()),
        "mean_spread": {name: float(np.nanmean(each)) for name, each in spread.items()},
        "largest_spread": {name: points[name].names[np.nanargmax(each)] for name, each in spread.items()},
        "left_out_errors": {name: _described(each) for name, each in left_out.items()},
        "not_written": sorted(lost),
        "other_landmarks": [name for name in points if name not in alike],
        "reflected": turned,
        "axes": axes,
        "half_turned": [name for name, each in points.items() if each.axes != axes],
        "doubtful": [pair for pair in rows.pairs if rows.is_doubtful(pair) and not ends.isdisjoint(pair)],
        "slid": slid,
        "not_slid": sorted({*points}.difference(row["specimen"] for row in slid)) if more.slide else [],
        "left_out": [name for name in collection.names if name not in points],
    }


def _least_sure(points: Iterable[isomatch.Landmarks]) -> dict[str, float]:
    """Give the landmarks with the largest expected errors, and their medians over the shapes."""
    errors: dict[str, list[float]] = {}
    for each in points:
        for name, error in zip(each.names, each.expected_error.tolist()):
            if np.isfinite(error):
                errors.setdefault(name, []).append(error)
    medians = {name: float(np.median(own)) for name, own in errors.items()}
    return dict(sorted(medians.items(), key=lambda item: -item[1])[:LEAST_SURE])


def say_landmarks(record: dict[str, Any]) -> None:
    """Print what `write_all` did."""
    n = len(record["templates"])
    start = f"wrote the landmarks of {len(record['shapes'])} shapes to {record['folder']}"
    say(f"{start}, from {n} template{'s' * (n != 1)}")
    if first := record["check_first"]:
        which = ", ".join(f"{name} ({error:.3g})" for name, error in first.items())
        say(
            f"check first, by their expected errors in the units of the files: {which}; look at landmarks.png"
        )
    for name, mean in record["mean_spread"].items():
        say(f"{name}: mean spread {mean:.4g}, largest at {record['largest_spread'][name]}")
    for name, error in record["left_out_errors"].items():
        say(
            f"{name}, carried from the others: error {error['mean']:.4g} in the mean, at most {error['largest']:.4g} at "
            f"{error['at']}"
        )
    if slid := record["slid"]:
        mean, _, before, after = (float(np.mean([each[column] for each in slid])) for column in SLID[1:])
        say(f"slid by {mean:.4g} in the mean; mean bending energy {before:.4g}, now {after:.4g}")
    doubtful, half_turned = [" and ".join(pair) for pair in record["doubtful"]], record["half_turned"]
    for told, names, style in (
        (f"not written, because {record['format']} has no place for them:", record["not_written"], ""),
        ("with other landmarks or curves, so not in the tables:", record["other_landmarks"], ""),
        ("reflected in the tables, as they were matched:", record["reflected"], ""),
        (f"brought into {record['axes']} in the tables, from the space of their files:", half_turned, ""),
        ("not used, because they are doubtful: the maps of", doubtful, "bold red"),
        ("not slid, as they have other landmarks, or few have a place:", record["not_slid"], "bold red"),
        ("failed, or no map that is sure leads to:", record["left_out"], "bold red"),
    ):
        if names:
            say(f"{told} {', '.join(names)}", style)


def _slid(
    collection: cohort.Collection, points: dict[str, isomatch.Landmarks], turned: list[str]
) -> list[dict[str, Any]]:
    """Slide the landmarks of shapes that have those of the first, at least half with a place; tell how far they slid."""
    first = next(iter(points.values()))
    marks = {name: each for name, each in points.items() if each.placed.mean() >= LEAST_PLACED}
    names = [n for n in marks if (marks[n].names, marks[n].curves) == (first.names, first.curves)]
    signs = np.array([[[-1.0 if name in turned else 1.0, 1.0, 1.0]] for name in names])
    meshes = (isomatch.read_mesh(collection.paths[name]) for name in names)
    surfaces = [reflected(mesh) if name in turned else mesh for name, mesh in zip(names, meshes)]
    positions = signs * [marks[name].positions for name in names]
    slid = slid_semilandmarks(positions, surfaces, first.curves, first.patch)
    points |= {n: replace(marks[n], positions=at) for n, at in zip(names, signs * slid.positions)}
    far = np.linalg.norm(slid.positions - positions, axis=2)
    columns = np.nanmean(far, axis=1), np.nanmax(far, axis=1), slid.energy_before, slid.energy_after
    return [dict(zip(SLID, each)) for each in zip(names, *(column.tolist() for column in columns))]


def _in_table(landmarks: isomatch.Landmarks, scale: float, reflected: bool) -> isomatch.Landmarks:
    """Return landmarks in the unit of the collection, and as they were matched."""
    factors = scale * np.array([-1.0 if reflected else 1.0, 1.0, 1.0])
    return replace(landmarks, positions=landmarks.positions * factors)


def _errors(
    points: dict[str, isomatch.Landmarks], left_out: dict[str, cohort.LeftOut]
) -> Iterator[dict[str, object]]:
    """Make a line for each landmark of each shape; of those marked by hand, of what the others give."""
    for name, own in points.items():
        marks = left_out[name].carried if name in left_out else own
        errors = left_out[name].error if name in left_out else np.full(len(marks), np.nan)
        columns = marks.expected_error, marks.spread, errors
        for landmark, *values in zip(marks.names, *(column.tolist() for column in columns)):
            cells = ("" if np.isnan(value) else value for value in values)
            yield dict(zip(ERRORS, (name, landmark, *cells)))


def _described(left_out: cohort.LeftOut) -> dict[str, Any]:
    """Sum up the errors of a shape that was left out; of none, if nothing has a place."""
    errors = left_out.error[np.isfinite(left_out.error)]
    if not len(errors):
        return {"mean": nan, "median": nan, "largest": nan, "at": ""}
    largest = float(errors.max())
    worst = left_out.carried.names[int(np.nanargmax(left_out.error))]
    return {"mean": float(errors.mean()), "median": float(np.median(errors)), "largest": largest, "at": worst}
