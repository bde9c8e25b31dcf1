"""The rows of benchmark runs on disk: one line of JSON each, identified by version and settings among others."""

from __future__ import annotations

import errno
import json
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from isomatch._core.errors import FormatError
from isomatch._core.files import claimed, writing

Row: TypeAlias = dict[str, Any]
"""Measurements for one pair and one method, or the problem that prevented them."""

# columns by which rows are the same measurement
IDENTITY = ("set", "damage", "pair", "method", "points", "seed", "judged_at", "version", "settings", "data")
LEDGER_FILE = "rows.jsonl"  # name of the file with all rows of a run
logger = logging.getLogger(__name__)


def read_rows(out: str | Path) -> list[Row]:
    """Read the rows of a folder of benchmark runs.

    Parameters
    ----------
    out : path_like
        Folder of the runs; there are no rows if it does not exist.

    Returns
    -------
    list of dict
        In the order of writing. Of several rows with the same set, damage, pair, method, points, seed, kind of truth,
        version of isomatch, settings of the method and files of the set, the last one. An incomplete last line, as an
        interrupted run leaves it, is left out, with a warning in the log.

    Raises
    ------
    FormatError
        If any other line is not a row.
    """
    path = Path(out) / LEDGER_FILE
    if not path.exists():
        return []
    *lines, rest = path.read_bytes().split(b"\n")
    if rest:
        logger.warning("%s: the last line is incomplete and is left out; its pair has to be run again", path)
    rows: dict[tuple[Any, ...], Row] = {}
    for number, line in enumerate(lines, 1):
        try:
            row = json.loads(line)
            identity = identity_of(row)
            hash(identity)
        except (ValueError, TypeError, AttributeError, RecursionError) as error:
            raise FormatError(
                f"{path}:{number}: not a row of a benchmark run ({error}); remove this line, and its pair is run again"
            ) from error
        rows.pop(identity, None)  # rows stay in the order in which they were written
        rows[identity] = row
    return list(rows.values())


@contextmanager
def appending(out: str | Path) -> Iterator[Callable[[Row], None]]:
    """Open the rows of a folder for one process to write; gives a function that adds a row in a single write."""
    path = Path(out) / LEDGER_FILE

    def append(row: Row) -> None:
        line = json.dumps(row, allow_nan=False).encode() + b"\n"
        with writing(path), path.open("ab+", buffering=0) as file:
            size = file.tell()
            if file.write(line) < len(line):
                file.truncate(size)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with claimed(path):
        if path.exists():
            with writing(path), path.open("r+b") as file:
                file.truncate(file.read().rfind(b"\n") + 1)
        yield append


def set_label(row: Row) -> str:
    """Set of a row, and the damage to it if there is any: "creatures, cut:0.3"."""
    return ", ".join(filter(None, (row["set"], row.get("damage"))))


def identity_of(row: Row) -> tuple[Any, ...]:
    """Values that identify a row; None for those that rows of early versions lack."""
    return tuple(row.get(name) for name in IDENTITY)
