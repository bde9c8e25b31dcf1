"""What a run leaves to work with and to look at: surfaces in one topology, tables, and a page."""

from __future__ import annotations

import time
from collections.abc import Container, Iterator
from concurrent.futures import Executor
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.assets import read_mesh
from isomatch.collections.cohort import NOT_UNLIKE
from isomatch.collections.collection import Collection
from isomatch.collections.kept import changed_files, put_files
from isomatch.collections.layout import Layout
from isomatch.collections.ledger import Ledger, Rows, read_ledgers, writing_ledger
from isomatch.collections.mirror_images import mirror_images
from isomatch.collections.page import write_page
from isomatch.collections.shapes import Entry
from isomatch.collections.tables import write_table
from isomatch.collections.units import scales_of
from isomatch.collections.workers import Task, late_after, workers_of
from isomatch.collections.wrapped import MOST_WAYS, PlannedSurface, WrapJob
from isomatch.statistics import doubtful_positions
from isomatch.storage.files import claimed, writing
from isomatch.storage.texts import read_csv, write_csv

OWN = ("name", "key", "turned", "stretch", "distance", "extended", "error")  # columns of the work itself
COLUMNS = (*OWN, "ways", "scale", "reflected", "mirror_image", "unlike")
AT_ONCE = 4  # surfaces of a task
N_COMPARED = 1000  # vertices of a shape by which outliers are found
MOST_COMPARED = 2000  # shapes that are compared; of more, every so many-th
SAVED = 60.0  # seconds between two writings of the table: a run that is killed repeats no more than these


def finish(
    collection: Collection,
    executor: str | Executor = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[dict[str, Any]]:
    """Write the shapes in the topology of the template, ``shapes.csv``, ``pairs.csv`` and ``index.html``.

    A shape is written if it is matched with the template, in either direction, and only if its maps are others than
    before. Often it is also matched with shapes that are matched with the template, as in a collection of all pairs. Then
    the images of the template's vertices by all these ways are combined: their median on the surface, see `median_map`.
    Doubtful maps are no such ways. Vertices for which it has nothing are placed by those around them; see
    `isomatch.wrap`. Files of shapes that were taken out, or are not matched any more, are removed. A file that was
    changed after it was written is written again.

    Parameters
    ----------
    collection : Collection
        The collection.
    executor, jobs, time_limit
        As for `Collection.run`.

    Raises
    ------
    UnwritableFileError
        If another process does the same, or the folder cannot be written.

    Yields
    ------
    dict
        For each surface that is written: its name, the key of the map, and the measures of `WrapQuality`; or the error
        that prevented it. ``again``: what was wrong with the file that was there.
    """
    late = late_after(time_limit)
    layout, rows = collection.layout, collection.rows()
    template = collection.chosen_template(rows)
    lines = _lines_of_table(collection)
    plans = [] if template is None else _planned(collection, rows, template)
    kept = collection.names if template is None else [plan.entry.name for plan in plans]
    with claimed(layout.shapes_table), writing_ledger(layout.ledger()) as ledger:
        _remove(collection, set(kept), lines, ledger)
        if template is not None:
            for folder in ("corresponded", "thumbnails"):
                with writing(layout.folder / folder):
                    (layout.folder / folder).mkdir(exist_ok=True)
            changed = changed_files(layout, rows, ["corresponded"])
            whole = _whole(layout, rows, changed)
            job = WrapJob(layout, _entry(collection, rows, template))
            todo = [plan for plan in plans if not _is_written(plan, lines, whole)]
            tasks = [
                Task(tuple(todo[i : i + AT_ONCE]), job.wrap_shapes) for i in range(0, len(todo), AT_ONCE)
            ]
            saved = time.monotonic()
            with workers_of(executor, jobs) as workers:
                for plan, line in workers.completed(tasks, late):
                    name, file = plan.entry.name, layout.corresponded(plan.entry.name)
                    lines[name] = line if isinstance(line, dict) else {"name": name, "error": str(line)}
                    if digest := lines[name].pop("file", None):
                        put_files(ledger, layout, {file: digest})
                        whole.add(name)
                    if time.monotonic() > saved + SAVED:
                        write_csv(layout.shapes_table, lines.values(), COLUMNS)
                        saved = time.monotonic()
                    yield {
                        **lines[name],
                        **({"again": f"its file {changed[file]}"} if file in changed else {}),
                    }
            _tell_sides(collection, rows, lines)
            _tell_unlike(
                layout, [plan.entry.name for plan in plans if _is_written(plan, lines, whole)], lines
            )
            write_csv(layout.shapes_table, lines.values(), COLUMNS)
    write_table(rows, layout.table)
    write_page(collection, rows, template, lines)


def surfaces_written(collection: Collection) -> list[str]:
    """Names of the shapes that are written in the topology of the template, by the maps that they have now."""
    rows = collection.rows()
    template = collection.chosen_template(rows)
    if template is None:
        return []
    plans, lines = _planned(collection, rows, template), _lines_of_table(collection)
    whole = _whole(collection.layout, rows, changed_files(collection.layout, rows, ["corresponded"]))
    return [plan.entry.name for plan in plans if _is_written(plan, lines, whole)]


def _planned(collection: Collection, rows: Rows, template: str) -> list[PlannedSurface]:
    scales = scales_of(collection.units, rows)
    keys = {
        frozenset(pair): " > ".join((row["key"], *row.get("replaced_by", ())))
        for pair, row in rows.pairs.items()
        if rows.is_current(pair)
    }
    sure = {frozenset(pair) for pair in rows.pairs if frozenset(pair) in keys and not rows.is_doubtful(pair)}
    linked = [name for name in collection.names if {template, name} in sure]
    plans = [
        PlannedSurface(_entry(collection, rows, template), None, rows.shapes.get(template, {}).get("key", ""))
    ]
    for pair in rows.pairs:
        if template not in pair or frozenset(pair) not in keys:
            continue
        name = pair[0] if pair[1] == template else pair[1]
        over = [each for each in linked if {each, name} in sure]
        over = (
            [over[i] for i in np.unique(np.linspace(0, len(over) - 1, MOST_WAYS).astype(int))] if over else []
        )
        ways: tuple[Entry | None, ...] = tuple(_entry(collection, rows, each) for each in over)
        legs = [frozenset(leg) for each in over for leg in ((template, each), (each, name))]
        if not over or frozenset(pair) in sure:
            ways, legs = (None, *ways), [frozenset(pair), *legs]
        key = "; ".join(keys[leg] for leg in legs)
        if over:
            key = blake2b(key.encode(), digest_size=16).hexdigest()
        plans.append(PlannedSurface(_entry(collection, rows, name), pair, key, ways=ways))
    return [plan.scaled(scales.get(plan.entry.name, 1.0)) for plan in plans]


def _entry(collection: Collection, rows: Rows, name: str) -> Entry:
    """Return a shape as it was matched."""
    return Entry(name, collection.paths[name], bool(rows.reflected([name])))


def _whole(layout: Layout, rows: Rows, changed: Container[Path]) -> set[str]:
    """Names of the surfaces that are as they were written."""
    files = [layout.folder / name for name in rows.files]
    return {file.stem for file in files if file.parent.name == "corresponded" and file not in changed}


def _is_written(plan: PlannedSurface, lines: dict[str, Any], whole: Container[str]) -> bool:
    line = lines.get(plan.entry.name, {})
    return line.get("key") == plan.key and not line.get("error") and plan.entry.name in whole


def _remove(collection: Collection, kept: set[str], lines: dict[str, Any], ledger: Ledger) -> None:
    """Remove the files and lines of shapes that are not written any more, and reports of pairs that are no more."""
    layout, everything = collection.layout, read_ledgers(collection.layout.ledgers())
    gone = {*lines, *everything.shapes} - kept
    for name in gone:
        landmarks = layout.landmarks / f"{name}.mrk.json"
        for file in (layout.corresponded(name), layout.thumbnail(name), landmarks):
            file.unlink(missing_ok=True)
            ledger.forget_file(file.relative_to(layout.folder).as_posix())
        if lines.pop(name, None):  # the others are compared again, without it
            for line in lines.values():
                line.pop("unlike", None)
    for pair in everything.pairs:
        if not set(pair) <= set(collection.names):
            layout.report(pair).unlink(missing_ok=True)


def _tell_unlike(layout: Layout, names: list[str], lines: dict[str, Any]) -> None:
    """Add to the lines of shapes why they are far from all others, if they are; unless all have been compared."""
    if all(lines[name].get("unlike") for name in names):
        return
    compared = names[:: len(names) // MOST_COMPARED + 1]
    sampled = []
    for name in compared:
        vertices = read_mesh(layout.corresponded(name)).vertices
        sampled.append(vertices[np.linspace(0, len(vertices) - 1, N_COMPARED).astype(int)])
    doubts = doubtful_positions(compared, np.array(sampled)) if sampled else []
    unlike = {name: doubt.reason for doubt in doubts if doubt.kind == "unlike" for name in doubt.names}
    for name in names:
        lines[name]["unlike"] = unlike.get(name, NOT_UNLIKE)


def _tell_sides(collection: Collection, rows: Rows, lines: dict[str, Any]) -> None:
    """Add to the lines of shapes whether they were reflected, and whether they seem to be mirror images."""
    sides = {"reflected": rows.reflected(collection.names), "mirror_image": mirror_images(collection, rows)}
    for name in collection.names:
        told = {column: "yes" for column, names in sides.items() if name in names}
        if told or name in lines:
            lines[name] = {"name": name, **lines.get(name, {}), **dict.fromkeys(sides, ""), **told}


def _lines_of_table(collection: Collection) -> dict[str, Any]:
    path = collection.layout.shapes_table
    lines = read_csv(path) if path.exists() else []
    return {line["name"]: line for line in lines if set(OWN) <= set(line)}  # others were not written by us
