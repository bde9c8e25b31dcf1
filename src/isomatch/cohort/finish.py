"""The results of a run: surfaces in the topology of the template, tables, a page, and exports."""

from __future__ import annotations

import time
from collections.abc import Container, Iterable, Iterator
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import asdict, replace
from functools import lru_cache, partial
from hashlib import blake2b
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, TypeAlias
from urllib.parse import quote

import numpy as np

from isomatch._core.errors import FormatError, InputError, IsomatchError
from isomatch._core.files import claimed, made_folder, replaced, staged, writing
from isomatch.cohort.collection import Collection
from isomatch.cohort.ledger import (
    MAX_INCONSISTENCY,
    Ledger,
    Pair,
    ShapeRow,
    SurfaceRow,
    read_ledgers,
    writing_ledger,
)
from isomatch.cohort.map_file import (
    as_matched,
    changed_files,
    digest_of,
    maps_along,
    put_files,
    require_unchanged,
)
from isomatch.cohort.plan import NAME_SEPARATOR, Entry, Layout, identity_of_map
from isomatch.cohort.shape_statistics import MEASURED, doubtful_positions
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.specimen_page import Specimen, camera_like, write_specimen
from isomatch.cohort.study_page import write_page, write_table
from isomatch.cohort.unusual_shapes import NOT_UNLIKE
from isomatch.cohort.workers import Task, Workers, workers_of
from isomatch.correspondence import Correspondence, WrapQuality, median_map, wrap
from isomatch.io import Asset, Attribute, Frame, Polygons, mesh_from, read_asset, read_mesh, write_asset
from isomatch.surfaces import Mesh, reflected
from isomatch.visualization import camera_of, position_colours, surface_image, to_screen

SURFACES_PER_TASK = 4  # surfaces that a worker writes in one task; chosen
N_COMPARED_VERTICES = 1000  # number of vertices by which shapes are compared to find outliers; chosen
MAX_COMPARED_SHAPES = 2000  # of more shapes, every second, third … is compared, at most this number; chosen
SAVE_INTERVAL = 60.0  # seconds between two writings of shapes.csv, so that a killed run loses little; chosen
# Largest number of compositions of maps, each through another shape, that lead from the template to a surface: it is
# the median of these and of the direct map; chosen.
MAX_WAYS = 20
THUMBNAIL_SIZE, MARGIN = 300, 6  # pixels along a side of a thumbnail, and of its border; chosen


def finish(
    collection: Collection,
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[SurfaceRow]:
    """Write shapes in the template's topology, ``shapes.csv``, ``pairs.csv`` and ``index.html``.

    A shape is written if it is matched with the template, in either direction, and only if its maps
    or its file changed. Often it is also matched with shapes that are matched with the template.
    Then the median on the surface of the images by all these ways is taken, see `median_map`,
    without doubtful maps. Vertices without an image are placed by those around them, see
    `isomatch.wrap`. A shape that is not matched with the template, as in a chain, gets the
    composition of the maps on the shortest path of sure ones; in a ring closed by sure maps, both
    ways round are combined unless they are far apart. Files of shapes that were removed, or are not
    matched any more, are removed.

    Yields the line in ``shapes.csv`` of each surface that is written; ``again`` is what was wrong
    with its former file. Other arguments are those of `Collection.run`.
    """
    known = Snapshot(collection, collection.rows())
    layout, template, lines = known.layout, known.template, known.surface_rows()
    plans = [] if template is None else _plan_surfaces(known, template)
    kept = known.names if template is None else [plan.entry.name for plan in plans]
    with claimed(layout.shapes_table), writing_ledger(layout.ledger()) as ledger:
        _remove_others(known, set(kept), lines, ledger)
        if template is not None:
            for folder in ("corresponded", "thumbnails", "views"):
                with writing(layout.folder / folder):
                    (layout.folder / folder).mkdir(exist_ok=True)
            changed = changed_files(layout, known.rows, ["corresponded"])
            unchanged = _unchanged_surfaces(known, changed)
            write = partial(_write_surface, layout, known.entry(template))
            todo = [plan for plan in plans if not _is_written(plan, lines, unchanged)]
            parts = (todo[i : i + SURFACES_PER_TASK] for i in range(0, len(todo), SURFACES_PER_TASK))
            saved = time.monotonic()
            with workers_of(executor, jobs, time_limit) as workers:
                for plan, attempt in workers.completed(Task(tuple(part), write) for part in parts):
                    name, file = plan.entry.name, layout.corresponded(plan.entry.name)
                    lines[name] = SurfaceRow(name=name, key=plan.key, error=attempt.error)
                    if attempt.result:
                        lines[name], digest = attempt.result
                        put_files(ledger, layout, {file: digest})
                        unchanged.add(name)
                    if time.monotonic() > saved + SAVE_INTERVAL:
                        SurfaceRow.write(layout.shapes_table, lines.values())
                        saved = time.monotonic()
                    again = f"its file {changed[file]}" if file in changed else ""
                    yield replace(lines[name], again=again)
            _tell_sides(known, lines)
            _tell_unreached(known, set(kept), lines)
            written = [plan.entry.name for plan in plans if _is_written(plan, lines, unchanged)]
            _tell_unlike(layout, written, lines)
            SurfaceRow.write(layout.shapes_table, lines.values())
    write_table(known.rows, layout.table)
    write_page(known)


def surface_as_written(known: Snapshot, name: str) -> Mesh:
    """Return the surface of a file as it is written: reflected, and in the common unit."""
    entry = known.entry(name)
    mesh = reflected(_mesh(entry)) if entry.reflected else _mesh(entry)
    return mesh.moved(known.scales.get(name, 1.0) * mesh.vertices)


def surfaces_written(collection: Collection) -> list[str]:
    """List the shapes that are written in the template's topology by their present maps."""
    known = Snapshot(collection, collection.rows())
    if known.template is None:
        return []
    plans, lines = _plan_surfaces(known, known.template), known.surface_rows()
    unchanged = _unchanged_surfaces(known, changed_files(known.layout, known.rows, ["corresponded"]))
    return [plan.entry.name for plan in plans if _is_written(plan, lines, unchanged)]


def _plan_surfaces(known: Snapshot, template: str) -> list[PlannedSurface]:
    rows, names, is_ring = known.rows, known.names, known.plan.pairs == "ring"
    entries = {name: known.entry(name) for name in names}
    current = {frozenset(pair): row for pair, row in rows.pairs.items() if rows.is_current(pair)}
    keys = {ends: identity_of_map(row) for ends, row in current.items()}
    sure = {frozenset(pair) for pair in rows.pairs if frozenset(pair) in keys and not rows.is_doubtful(pair)}
    linked = [name for name in names if {template, name} in sure]
    template_key = rows.shapes.get(template, ShapeRow(state="todo")).key
    plans = [PlannedSurface(entries[template], None, template_key)]
    start = names.index(template) if is_ring else 0
    ring = [*names[start:], *names[:start]]
    around = [frozenset(leg) for leg in pairwise([*ring, template])]
    is_closed = is_ring and sure.issuperset(around)
    if is_closed:  # in a closed ring, each surface depends on all maps
        key = _hash_of(keys[leg] for leg in around)
        in_order = tuple(entries[name] for name in ring)
        plans = [plans[0]._replace(key=f"{template_key} {key}", ways=(in_order[1:],))]
        for i, entry in enumerate(in_order[1:], 1):
            both = sorted((in_order[1:i], in_order[:i:-1]), key=len)
            plans.append(PlannedSurface(entry, (template, entry.name), key, ways=tuple(both)))
    for pair in rows.pairs:
        if is_closed or template not in pair or frozenset(pair) not in keys:
            continue
        name = pair[0] if pair[1] == template else pair[1]
        middles = [other for other in linked if {other, name} in sure]
        if len(middles) > MAX_WAYS:
            middles = [middles[i] for i in np.unique(np.linspace(0, len(middles) - 1, MAX_WAYS).astype(int))]
        ways: Ways = tuple((entries[middle],) for middle in middles)
        legs = [frozenset(leg) for middle in middles for leg in ((template, middle), (middle, name))]
        if not middles or frozenset(pair) in sure:
            ways, legs = ((), *ways), [frozenset(pair), *legs]
        key = _hash_of(keys[leg] for leg in legs) if middles else keys[frozenset(pair)]
        plans.append(PlannedSurface(entries[name], pair, key, ways=ways))
    matched = {plan.entry.name for plan in plans}
    for name in names:
        if name not in matched and (path := rows.path(template, name)):
            key = _hash_of(keys[frozenset(leg)] for leg in pairwise(path))
            way = tuple(entries[middle] for middle in path[1:-1])
            plans.append(PlannedSurface(entries[name], (template, name), key, ways=(way,)))
    for i, plan in enumerate(plans):
        if (factor := known.scales.get(plan.entry.name, 1.0)) != 1:
            plans[i] = plan._replace(scale=factor, key=f"{plan.key} × {factor:.6g}")
    return plans


def _hash_of(keys: Iterable[str]) -> str:
    return blake2b("; ".join(keys).encode(), digest_size=16).hexdigest()


def _unchanged_surfaces(known: Snapshot, changed: Container[Path]) -> set[str]:
    files = [known.layout.folder / name for name in known.rows.files]
    return {file.stem for file in files if file.parent.name == "corresponded" and file not in changed}


def _is_written(plan: PlannedSurface, lines: dict[str, SurfaceRow], unchanged: Container[str]) -> bool:
    line = lines.get(plan.entry.name)
    return line is not None and line.key == plan.key and not line.error and plan.entry.name in unchanged


def _remove_others(known: Snapshot, kept: set[str], lines: dict[str, SurfaceRow], ledger: Ledger) -> None:
    """Remove files and lines of shapes that are not kept, and reports of their pairs."""
    layout, everything = known.layout, read_ledgers(known.layout.ledgers())
    for name in {*lines, *everything.shapes} - kept:
        landmarks = layout.landmarks / f"{name}.mrk.json"
        seen = layout.thumbnail(name), layout.view(name), layout.landmark_view(name)
        for file in (layout.corresponded(name), *seen, landmarks):
            file.unlink(missing_ok=True)
            ledger.forget("files", file.relative_to(layout.folder).as_posix())
        if lines.pop(name, None):  # the other shapes are compared anew, without it
            lines |= {other: replace(line, unlike="") for other, line in lines.items()}
    for pair in everything.pairs:
        if not set(pair) <= set(known.names):
            layout.report(pair).unlink(missing_ok=True)


def _tell_unlike(layout: Layout, names: list[str], lines: dict[str, SurfaceRow]) -> None:
    """Add to lines why shapes are far from all others, unless all have been compared."""
    if all(lines[name].unlike for name in names):
        return
    compared = names[:: len(names) // MAX_COMPARED_SHAPES + 1]
    sampled = []
    for name in compared:
        vertices = read_mesh(layout.corresponded(name)).vertices
        sampled.append(vertices[np.linspace(0, len(vertices) - 1, N_COMPARED_VERTICES).astype(int)])
    doubts = doubtful_positions(compared, np.array(sampled)) if sampled else []
    unlike = {name: doubt.reason for doubt in doubts if doubt.kind == "unlike" for name in doubt.names}
    for name in names:
        lines[name] = replace(lines[name], unlike=unlike.get(name, NOT_UNLIKE))


def _tell_unreached(known: Snapshot, kept: set[str], lines: dict[str, SurfaceRow]) -> None:
    """Add lines of shapes without a path of sure maps, with the maps at which the paths end."""
    rows = known.rows
    ends = [pair for pair in rows.pairs if rows.is_doubtful(pair) and len(kept & {*pair}) == 1]
    broken = map(" and ".join, ends)
    where = f", as those of {', '.join(broken)} are doubtful" if ends else ""
    for name in known.names:
        if name not in kept and name in rows.shapes:
            reason = f"no sure maps lead to it from the template {known.template}{where}"
            lines[name] = replace(lines.get(name, SurfaceRow(name=name)), error=reason)


def _tell_sides(known: Snapshot, lines: dict[str, SurfaceRow]) -> None:
    """Add to lines whether shapes were reflected, and whether they seem to be mirror images."""
    turned, mirrored = known.reflected, known.mirror_images
    for name in known.names:
        if name in lines or name in turned or name in mirrored:
            sides = {"reflected": "yes" * (name in turned), "mirror_image": "yes" * (name in mirrored)}
            lines[name] = replace(lines.get(name, SurfaceRow(name=name)), **sides)


Ways: TypeAlias = tuple[tuple[Entry, ...], ...]
"""The ways of maps from the template to a shape, each by the shapes between them; () is a direct map."""


class PlannedSurface(NamedTuple):
    """A shape to be written with the vertices of the template."""

    entry: Entry
    pair: Pair | None  # the template and the shape; None for the template itself
    key: str  # identifies the maps that give the surface
    scale: float = 1.0  # factor that brings positions to the unit of the collection
    ways: Ways = ((),)  # the surface is the median of these ways; the template's leads once around a ring


def _write_surface(layout: Layout, of: Entry, plan: PlannedSurface) -> tuple[SurfaceRow, str]:
    """Write a shape in the template's topology, and its picture; return its line and digest."""
    name = plan.entry.name
    line = SurfaceRow(name=name, key=plan.key, **asdict(WrapQuality(0.0, 1.0, 0.0, 0)), ways=len(plan.ways))
    line = replace(line, scale=plan.scale if plan.scale != 1 else "")
    template, mesh = map(_mesh, (of, plan.entry))
    marks: list[Attribute] = []
    if plan.ways[0] and plan.pair is None:
        images = _map(layout, of, plan, mesh)[0].pull_back(mesh.vertices)
        distances = np.linalg.norm(images - mesh.vertices, axis=1) / np.sqrt(mesh.area)
        mean, largest = float(np.nanmean(distances)), float(np.nanmax(distances))
        line = replace(line, loop_error=mean, greatest_loop_error=largest)
    if plan.pair is None:
        template = mesh = surface = reflected(mesh) if plan.entry.reflected else mesh
    else:
        found_map, error, n_ways = _map(layout, of, plan, mesh)
        line = replace(line, expected_error=error, ways=n_ways)
        matched = as_matched(found_map, template, mesh, (of.reflected, plan.entry.reflected))
        (_, template, surface), wrapped = matched, wrap(*matched)
        mesh = wrapped.mesh
        line = replace(line, **asdict(wrapped.quality))
        if wrapped.extended.any():
            marks = [Attribute(MEASURED, "point", "label", (~wrapped.extended).astype(np.uint8))]
    surface, mesh = (shape.moved(plan.scale * shape.vertices) for shape in (surface, mesh))
    asset = Asset(mesh.vertices, _polygons(of, mesh), tuple(marks), frame=_frame(plan.entry, plan.scale))
    write_asset(layout.corresponded(name), asset)
    _draw(template, mesh, layout.thumbnail(name))
    links = {"all shapes": "../index.html", "mesh": f"../corresponded/{quote(name)}.ply"}
    shown = Specimen(name, surface, mesh), Specimen(of.name, template, template)
    write_specimen(layout.view(name), *shown, links)
    return line, digest_of(layout.corresponded(name))


def _map(layout: Layout, of: Entry, plan: PlannedSurface, mesh: Mesh) -> tuple[Correspondence, float, int]:
    """Find the median map of all ways, the mean error of the first, in √area, and their number."""
    meshes = {plan.entry.name: mesh}
    maps, errors = [], []
    for way in plan.ways:
        meshes |= {entry.name: _mesh(entry) for entry in way}
        path = [entry.name for entry in (of, *way, plan.entry)]
        composed, error = maps_along(layout, path, meshes.__getitem__)
        maps.append(composed)
        errors.append(float(np.nanmean(error)) if np.isfinite(error).any() else np.nan)
    if len(maps) == 2:  # if two maps differ much, one is wrong: the first is kept instead of the median
        first, second = (composed.pull_back(mesh.vertices) for composed in maps)
        mean = np.nanmean(np.linalg.norm(first - second, axis=1))
        maps = maps[:1] if mean > MAX_INCONSISTENCY * np.sqrt(mesh.area) else maps
    return median_map(maps, mesh, errors) if len(maps) > 1 else maps[0], errors[0], len(maps)


def _draw(template: Mesh, mesh: Mesh, path: Path) -> None:
    """Draw a shape in the colours of the template's positions, turned like the template."""
    from matplotlib.image import imsave  # the process that sends the tasks draws nothing

    cameras = {template: camera_of(template), mesh: camera_like(template, mesh)}
    extents = [
        np.ptp(shape.vertices[np.unique(shape.faces)] @ camera[:2].T, axis=0).max() / np.sqrt(shape.area)
        for shape, camera in cameras.items()
    ]
    resolution = (THUMBNAIL_SIZE - 2 * MARGIN) / max(extents)
    image = surface_image(mesh, position_colours(template), to_screen, cameras[mesh], resolution)
    image = image[:THUMBNAIL_SIZE, :THUMBNAIL_SIZE]
    square = np.zeros((THUMBNAIL_SIZE, THUMBNAIL_SIZE, 4))
    top, left = (THUMBNAIL_SIZE - np.array(image.shape[:2])) // 2
    square[top : top + image.shape[0], left : left + image.shape[1]] = np.clip(image, 0.0, 1.0)
    with replaced(path) as file:
        imsave(file, square, format="png")


def _polygons(template: Entry, mesh: Mesh) -> Polygons:
    """Return the polygons of the template's file, or triangles if it was reflected."""
    with suppress(IsomatchError):  # the file might have attributes that cannot be read
        if not template.reflected:
            return read_asset(template.path).polygons
    return Polygons.of_triangles(mesh.faces)


def _frame(entry: Entry, scale: float) -> Frame | None:
    """Return the space of a file, without its unit if scaled; None if the shape was reflected."""
    with suppress(IsomatchError):  # the file might have attributes that cannot be read
        frame = read_asset(entry.path).frame
        if frame and not entry.reflected:
            return frame if scale == 1 else Frame(words=(f"SPACE={frame.axes}",) if frame.axes else ())
    return None


def _mesh(entry: Entry) -> Mesh:
    return _read(entry.path, entry.path.stat().st_mtime_ns)


@lru_cache(MAX_WAYS + 2)
def _read(path: Path, changed: int) -> Mesh:
    """Read a mesh, or take it from memory if its file has not changed since."""
    return mesh_from(path)


def export(
    collection: Collection,
    folder: str | Path,
    meshes: str | None = ".ply",
    maps: str | None = ".npz",
    force: bool = False,
    rounded: bool = False,
) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Write the surfaces of `surfaces_written`, and the present maps of all pairs.

    Yields each file, and the attributes that its format cannot hold. All files of an earlier export
    are replaced once the last one, ``pairs.csv``, is written; others in the folder stay.

    Parameters
    ----------
    collection : Collection
    folder : path_like
        Folder for ``meshes/NAME``, in the units of the collection, with ``measured`` if the format
        can hold it, and for ``maps/SOURCE__TARGET``, a file for each direction.
    meshes, maps : str, optional
        Suffixes, see `FORMATS` and `Correspondence.save`; None to write none.
    force, rounded
        As the options of ``isomatch collect export``.
    """
    if meshes and meshes.lower() == ".stl":
        lack = "the order of vertices, by which shapes correspond"
        raise FormatError(f"STL files do not keep {lack}; use another")
    rows, last = collection.rows(), Path(folder) / "pairs.csv"
    if last.parent.resolve() == collection.folder.resolve():
        raise InputError(f"{folder}: is the folder of the collection itself; give another one")
    kept = ["corresponded"] * bool(meshes) + ["maps"] * bool(maps)
    require_unchanged(collection.layout, kept)
    names = surfaces_written(collection) if meshes else []
    pairs = [pair for pair in rows.pairs if rows.is_current(pair)] if maps else []
    if not names and not pairs:
        remedy = "run isomatch collect to its end, or see shapes.csv"
        raise InputError(f"{collection.folder}: nothing to export; {remedy}")
    earlier = [last, *(file for kind in ("meshes", "maps") for file in sorted(last.parent.glob(f"{kind}/*")))]
    with (
        made_folder(last.parent),
        claimed(last, [] if force else earlier),
        staged(last.parent, last.name) as new,
    ):
        for kind in ("meshes", "maps"):
            (new / kind).mkdir()
        for name in names:
            path = new / "meshes" / f"{name}{meshes}"
            left = write_asset(path, read_asset(collection.layout.corresponded(name)), rounded=rounded)
            yield last.parent / path.relative_to(new), tuple(attribute.name for attribute in left)
        for pair in pairs:
            pair_maps = collection.maps(*pair)
            for ends, correspondence in ((pair, pair_maps.forward), (pair[::-1], pair_maps.backward)):
                path = new / "maps" / f"{NAME_SEPARATOR.join(ends)}{maps}"
                correspondence.save(path)
                yield last.parent / path.relative_to(new), ()
        write_table(rows, new / last.name)
    yield last, ()
