"""Landmarks of some shapes of a collection, carried to the others, with their tables and pages."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import nan
from os.path import isfile
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError, IsomatchError
from isomatch._core.files import claimed, legible, made_folder
from isomatch._core.skipped import tell_skipped
from isomatch._core.stage_timer import Progress
from isomatch._core.texts import write_csv
from isomatch.cohort.collection import Collection
from isomatch.cohort.finish import surface_as_written
from isomatch.cohort.map_file import keep_files, maps_along, require_unchanged
from isomatch.cohort.plan import Plan
from isomatch.cohort.shape_statistics import Criterion, Slid, slid_semilandmarks
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.specimen_page import Specimen, write_specimen
from isomatch.cohort.study_page import write_page
from isomatch.cohort.workers import Listener
from isomatch.correspondence import Correspondence
from isomatch.io import Asset, read_asset, read_mesh
from isomatch.landmarks import (
    Landmarks,
    join_places,
    median_landmarks,
    spread_on_surface,
    write_landmarks,
    write_specimens,
    writer_of,
)
from isomatch.surfaces import Mesh, reflected
from isomatch.transfer import carry_landmarks

# Suffixes of files of landmarks. If a shape has several files, the one whose suffix comes first here is read.
LANDMARK_SUFFIXES = (".mrk.json", ".json", ".fcsv", ".pp", ".tps", ".csv", ".txt")
# titles of the columns of landmarks_errors.csv
ERROR_COLUMNS = ("specimen", "landmark", "expected_error", "spread", "error")
MIN_PLACED_SHARE = 0.5  # landmarks of a shape slide if at least this share of them has a position; chosen
N_LEAST_SURE = 3  # number of landmarks, and of semilandmarks, that are reported as the least sure; chosen
# Share of the extent of a shape's landmarks: a landmark has the same position in two files if its coordinates differ by
# at most this; chosen.
SAME_PLACE_SHARE = 1e-4


@dataclass(frozen=True)
class Semilandmarks:
    """The semilandmarks that are carried with landmarks, and whether they slide.

    Parameters
    ----------
    curve_points : int, optional
        Number of equally spaced points on each curve; by default as many as it was drawn with.
    patches : Path, optional
        Surface semilandmarks of the shapes that have landmarks, in files like theirs.
    surface_points : int
        Number of further points to spread evenly over the first of these shapes.
    slide : bool
        Slide points of curves and surfaces until shapes differ least from the mean.
    criterion : {"bending", "distance"}
        The measure that is minimised: the bending energy of thin-plate splines from the mean, or
        the Procrustes distance.
    """

    curve_points: int | None = None
    patches: Path | None = None
    surface_points: int = 0
    slide: bool = False
    criterion: Criterion = "bending"


class LeftOutError(NamedTuple):
    """Errors of a template's landmarks as carried from the others, in its units; nan if none."""

    mean: float  # mean distance, over the landmarks, from the given positions; next, their median and largest
    median: float
    largest: float
    at: str  # name of the landmark with the largest error


@dataclass(frozen=True)
class LandmarkTables:
    """Summary of what `write_landmark_tables` wrote; errors are in the units of the files."""

    folder: Path
    format: str  # suffix of the files
    templates: list[str]  # shapes whose landmarks are given
    shapes: list[str]  # shapes that have a file
    expected_error: dict[str, float]  # median over the landmarks of each shape
    check_first: dict[str, float]  # median errors of the least sure landmarks, then semilandmarks
    mean_spread: dict[str, float]  # mean spread of each shape over the templates
    largest_spread: dict[str, str]  # landmark with the largest spread
    # errors of the landmarks of each template, as carried to it from the other templates
    left_out_errors: dict[str, LeftOutError]
    not_written: list[str]  # attributes that the format cannot hold
    other_landmarks: list[str]  # shapes left out: their landmarks are not those of the first shape
    misread_names: list[str]  # shapes whose names the R package geomorph takes for lines of landmarks.tps
    reflected: list[str]  # shapes whose mirror images are in the tables
    axes: str | None  # axes of the space in which the tables are, such as RAS
    half_turned: list[str]  # shapes whose landmarks were turned by half a turn into that space
    doubtful: list[tuple[str, str]]  # pairs whose maps are not used
    slid: list[Slid]
    not_slid: list[str]  # shapes with other landmarks, or with a position for fewer than half of them
    left_out: list[str]  # shapes that failed, or that no sure map leads to
    # file of the page of the shape with the largest expected error, with links to the pages of the previous and the
    # next shape; "" if no page was written
    look_at: str

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        slid = [record._asdict() for record in self.slid]
        errors = {name: error._asdict() for name, error in self.left_out_errors.items()}
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
    """Carry landmarks of some shapes to all others, see `collected_landmarks`, and write tables.

    Parameters
    ----------
    folder : path_like
        The folder of the collection.
    landmarks : path_like
        Folder of the landmarks of some of its shapes, named like them, or one such file; a file
        with another name belongs to the template.
    to : path_like
        Folder for a file of each shape, landmarks.csv, landmarks.tps, tables of errors, and
        views/NAME.html.
    semilandmarks, format, force, progress
        As the options of ``isomatch collect landmarks``; for the progress, see `run`.

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
    known = Snapshot(collection, collection.rows())
    files = landmark_files(Path(landmarks), collection, known.template)
    return write_tables(known, files, Path(to), semilandmarks, listener, suffix, force)


def landmark_files(marks: Path, collection: Plan, template: str | None) -> dict[str, Path]:
    """Find the file of landmarks of each shape that has one, and check that it can be read."""
    names = collection.names
    listed = marks.iterdir() if marks.is_dir() else [marks]
    present = {legible(path.name): path for path in listed if not path.name.startswith(".")}
    found = {name: [present[f] for x in LANDMARK_SUFFIXES if (f := name + x) in present] for name in names}
    files = {name: paths[0] for name, paths in found.items() if paths}
    if not files and isfile(marks):
        if template is None:
            problem = "it is not known of which shape"
            raise InputError(f"{marks}: {problem}; name it like one, or give the template (--template)")
        files = {template: marks}
    if not files:
        remedy = f"give a folder of files such as {names[0]}.mrk.json"
        raise InputError(f"{marks}: no landmarks of a shape of the collection; {remedy}")
    used = {path for paths in found.values() for path in paths} | {*files.values()}
    if others := sorted(path.name for path in present.values() if path not in used):
        tell_skipped(f"{marks}: {', '.join(others)} left out, named like no shape of the collection")
    for name, path in files.items():
        landmarks = Landmarks.read(path, collection.paths[name])
        for other in found.get(name, ())[1:]:
            if not _are_alike(landmarks, other, collection.paths[name]):
                skipped = f"{other.name}, which has others, is left out"
                tell_skipped(f"{name} has the landmarks of {path.name}; {skipped}")
    return files


def _are_alike(landmarks: Landmarks, other: Path, surface: Path) -> bool:
    """Whether another file of a shape has the same landmarks, up to the digits of text."""
    try:
        found = Landmarks.read(other, surface)
    except IsomatchError:
        return False
    size = np.ptp(landmarks.positions[landmarks.placed], axis=0).max() if landmarks.placed.any() else 0.0
    near: dict[str, Any] = {"rtol": 0, "atol": SAME_PLACE_SHARE * size, "equal_nan": True}
    return found.names == landmarks.names and np.allclose(found.positions, landmarks.positions, **near)


def write_tables(
    known: Snapshot,
    files: Mapping[str, Path],
    to: Path,
    semilandmarks: Semilandmarks | None,
    listener: Listener,
    suffix: str = ".mrk.json",
    force: bool = True,
) -> LandmarkTables:
    """Write the landmarks of all shapes and their tables."""
    collection, own_folder = known.plan, known.layout.landmarks
    to = own_folder if to.resolve() == own_folder.resolve() else to
    more, ends = semilandmarks or Semilandmarks(), {*files, known.template}
    patches = {} if more.patches is None else landmark_files(more.patches, collection, known.template)
    given = files, more.curve_points
    points: dict[str, Landmarks] = {}
    lost: set[str] = set()
    last = to / "landmarks.tps"
    tables = [to / "landmarks.csv", last]
    earlier = [*tables, *(to / f"{name}{suffix}" for name in collection.names)]
    with made_folder(to), claimed(last, [] if force else earlier):
        for name, marks in collected_landmarks(collection, *given, patches, more.surface_points):
            points[name] = marks
            listener.tell(f"landmarks of {name}", len(points) / len(collection.names))
        turned = known.rows.reflected(points)
        slid = _slide(collection, points, turned, more.criterion) if more.slide else []
        left_out = {comparison.name: comparison for comparison in landmarks_left_out(collection, *given)}
        first = next(iter(points.values()))
        axes = next((marks.axes for marks in points.values() if marks.axes), None)
        alike = {}  # landmarks of the tables, in one unit, reflected if their shape was matched reflected
        for name, marks in points.items():
            lost |= {*write_landmarks(to / f"{name}{suffix}", marks)}
            if (marks.names, marks.curves) == (first.names, first.curves):
                factors = known.scales.get(name, 1.0) * _signs_of(name, turned)
                own_axes = marks.in_axes(axes)
                alike[name] = replace(own_axes, positions=own_axes.positions * factors)
        if more.slide:
            write_csv(to / "landmarks_slid.csv", (record._asdict() for record in slid), Slid._fields)
        write_csv(to / "landmarks_errors.csv", _error_lines(points, left_out), ERROR_COLUMNS)
        misread = [name for table in tables for name in write_specimens(table, alike)]
        views = _write_views(known, to, points, suffix)
        if to == own_folder:
            keep_files(collection.layout, (path for path in earlier if path.exists()))
            write_page(Snapshot(known.plan, known.plan.rows()))  # pairs might have been matched since
    spread = {name: marks.spread for name, marks in points.items() if np.isfinite(marks.spread).any()}
    errors = {name: marks.expected_error for name, marks in points.items()}
    least_sure = max(views, key=lambda name: np.nanmax(errors[name], initial=0.0), default="")
    return LandmarkTables(
        folder=to,
        format=suffix,
        templates=sorted(files),
        shapes=list(points),
        expected_error={n: float(np.nanmedian(e)) for n, e in errors.items() if np.isfinite(e).any()},
        check_first=_least_sure(points.values()),
        mean_spread={name: float(np.nanmean(values)) for name, values in spread.items()},
        largest_spread={name: points[name].names[np.nanargmax(values)] for name, values in spread.items()},
        left_out_errors={name: _sum_up(comparison) for name, comparison in left_out.items()},
        not_written=sorted(lost),
        other_landmarks=[name for name in points if name not in alike],
        misread_names=misread,
        reflected=turned,
        axes=axes,
        half_turned=[name for name, marks in points.items() if marks.axes != axes],
        doubtful=[x for x in known.rows.pairs if known.rows.is_doubtful(x) and not ends.isdisjoint(x)],
        slid=slid,
        not_slid=sorted({*points}.difference(record.specimen for record in slid)) if more.slide else [],
        left_out=[name for name in collection.names if name not in points],
        look_at=str(to / "views" / f"{least_sure}.html") if views else "",
    )


def _least_sure(points: Iterable[Landmarks]) -> dict[str, float]:
    """Find the landmarks with the largest median errors over the shapes, then semilandmarks."""
    errors, semilandmarks = defaultdict[str, list[float]](list), set[str]()
    for marks in points:
        semilandmarks |= {marks.names[row] for row in marks.semilandmarks}
        for name, error in zip(marks.names, marks.expected_error.tolist()):
            if np.isfinite(error):
                errors[name].append(error)
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    ranked = sorted(medians.items(), key=lambda item: -item[1])
    kinds = ([item for item in ranked if (item[0] in semilandmarks) == is_semi] for is_semi in (False, True))
    return {name: error for kind in kinds for name, error in kind[:N_LEAST_SURE]}


def _slide(
    collection: Plan, points: dict[str, Landmarks], turned: list[str], criterion: Criterion
) -> list[Slid]:
    """Slide the landmarks of shapes that have those of the first, and a place for half of them."""
    first = next(iter(points.values()))
    marks = {name: marks for name, marks in points.items() if marks.placed.mean() >= MIN_PLACED_SHARE}
    names = [n for n in marks if (marks[n].names, marks[n].curves) == (first.names, first.curves)]
    signs = np.array([[_signs_of(name, turned)] for name in names])
    meshes = (read_mesh(collection.paths[name]) for name in names)
    surfaces = [reflected(mesh) if name in turned else mesh for name, mesh in zip(names, meshes)]
    before = np.array([marks[name].positions for name in names])
    joined, place = join_places({name: marks[name] for name in names})
    once, positions = joined[names[0]], signs * [joined[name].positions for name in names]
    slid = slid_semilandmarks(positions, surfaces, once.curves, once.patch, criterion=criterion)
    moved = np.where(np.isfinite(before), (signs * slid.positions)[:, place], np.nan)
    points |= {name: replace(marks[name], positions=places) for name, places in zip(names, moved)}
    return slid.of_each(names, positions)


def _signs_of(name: str, turned: Container[str]) -> FloatArray:
    """Return the factors (3,) of positions that reflect a shape if it was matched reflected."""
    return np.array([-1.0 if name in turned else 1.0, 1.0, 1.0])


def _error_lines(points: dict[str, Landmarks], left_out: dict[str, LeftOut]) -> Iterator[dict[str, object]]:
    """Yield a line for each landmark of each shape; for templates, of what the others give."""
    for name, landmarks in points.items():
        marks = left_out[name].carried if name in left_out else landmarks
        errors = left_out[name].error if name in left_out else np.full(len(marks), np.nan)
        columns = marks.expected_error, marks.spread, errors
        for landmark, *values in zip(marks.names, *(column.tolist() for column in columns)):
            cells = ("" if np.isnan(value) else value for value in values)
            yield dict(zip(ERROR_COLUMNS, (name, landmark, *cells)))


def _sum_up(left_out: LeftOut) -> LeftOutError:
    """Sum up the errors of the landmarks of a template, as carried from the others."""
    errors = left_out.error[np.isfinite(left_out.error)]
    if not len(errors):
        return LeftOutError(nan, nan, nan, "")
    worst = left_out.carried.names[int(np.nanargmax(left_out.error))]
    return LeftOutError(float(errors.mean()), float(np.median(errors)), float(errors.max()), worst)


class LeftOut(NamedTuple):
    """The landmarks of a template as carried from the other templates."""

    name: str
    carried: Landmarks  # carried landmarks, with expected errors and spread
    error: FloatArray  # (m,) distance from the known ones, in units of the shape; nan without a place


def collected_landmarks(
    collection: Plan,
    files: Mapping[str, str | Path],
    curve_points: int | None = None,
    patches: Mapping[str, str | Path] | None = None,
    surface_points: int = 0,
) -> Iterator[tuple[str, Landmarks]]:
    """Carry the landmarks of some shapes, the templates, to all others; yield each shape with them.

    A template has its own landmarks, with equally spaced points on curves; another shape has the
    medians over templates, with their ``spread`` and ``expected_error``. The map of a template and
    a shape is used or, if they are not matched, the maps on the shortest path between them, whose
    error is the root of the sum of squares. Doubtful maps are not used, see `Rows.is_doubtful`. A
    shape that no other map leads to is left out; one that fails is left out with a warning.

    ``files`` are the landmarks of each template, by name; ``patches`` are surface semilandmarks,
    all in one order, which are named surface-1, surface-2, …. Each curve has ``curve_points``, or
    as many as it was drawn with; ``surface_points`` are spread over the first template, and carried
    to the others.
    """
    templates = _Templates(collection, files, curve_points)
    templates.add_patches(patches or {}, surface_points)
    for name in collection.names:
        try:
            marks = templates.landmarks_of(name) if name in files else templates.carry_to(name, files)
        except IsomatchError as error:
            if name in files:
                raise
            tell_skipped(f"{name} is left out: {error}")
            continue
        if marks is not None:
            yield name, marks


def landmarks_left_out(
    collection: Plan, files: Mapping[str, str | Path], curve_points: int | None = None
) -> Iterator[LeftOut]:
    """Carry to each template the landmarks of all others, to know the errors of unmarked shapes."""
    templates = _Templates(collection, files, curve_points)
    for name in files:
        carried = templates.carry_to(name, [other for other in files if other != name])
        if carried is not None:
            errors = carried.positions - _positions(templates.landmarks_of(name), carried.names)
            yield LeftOut(name, carried, np.asarray(np.linalg.norm(errors, axis=1)))


def _positions(marks: Landmarks, names: tuple[str, ...]) -> FloatArray:
    """Return the positions of named landmarks, nan where missing."""
    if marks.names == names:
        return marks.positions
    place = dict(zip(marks.names, marks.positions))
    nowhere = np.full(3, np.nan)
    return np.array([place.get(name, nowhere) for name in names]).reshape(-1, 3)


class _Templates:
    """The shapes that have landmarks, which they give to others."""

    def __init__(self, collection: Plan, files: Mapping[str, str | Path], n_points: int | None) -> None:
        if unknown := [name for name in files if name not in collection.paths]:
            where = f"{', '.join(unknown)}: no shapes of {collection.folder}"
            raise InputError(f"{where}; files are named like shapes")
        if not files:
            raise InputError("no landmarks; give a file for one shape of the collection or more")
        require_unchanged(collection.layout, ["maps"])
        self._collection, self._curve_points = collection, n_points
        self._rows = collection.rows()
        self._read = lru_cache(len(files) + 2)(lambda name: read_asset(collection.paths[name]))
        self._marks = {name: Landmarks.read(path, self._read(name)) for name, path in files.items()}

    def add_patches(self, files: Mapping[str, str | Path], surface_points: int) -> None:
        """Append surface semilandmarks: from a file for each template, or spread over the first."""
        if files and set(files) != set(self._marks):
            raise InputError("patches: give those of all shapes that have landmarks, and of no others")
        for name, path in files.items():
            semilandmarks = Landmarks.read(path, self._read(name)).in_axes(self._marks[name].axes)
            self._marks[name] = self._marks[name].with_patch(semilandmarks.positions)
        if surface_points:
            first, *others = self._marks
            start, marks = self._read(first), self._marks[first]
            spread = spread_on_surface(_triangulate(start), surface_points, marks.positions[marks.placed])
            self._marks[first] = marks.with_patch(spread)
            for name in others:
                found, _ = self._map(first, name)
                patch = np.full_like(spread, np.nan)
                if found is not None:
                    patch = carry_landmarks(found, start, self._read(name), Landmarks(spread)).positions
                self._marks[name] = self._marks[name].with_patch(patch)

    def landmarks_of(self, name: str) -> Landmarks:
        """Return the landmarks of a template, with equally spaced points on its curves."""
        shape = self._read(name)
        itself = Correspondence(range(len(shape.points)), len(shape.points))
        return carry_landmarks(itself, shape, shape, self._marks[name], curve_points=self._curve_points)

    def carry_to(self, name: str, templates: Iterable[str]) -> Landmarks | None:
        """Return the median of what templates give a shape; None if no sure map leads to it."""
        found = []
        for template in templates:
            template_map, error = self._map(template, name)
            if template_map is not None:
                given = self._read(template), self._read(name), self._marks[template]
                how: dict[str, Any] = {"curve_points": self._curve_points, "expected_error": error}
                found.append(carry_landmarks(template_map, *given, **how))
        return median_landmarks(found, _triangulate(self._read(name))) if found else None

    def _map(self, source: str, target: str) -> tuple[Correspondence | None, FloatArray | None]:
        """Compose the shortest path of sure maps, with its expected error; None without a path."""
        path = self._rows.path(source, target)
        if path is None:
            return None, None
        return maps_along(self._collection.layout, path, lambda name: _triangulate(self._read(name)))


def _triangulate(shape: Asset) -> Mesh:
    return Mesh(shape.placed_points, shape.polygons.triangles)


def _write_views(known: Snapshot, to: Path, found: Mapping[str, Landmarks], suffix: str) -> list[str]:
    """Write a page for each shape whose surface is written, with its landmarks in 3D; return the names."""
    layout, template = known.layout, known.template
    errors = [np.delete(marks.expected_error, marks.semilandmarks) for marks in found.values()]
    high = float(np.nanmax(np.concatenate(errors), initial=0.0)) or 1.0

    def specimen(name: str) -> Specimen:
        marks = found.get(name)
        if marks is not None:
            factors = known.scales.get(name, 1.0) * _signs_of(name, known.reflected)
            marks = replace(marks, positions=marks.positions * factors)
        corresponded = read_mesh(layout.corresponded(name))
        return Specimen(name, surface_as_written(known, name), corresponded, marks)

    names = [name for name in found if layout.corresponded(name).exists()]
    if template is None or not layout.corresponded(template).exists():
        return []
    beside = specimen(template)
    is_inside = to == layout.landmarks
    (to / "views").mkdir(exist_ok=True)
    for before, name, after in zip(["", *names], names, [*names[1:], ""]):
        around = {f"previous: {before}": before, f"next: {after}": after}
        links = {words: f"{quote(other)}.html" for words, other in around.items() if other}
        links["landmarks"] = f"../{quote(name)}{suffix}"
        if is_inside:
            links |= {"mesh": f"../../corresponded/{quote(name)}.ply", "all shapes": "../../index.html"}
        write_specimen(to / "views" / f"{name}.html", specimen(name), beside, links, high)
    return names
