"""Reports of the pairs to look at, from their saved maps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from shlex import join
from typing import Any, Literal

from isomatch.assets import mesh_from
from isomatch.collections.collection import Collection
from isomatch.collections.jobs import row_of
from isomatch.collections.layout import Layout
from isomatch.collections.map_file import Record, as_matched
from isomatch.collections.pairs import Pair
from isomatch.collections.states import is_contradicted
from isomatch.collections.tables import MOST_SHOWN, table_of
from isomatch.collections.workers import Task, late_after, workers_of
from isomatch.correspondence import Correspondence
from isomatch.errors import SettingError
from isomatch.matching import MatchResult, Outcome
from isomatch.storage.files import writing
from isomatch.values.arrays import FloatArray
from isomatch.view import write_report

ALSO = 3  # the worst of the pairs that are not in doubt


def write_reports(
    collection: Collection,
    which: int | Literal["doubtful", "all"] = "doubtful",
    executor: str | Executor = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[tuple[Pair, Record]]:
    """Write the reports of pairs that have none of their present map.

    Parameters
    ----------
    collection : Collection
        The collection.
    which : int, or "doubtful" or "all"
        So many of the worst pairs; those on the page that are not ``CONVERGED``, and the three next; or all.
    executor, jobs, time_limit
        As for `Collection.run`.

    Raises
    ------
    SettingError
        If the number is negative.
    UnwritableFileError
        If the folder cannot be made.

    Yields
    ------
    (str, str), dict
        Each pair with a row: its ``state``, "done" or "failed", with the ``error``.
    """
    if not isinstance(which, str) and which < 0:
        raise SettingError(f"{which} reports cannot be written; give a number, or doubtful, all or none")
    late = late_after(time_limit)
    rows = collection.rows()
    chosen = [(pair, rows.pairs[pair]) for pair in _chosen(table_of(rows), which)]
    todo = [(pair, row) for pair, row in chosen if not has_report(collection.layout, pair, row)]
    if not todo:
        return
    folder = collection.layout.folder / "reports"
    with writing(folder):
        folder.mkdir(exist_ok=True)
    tasks = [Task(((pair, row),), partial(_reported, collection.of(pair))) for pair, row in todo]
    with workers_of(executor, jobs) as workers:
        for (pair, _), row in workers.completed(tasks, late):
            yield pair, row if isinstance(row, dict) else {"state": "failed", "error": str(row)}


def has_report(layout: Layout, pair: Pair, record: Record) -> bool:
    """Whether there is a report of the map that a pair has now."""
    path = layout.report(pair)
    return record["state"] == "done" and path.exists() and path.stat().st_mtime >= record["time"]


def _chosen(lines: list[dict[str, Any]], which: int | str) -> list[Pair]:
    """Choose from the lines of the table, worst first."""
    matched = [line for line in lines if line["state"] == "done"]
    if which == "doubtful":
        which = min(sum(line["outcome"] != Outcome.CONVERGED.name for line in matched) + ALSO, MOST_SHOWN)
    return [(line["source"], line["target"]) for line in matched[: None if which == "all" else int(which)]]


def _reported(collection: Collection, items: Sequence[tuple[Pair, Record]]) -> list[Record]:
    return [row_of(partial(_written, collection, *item)) for item in items]


def _written(collection: Collection, pair: Pair, record: Record) -> Record:
    """Write the report of a pair, source → target."""
    files = [collection.paths[name] for name in pair]
    source_turned, target_turned = (name in record.get("reflected", ()) for name in pair)
    maps = collection.maps(*pair)
    there = maps.there
    source, target = map(mesh_from, files)
    there, source, target = as_matched(there, source, target, (source_turned, target_turned))
    command = join(["isomatch", "match", *map(str, files)])
    if source_turned != target_turned:
        command += " --orientation any"
    path = collection.layout.report(pair)
    write_report(
        path,
        source,
        target,
        _result(collection, record, there, maps.there_error),
        names=pair,
        command=f"{command} -o DIR --landmarks landmarks.txt",
    )
    return {"bytes": path.stat().st_size}


def _result(
    collection: Collection, record: Record, there: Correspondence, errors: FloatArray | None
) -> MatchResult:
    """Restore the result of a match from its saved parts, and say what is not in them."""
    summary = record["there"]
    notes = list(summary["notes"])
    if summary["alternatives"]:
        notes.append("a collection does not keep alternatives; isomatch match finds them again")
    if is_contradicted(record):
        notes.insert(0, f"other maps contradict it by {record['agreement']['inconsistency']:.2f} √area")
    result = replace(MatchResult.from_dict(summary, there, collection.config), notes=tuple(notes))
    return result if errors is None else replace(result, expected_error=errors)
