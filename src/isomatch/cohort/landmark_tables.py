"""Landmarks of some shapes of a collection, carried to all others, with their tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import nan
from os.path import isfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from isomatch._core.errors import InputError
from isomatch._core.files import claimed, legible, made_folder
from isomatch._core.stage_timer import Progress
from isomatch._core.texts import write_csv
from isomatch.cohort.collection import Collection
from isomatch.cohort.landmarks import LeftOut, collected_landmarks, draw_landmarks, landmarks_left_out
from isomatch.cohort.listener import Listener
from isomatch.cohort.map_file import keep_files
from isomatch.cohort.outliers import scales_of
from isomatch.cohort.shape_statistics import slid_semilandmarks
from isomatch.io import read_mesh
from isomatch.landmarks import Landmarks, write_landmarks, write_specimens, writer_of
from isomatch.surfaces import reflected

SUFFIXES = (".mrk.json", ".json", ".fcsv", ".pp", ".csv", ".txt")
ERRORS = ("specimen", "landmark", "expected_error", "spread", "error")  # columns of the table of errors
LEAST_PLACED = 0.5  # share of the landmarks of a shape that slide
LEAST_SURE = 3  # landmarks that are named


@dataclass(frozen=True)
class Semilandmarks:
    """What is carried beside landmarks, and whether it slides.

    Parameters
    ----------
    curve_points : int, optional
        Number of equally spaced points on each curve; by default as many as it was drawn with.
    patches : Path, optional
        Surface semilandmarks of the shapes that have landmarks, in files like theirs.
    surface_points : int
        How many more to spread evenly over the first of these shapes.
    slide : bool
        Slide points of curves and surfaces so that thin-plate splines from the mean shape bend least.
    """

    curve_points: int | None = None
    patches: Path | None = None
    surface_points: int = 0
    slide: bool = False


class Slid(NamedTuple):
    """How far the landmarks of a shape slid, and the bending energy from the mean shape."""

    specimen: str
    mean: float
    largest: float
    energy_before: float
    energy_after: float


class LeftOutError(NamedTuple):
    """How far off the others carry the landmarks of a template, in its units; nan if none has a place."""

    mean: float
    median: float
    largest: float
    at: str  # name of the landmark


@dataclass(frozen=True)
class LandmarkTables:
    """What `write_landmark_tables` has written; errors are in the units of the files."""

    folder: Path
    format: str  # suffix of the files
    templates: list[str]  # shapes whose landmarks are known
    shapes: list[str]  # those that have a file
    expected_error: dict[str, float]  # median of each shape
    check_first: dict[str, float]  # of the landmarks that are least sure
    mean_spread: dict[str, float]  # of each shape, over the templates
    largest_spread: dict[str, str]  # landmark where that is largest
    left_out_errors: dict[str, LeftOutError]  # of each template
    not_written: list[str]  # what the format has no place for
    other_landmarks: list[str]  # shapes that have others, and so are not in the tables
    reflected: list[str]  # those that are reflected in the tables
    axes: str | None  # the space of the tables
    half_turned: list[str]  # shapes that were brought into it
    doubtful: list[tuple[str, str]]  # maps that are not used
    slid: list[Slid]
    not_slid: list[str]  # shapes that have other landmarks, or few with a place
    left_out: list[str]  # those that failed, or that no sure map leads to

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        slid = [each._asdict() for each in self.slid]
        errors = {name: each._asdict() for name, each in self.left_out_errors.items()}
        return {**vars(self), "folder": str(self.folder), "left_out_errors": errors, "slid": slid}


def write_landmark_tables(
    folder: str | Path,
    landmarks: str | Path,
    to: str | Path,
    *,
    semilandmarks: Semilandmarks | None = None,
    format: str = "mrk.json",
    force: bool = False,
    progress: Progress | None = None,
) -> LandmarkTables:
    """Carry the landmarks of some shapes of a collection to all others, see `collected_landmarks`, and write tables.

    Parameters
    ----------
    folder : path_like
        The folder of the collection.
    landmarks : path_like
        Folder of the landmarks of some of its shapes, named like them, or one such file; another name is that of the
        template.
    to : path_like
        Folder for a file of each shape, landmarks.csv, landmarks.tps, tables of errors, and landmarks.png.
    semilandmarks, format, force
        As the options of ``isomatch collect landmarks``.
    progress : callable, optional
        Called with each step, and the share that is done.

    Returns
    -------
    LandmarkTables
        What was written.

    Raises
    ------
    InputError
        If there are no landmarks of a shape of the collection.
    FormatError, LandmarkError
        If a file cannot be read or written, or its landmarks are not on the shape.
    """
    suffix = f".{format.removeprefix('.')}"
    writer_of(Path(f"landmarks{suffix}"))
    collection, listener = Collection.open(folder), Listener.of(progress, None)
    files = landmark_files(Path(landmarks), collection, collection.chosen_template(collection.rows()))
    return write_tables(collection, files, Path(to), semilandmarks, listener, suffix, force)


def landmark_files(marks: Path, collection: Collection, template: str | None) -> dict[str, Path]:
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


def write_tables(
    collection: Collection,
    files: Mapping[str, Path],
    to: Path,
    semilandmarks: Semilandmarks | None,
    listener: Listener,
    suffix: str = ".mrk.json",
    force: bool = True,
) -> LandmarkTables:
    """Write the landmarks of all shapes and their tables."""
    rows = collection.rows()
    more, template = semilandmarks or Semilandmarks(), collection.chosen_template(rows)
    ends = {*files, template}
    patches = {} if more.patches is None else landmark_files(more.patches, collection, template)
    given = files, more.curve_points
    points: dict[str, Landmarks] = {}
    lost: set[str] = set()
    last = to / "landmarks.tps"
    tables = [to / "landmarks.csv", last]
    earlier = [*tables, *(to / f"{name}{suffix}" for name in collection.names)]
    with made_folder(to), claimed(last, [] if force else earlier):
        found = collected_landmarks(collection, *given, patches, more.surface_points)
        for name, carried in found:
            points[name] = carried
            listener.tell(f"landmarks of {name}", len(points) / len(collection.names))
        turned = rows.reflected(points)
        slid = _slid(collection, points, turned) if more.slide else []
        if more.slide:
            write_csv(to / "landmarks_slid.csv", (each._asdict() for each in slid), Slid._fields)
        for name, carried in points.items():
            lost |= {*write_landmarks(to / f"{name}{suffix}", carried)}
        left_out = {x.name: x for x in landmarks_left_out(collection, *given)}
        write_csv(to / "landmarks_errors.csv", _errors(points, left_out), ERRORS)
        first = next(iter(points.values()))
        scales = scales_of(collection.units, rows)
        axes = next((each.axes for each in points.values() if each.axes), None)
        alike = {
            name: _in_table(each.turned(axes), scales.get(name, 1.0), name in turned)
            for name, each in points.items()
            if (each.names, each.curves) == (first.names, first.curves)
        }
        draw_landmarks(to / "landmarks.png", collection, points)
        for table in tables:
            write_specimens(table, alike)
        if to.resolve() == collection.layout.landmarks.resolve():
            keep_files(collection.layout, (path for path in earlier if path.exists()))
    spread = {name: each.spread for name, each in points.items() if np.isfinite(each.spread).any()}
    errors = {name: each.expected_error for name, each in points.items()}
    return LandmarkTables(
        folder=to,
        format=suffix,
        templates=sorted(files),
        shapes=list(points),
        expected_error={n: float(np.nanmedian(e)) for n, e in errors.items() if np.isfinite(e).any()},
        check_first=_least_sure(points.values()),
        mean_spread={name: float(np.nanmean(each)) for name, each in spread.items()},
        largest_spread={name: points[name].names[np.nanargmax(each)] for name, each in spread.items()},
        left_out_errors={name: _described(each) for name, each in left_out.items()},
        not_written=sorted(lost),
        other_landmarks=[name for name in points if name not in alike],
        reflected=turned,
        axes=axes,
        half_turned=[name for name, each in points.items() if each.axes != axes],
        doubtful=[pair for pair in rows.pairs if rows.is_doubtful(pair) and not ends.isdisjoint(pair)],
        slid=slid,
        not_slid=sorted({*points}.difference(each.specimen for each in slid)) if more.slide else [],
        left_out=[name for name in collection.names if name not in points],
    )


def _least_sure(points: Iterable[Landmarks]) -> dict[str, float]:
    """Give the landmarks with the largest expected errors, and their medians over the shapes."""
    errors: dict[str, list[float]] = {}
    for each in points:
        for name, error in zip(each.names, each.expected_error.tolist()):
            if np.isfinite(error):
                errors.setdefault(name, []).append(error)
    medians = {name: float(np.median(own)) for name, own in errors.items()}
    return dict(sorted(medians.items(), key=lambda item: -item[1])[:LEAST_SURE])


def _slid(collection: Collection, points: dict[str, Landmarks], turned: list[str]) -> list[Slid]:
    """Slide the landmarks of shapes that have those of the first, at least half with a place; tell how far they slid."""
    first = next(iter(points.values()))
    marks = {name: each for name, each in points.items() if each.placed.mean() >= LEAST_PLACED}
    names = [n for n in marks if (marks[n].names, marks[n].curves) == (first.names, first.curves)]
    signs = np.array([[[-1.0 if name in turned else 1.0, 1.0, 1.0]] for name in names])
    meshes = (read_mesh(collection.paths[name]) for name in names)
    surfaces = [reflected(mesh) if name in turned else mesh for name, mesh in zip(names, meshes)]
    positions = signs * [marks[name].positions for name in names]
    slid = slid_semilandmarks(positions, surfaces, first.curves, first.patch)
    points |= {n: replace(marks[n], positions=at) for n, at in zip(names, signs * slid.positions)}
    far = np.linalg.norm(slid.positions - positions, axis=2)
    columns = np.nanmean(far, axis=1), np.nanmax(far, axis=1), slid.energy_before, slid.energy_after
    return [Slid(*each) for each in zip(names, *(column.tolist() for column in columns))]


def _in_table(landmarks: Landmarks, scale: float, reflected: bool) -> Landmarks:
    """Return landmarks in the unit of the collection, and as they were matched."""
    factors = scale * np.array([-1.0 if reflected else 1.0, 1.0, 1.0])
    return replace(landmarks, positions=landmarks.positions * factors)


def _errors(points: dict[str, Landmarks], left_out: dict[str, LeftOut]) -> Iterator[dict[str, object]]:
    """Make a line for each landmark of each shape; of those marked by hand, of what the others give."""
    for name, own in points.items():
        marks = left_out[name].carried if name in left_out else own
        errors = left_out[name].error if name in left_out else np.full(len(marks), np.nan)
        columns = marks.expected_error, marks.spread, errors
        for landmark, *values in zip(marks.names, *(column.tolist() for column in columns)):
            cells = ("" if np.isnan(value) else value for value in values)
            yield dict(zip(ERRORS, (name, landmark, *cells)))


def _described(left_out: LeftOut) -> LeftOutError:
    """Sum up the errors of a shape that was left out; of none, if nothing has a place."""
    errors = left_out.error[np.isfinite(left_out.error)]
    if not len(errors):
        return LeftOutError(nan, nan, nan, "")
    largest = float(errors.max())
    worst = left_out.carried.names[int(np.nanargmax(left_out.error))]
    return LeftOutError(float(errors.mean()), float(np.median(errors)), largest, worst)
