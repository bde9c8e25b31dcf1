"""What a run leaves to work with and to look at: surfaces in one topology, tables, and a page; files for others."""

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
from matplotlib.image import imsave

from isomatch._core.errors import FormatError, InputError, IsomatchError, UnwritableFileError
from isomatch._core.files import claimed, is_of_one_file, made_folder, replaced, staged, writing
from isomatch.cohort.collection import Collection
from isomatch.cohort.ledger import (
    CONTRADICTED,
    Ledger,
    Pair,
    Rows,
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
from isomatch.cohort.plan import BETWEEN, Entry, Layout, identity_of_map
from isomatch.cohort.shape_statistics import MEASURED, doubtful_positions
from isomatch.cohort.specimen_page import Specimen, camera_like, write_specimen
from isomatch.cohort.study_page import write_page, write_table
from isomatch.cohort.unusual_shapes import NOT_UNLIKE, mirror_images, scales_of
from isomatch.cohort.workers import Task, Workers, workers_of
from isomatch.correspondence import Correspondence, WrapQuality, median_map, wrap
from isomatch.io import Asset, Attribute, Frame, Polygons, mesh_from, read_asset, read_mesh, write_asset
from isomatch.surfaces import Mesh, reflected
from isomatch.visualization import camera_of, position_colours, surface_image, to_screen

AT_ONCE = 4  # surfaces of a task
N_COMPARED = 1000  # vertices of a shape by which outliers are found
MOST_COMPARED = 2000  # shapes that are compared; of more, every so many-th
SAVED = 60.0  # seconds between two writings of the table: a run that is killed repeats no more than these
MOST_WAYS = 20  # over other shapes; as many as were measured
THUMBNAIL, MARGIN = 300, 6  # pixels of the side of a thumbnail, and around what is longest


def finish(
    collection: Collection,
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[SurfaceRow]:
    """Write the shapes in the topology of the template, ``shapes.csv``, ``pairs.csv`` and ``index.html``.

    A shape is written if it is matched with the template, in either direction, and only if its maps are others than
    before, or its file was changed. Often it is also matched with shapes that are matched with the template. Then the
    images of the template's vertices by all these ways are combined: their median on the surface, see `median_map`.
    Doubtful maps are no such ways. Vertices for which it has nothing are placed by those around them; see
    `isomatch.wrap`. A shape that is not matched with the template, as in a chain, gets the composition of the maps on
    the shortest path of sure ones; in a ring that is closed by sure maps, both ways round are joined, unless they are
    far apart. Files of shapes that were taken out, or are not matched any more, are removed.

    Yields the line in ``shapes.csv`` of each surface that is written; ``again`` is what was wrong with the file that was
    there. Other arguments are those of `Collection.run`.
    """
    layout, rows = collection.layout, collection.rows()
    template = collection.chosen_template(rows)
    lines = SurfaceRow.read(layout.shapes_table)
    mirrored = mirror_images(collection, rows)
    plans = [] if template is None else _planned(collection, rows, template)
    kept = collection.names if template is None else [plan.entry.name for plan in plans]
    with claimed(layout.shapes_table), writing_ledger(layout.ledger()) as ledger:
        _remove(collection, set(kept), lines, ledger)
        if template is not None:
            for folder in ("corresponded", "thumbnails", "views"):
                with writing(layout.folder / folder):
                    (layout.folder / folder).mkdir(exist_ok=True)
            changed = changed_files(layout, rows, ["corresponded"])
            whole = _whole(layout, rows, changed)
            wrapped = partial(_wrapped, layout, _entry(collection, rows, template))
            todo = [plan for plan in plans if not _is_written(plan, lines, whole)]
            tasks = [Task(tuple(todo[i : i + AT_ONCE]), wrapped) for i in range(0, len(todo), AT_ONCE)]
            saved = time.monotonic()
            with workers_of(executor, jobs, time_limit) as workers:
                for plan, found in workers.completed(tasks):
                    name, file = plan.entry.name, layout.corresponded(plan.entry.name)
                    died = SurfaceRow(name=name, error=str(found)), ""
                    lines[name], digest = died if isinstance(found, Exception) else found
                    if digest:
                        put_files(ledger, layout, {file: digest})
                        whole.add(name)
                    if time.monotonic() > saved + SAVED:
                        SurfaceRow.write(layout.shapes_table, lines.values())
                        saved = time.monotonic()
                    again = f"its file {changed[file]}" if file in changed else ""
                    yield replace(lines[name], again=again)
            _tell_sides(collection.names, rows.reflected(collection.names), mirrored, lines)
            _tell_unreached(collection, rows, template, set(kept), lines)
            written = [plan.entry.name for plan in plans if _is_written(plan, lines, whole)]
            _tell_unlike(layout, written, lines)
            SurfaceRow.write(layout.shapes_table, lines.values())
    write_table(rows, layout.table)
    write_page(collection, rows, template, lines)


def refresh_page(collection: Collection) -> None:
    """Write ``index.html`` again, after files that it links."""
    rows = collection.rows()
    template = collection.chosen_template(rows)
    write_page(collection, rows, template, SurfaceRow.read(collection.layout.shapes_table))


def surface_as_written(collection: Collection, rows: Rows, name: str) -> Mesh:
    """Return the surface of a file where that in the topology of the template lies: reflected, in its units."""
    entry, factor = _entry(collection, rows, name), scales_of(collection.units, rows).get(name, 1.0)
    mesh = reflected(_mesh(entry)) if entry.reflected else _mesh(entry)
    return mesh.moved(factor * mesh.vertices)


def surfaces_written(collection: Collection) -> list[str]:
    """Names of the shapes that are written in the topology of the template, by the maps that they have now."""
    rows = collection.rows()
    template = collection.chosen_template(rows)
    if template is None:
        return []
    layout, plans = collection.layout, _planned(collection, rows, template)
    lines = SurfaceRow.read(layout.shapes_table)
    whole = _whole(layout, rows, changed_files(layout, rows, ["corresponded"]))
    return [plan.entry.name for plan in plans if _is_written(plan, lines, whole)]


def _planned(collection: Collection, rows: Rows, template: str) -> list[PlannedSurface]:
    scales = scales_of(collection.units, rows)
    current = {frozenset(pair): row for pair, row in rows.pairs.items() if rows.is_current(pair)}
    keys = {ends: identity_of_map(row) for ends, row in current.items()}
    sure = {frozenset(pair) for pair in rows.pairs if frozenset(pair) in keys and not rows.is_doubtful(pair)}
    linked = [name for name in collection.names if {template, name} in sure]
    own = rows.shapes.get(template, ShapeRow(state="todo")).key
    plans = [PlannedSurface(_entry(collection, rows, template), None, own)]
    start = collection.names.index(template) if collection.pairs == "ring" else 0
    ring = [*collection.names[start:], *collection.names[:start]]
    around = [frozenset(leg) for leg in pairwise([*ring, template])]
    is_closed = collection.pairs == "ring" and sure.issuperset(around)
    if is_closed:  # every surface depends on all maps
        key = _joined(keys[leg] for leg in around)
        entries = tuple(_entry(collection, rows, each) for each in ring)
        plans = [plans[0]._replace(key=f"{own} {key}", ways=(entries[1:],))]
        for i, entry in enumerate(entries[1:], 1):
            both = sorted((entries[1:i], entries[:i:-1]), key=len)
            plans.append(PlannedSurface(entry, (template, entry.name), key, ways=tuple(both)))
    for pair in rows.pairs:
        if is_closed or template not in pair or frozenset(pair) not in keys:
            continue
        name = pair[0] if pair[1] == template else pair[1]
        over = [each for each in linked if {each, name} in sure]
        if len(over) > MOST_WAYS:
            over = [over[i] for i in np.unique(np.linspace(0, len(over) - 1, MOST_WAYS).astype(int))]
        ways: Ways = tuple((_entry(collection, rows, each),) for each in over)
        legs = [frozenset(leg) for each in over for leg in ((template, each), (each, name))]
        if not over or frozenset(pair) in sure:
            ways, legs = ((), *ways), [frozenset(pair), *legs]
        key = _joined(keys[leg] for leg in legs) if over else keys[frozenset(pair)]
        plans.append(PlannedSurface(_entry(collection, rows, name), pair, key, ways=ways))
    matched = {plan.entry.name for plan in plans}
    for name in collection.names:
        if name not in matched and (path := rows.path(template, name)):
            key = _joined(keys[frozenset(leg)] for leg in pairwise(path))
            way = tuple(_entry(collection, rows, each) for each in path[1:-1])
            plans.append(PlannedSurface(_entry(collection, rows, name), (template, name), key, ways=(way,)))
    for i, plan in enumerate(plans):
        if (factor := scales.get(plan.entry.name, 1.0)) != 1:
            plans[i] = plan._replace(scale=factor, key=f"{plan.key} × {factor:.6g}")
    return plans


def _joined(keys: Iterable[str]) -> str:
    return blake2b("; ".join(keys).encode(), digest_size=16).hexdigest()


def _entry(collection: Collection, rows: Rows, name: str) -> Entry:
    """Return a shape as it was matched."""
    return Entry(name, collection.paths[name], bool(rows.reflected([name])))


def _whole(layout: Layout, rows: Rows, changed: Container[Path]) -> set[str]:
    """Names of the surfaces that are as they were written."""
    files = [layout.folder / name for name in rows.files]
    return {file.stem for file in files if file.parent.name == "corresponded" and file not in changed}


def _is_written(plan: PlannedSurface, lines: dict[str, SurfaceRow], whole: Container[str]) -> bool:
    line = lines.get(plan.entry.name)
    return line is not None and line.key == plan.key and not line.error and plan.entry.name in whole


def _remove(collection: Collection, kept: set[str], lines: dict[str, SurfaceRow], ledger: Ledger) -> None:
    """Remove the files and lines of shapes that are not written any more, and reports of pairs that are no more."""
    layout, everything = collection.layout, read_ledgers(collection.layout.ledgers())
    gone = {*lines, *everything.shapes} - kept
    for name in gone:
        landmarks = layout.landmarks / f"{name}.mrk.json"
        seen = layout.thumbnail(name), layout.view(name), layout.landmark_view(name)
        for file in (layout.corresponded(name), *seen, landmarks):
            file.unlink(missing_ok=True)
            ledger.forget("files", file.relative_to(layout.folder).as_posix())
        if lines.pop(name, None):  # the others are compared again, without it
            lines |= {other: replace(line, unlike="") for other, line in lines.items()}
    for pair in everything.pairs:
        if not set(pair) <= set(collection.names):
            layout.report(pair).unlink(missing_ok=True)


def _tell_unlike(layout: Layout, names: list[str], lines: dict[str, SurfaceRow]) -> None:
    """Add to the lines of shapes why they are far from all others, if they are; unless all have been compared."""
    if all(lines[name].unlike for name in names):
        return
    compared = names[:: len(names) // MOST_COMPARED + 1]
    sampled = []
    for name in compared:
        vertices = read_mesh(layout.corresponded(name)).vertices
        sampled.append(vertices[np.linspace(0, len(vertices) - 1, N_COMPARED).astype(int)])
    doubts = doubtful_positions(compared, np.array(sampled)) if sampled else []
    unlike = {name: doubt.reason for doubt in doubts if doubt.kind == "unlike" for name in doubt.names}
    for name in names:
        lines[name] = replace(lines[name], unlike=unlike.get(name, NOT_UNLIKE))


def _tell_unreached(
    collection: Collection, rows: Rows, template: str, kept: set[str], lines: dict[str, SurfaceRow]
) -> None:
    """Add lines of shapes that no path of sure maps leads to, with the maps at which the paths end."""
    broken = [pair for pair in rows.pairs if rows.is_doubtful(pair) and len(kept & {*pair}) == 1]
    where = f", as those of {', '.join(' and '.join(pair) for pair in broken)} are doubtful" if broken else ""
    for name in collection.names:
        if name not in kept and name in rows.shapes:
            reason = f"no sure maps lead to it from the template {template}{where}"
            lines[name] = replace(lines.get(name, SurfaceRow(name=name)), error=reason)


def _tell_sides(
    names: list[str], turned: list[str], mirrored: Container[str], lines: dict[str, SurfaceRow]
) -> None:
    """Add to the lines of shapes whether they were reflected, and whether they seem to be mirror images."""
    for name in names:
        if name in lines or name in turned or name in mirrored:
            told = {"reflected": "yes" * (name in turned), "mirror_image": "yes" * (name in mirrored)}
            lines[name] = replace(lines.get(name, SurfaceRow(name=name)), **told)


Ways: TypeAlias = tuple[tuple[Entry, ...], ...]


class PlannedSurface(NamedTuple):
    """A shape to be drawn with the vertices of the template."""

    entry: Entry
    pair: Pair | None  # the template and the shape; None for the template itself
    key: str  # identifies the map, and with it the surface
    scale: float = 1.0  # what its positions are multiplied by, so that they are in the units of the others
    # how the template's vertices come to it: over which other shapes, none by the map of the pair; the median of all.
    # To the template itself: once around a ring
    ways: Ways = ((),)


def _wrapped(layout: Layout, of: Entry, plan: PlannedSurface) -> tuple[SurfaceRow, str]:
    """Write a shape with the vertices of the template, and its picture; return a line about it, and the digest."""
    name, digest = plan.entry.name, ""
    line = SurfaceRow(name=name, key=plan.key, **asdict(WrapQuality(0.0, 1.0, 0.0, 0)), ways=len(plan.ways))
    line = replace(line, scale=plan.scale if plan.scale != 1 else "")
    try:
        template, mesh = map(_mesh, (of, plan.entry))
        marks: list[Attribute] = []
        if plan.ways[0] and plan.pair is None:
            images = _map(layout, of, plan, mesh)[0].pull_back(mesh.vertices)
            apart = np.linalg.norm(images - mesh.vertices, axis=1) / np.sqrt(mesh.area)
            mean, most = float(np.nanmean(apart)), float(np.nanmax(apart))
            line = replace(line, loop_error=mean, greatest_loop_error=most)
        if plan.pair is None:
            template = mesh = surface = reflected(mesh) if plan.entry.reflected else mesh
        else:
            turned = of.reflected, plan.entry.reflected
            there, error, n_ways = _map(layout, of, plan, mesh)
            line = replace(line, expected_error=error, ways=n_ways)
            there, template, surface = as_matched(there, template, mesh, turned)
            wrapped = wrap(there, template, surface)
            mesh = wrapped.mesh
            line = replace(line, **asdict(wrapped.quality))
            if wrapped.extended.any():
                marks = [Attribute(MEASURED, "point", "label", (~wrapped.extended).astype(np.uint8))]
        surface, mesh = (shape.moved(plan.scale * shape.vertices) for shape in (surface, mesh))
        asset = Asset(mesh.vertices, _polygons(of, mesh), tuple(marks), frame=_frame(plan.entry, plan.scale))
        write_asset(layout.corresponded(name), asset)
        digest = digest_of(layout.corresponded(name))
        _draw(template, mesh, layout.thumbnail(name))
        links = {"all shapes": "../index.html", "mesh": f"../corresponded/{quote(name)}.ply"}
        shown = Specimen(name, surface, mesh), Specimen(of.name, template, template)
        write_specimen(layout.view(name), *shown, links)
    except (IsomatchError, OSError, ValueError, ArithmeticError) as error:
        if isinstance(error, UnwritableFileError) and not is_of_one_file(error):
            raise  # as on a full disk: the shape is not to blame
        line = replace(line, error=f"{type(error).__name__}: {error}")
    return line, digest


def _map(layout: Layout, of: Entry, plan: PlannedSurface, mesh: Mesh) -> tuple[Correspondence, float, int]:
    """Return the map from the template, the median of all ways, its error by the first, in √area, and their number."""
    meshes = {plan.entry.name: mesh}
    maps, errors = [], []
    for way in plan.ways:
        path = (of, *way, plan.entry)
        meshes |= {each.name: _mesh(each) for each in way}
        there, error = maps_along(layout, [each.name for each in path], meshes.__getitem__)
        maps.append(there)
        errors.append(float(np.nanmean(error)) if np.isfinite(error).any() else np.nan)
    if len(maps) == 2:  # of two that are far apart one is wrong, and so is what lies between
        apart = np.linalg.norm(maps[0].pull_back(mesh.vertices) - maps[1].pull_back(mesh.vertices), axis=1)
        maps = maps[:1] if np.nanmean(apart) > CONTRADICTED * np.sqrt(mesh.area) else maps
    return median_map(maps, mesh, errors) if len(maps) > 1 else maps[0], errors[0], len(maps)


def _draw(template: Mesh, mesh: Mesh, path: Path) -> None:
    """Draw a shape in the colours of the template's positions, turned like the template."""
    cameras = {template: camera_of(template), mesh: camera_like(template, mesh)}
    extents = [
        np.ptp(shape.vertices[np.unique(shape.faces)] @ camera[:2].T, axis=0).max() / np.sqrt(shape.area)
        for shape, camera in cameras.items()
    ]
    resolution = (THUMBNAIL - 2 * MARGIN) / max(extents)
    image = surface_image(mesh, position_colours(template), to_screen, cameras[mesh], resolution)
    image = image[:THUMBNAIL, :THUMBNAIL]
    square, (top, left) = np.zeros((THUMBNAIL, THUMBNAIL, 4)), (THUMBNAIL - np.array(image.shape[:2])) // 2
    square[top : top + image.shape[0], left : left + image.shape[1]] = np.clip(image, 0.0, 1.0)
    with replaced(path) as file:
        imsave(file, square, format="png")


def _polygons(template: Entry, mesh: Mesh) -> Polygons:
    """Return the polygons of the template's file, which its shapes have; triangles where it was reflected."""
    with suppress(IsomatchError):  # as of attributes that cannot be read
        if not template.reflected:
            return read_asset(template.path).polygons
    return Polygons.of_triangles(mesh.faces)


def _frame(entry: Entry, scale: float) -> Frame | None:
    """Return the space that a file says, without its unit if that is another; of a mirror image none."""
    with suppress(IsomatchError):  # as of attributes that cannot be read
        frame = read_asset(entry.path).frame
        if frame and not entry.reflected:
            return frame if scale == 1 else Frame(words=(f"SPACE={frame.axes}",) if frame.axes else ())
    return None


def _mesh(entry: Entry) -> Mesh:
    return _read(entry.path, entry.path.stat().st_mtime_ns)


@lru_cache(MOST_WAYS + 2)
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
    """Write the surfaces of `surfaces_written`, and the maps of all pairs as they are now.

    Yields each file, and what its format has no place for. All files of an earlier export are replaced once the last one,
    ``pairs.csv``, is written; others in the folder stay.

    Parameters
    ----------
    collection : Collection
    folder : path_like
        Folder for ``meshes/NAME``, in the units of the collection, with ``measured`` as far as the format has a place for
        it, and for ``maps/SOURCE__TARGET``, a file for each direction.
    meshes, maps : str, optional
        Suffixes, see `FORMATS` and `Correspondence.save`; None for none.
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
            for ends, correspondence in ((pair, pair_maps.there), (pair[::-1], pair_maps.back)):
                path = new / "maps" / f"{BETWEEN.join(ends)}{maps}"
                correspondence.save(path)
                yield last.parent / path.relative_to(new), ()
        write_table(rows, new / last.name)
    yield last, ()
