"""The ledger of a collection: rows of shapes, pairs and files, in SQLite, written by the one process that runs it."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from isomatch.collections.map_file import SIDES, Record
from isomatch.collections.pairs import Pair
from isomatch.collections.row_kinds import OF_FILES, OF_ORIGINS, OF_PAIRS, OF_SHAPES, Kinds, record_of
from isomatch.errors import FormatError, UnwritableFileError
from isomatch.matching import Outcome
from isomatch.storage.files import claimed

PATIENCE = 60.0  # seconds that a ledger is waited for while another process reads or writes it
_TABLES = """
BEGIN IMMEDIATE;
CREATE TABLE IF NOT EXISTS shapes (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS pairs (source TEXT, target TEXT, record TEXT NOT NULL, PRIMARY KEY (source, target));
CREATE TABLE IF NOT EXISTS files (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS origins (name TEXT PRIMARY KEY, record TEXT NOT NULL);
COMMIT;
"""


@dataclass
class Rows:
    """The rows of a collection.

    Parameters
    ----------
    shapes, pairs : dict
        Of shapes and pairs, by name.
    files : dict of str to dict
        Of files without such a row: their ``file``, the digest of their bytes, by their path in the folder.
    origins : dict of str to dict
        The version and the settings that rows were ``made_with``.
    damaged : list of str
        Where rows were that cannot be used, such as "the row of a and b in ledger.sqlite".
    """

    shapes: dict[str, Record] = field(default_factory=dict)
    pairs: dict[Pair, Record] = field(default_factory=dict)
    files: dict[str, Record] = field(default_factory=dict)
    origins: dict[str, Record] = field(default_factory=dict)
    damaged: list[str] = field(default_factory=list)

    def merge(self, other: Rows) -> None:
        """Add rows; of two for the same shape or pair, one that is done counts, and otherwise the later one.

        Of two for a shape whose file changed between them, the later one counts.
        """
        _merge(self.shapes, other.shapes)
        _merge(self.pairs, other.pairs)
        _merge(self.files, other.files)
        self.origins |= other.origins
        self.damaged += other.damaged

    def reflected(self, names: Iterable[str]) -> list[str]:
        """Return those of some shapes that are matched as their mirror images."""
        return [name for name in names if self.shapes.get(name, {}).get("reflected")]

    def is_current(self, pair: Pair) -> bool:
        """Whether a pair is matched, and its shapes are still those that were, reflected as then."""
        row = self.pairs.get(pair, {})
        if row.get("state") != "done" or row.get("reflected", []) != self.reflected(pair):
            return False
        hashes = [self.shapes.get(name, {}).get("hash") for name in pair]
        return [row["source_hash"], row["target_hash"]] == hashes

    def is_doubtful(self, pair: Pair) -> bool:
        """Whether a pair is current, and one of its maps may be wrong altogether."""
        return self.is_current(pair) and any(
            Outcome[self.pairs[pair][side]["outcome"]].is_doubtful for side in SIDES
        )

    def of_pairs(self, pairs: Iterable[Pair]) -> Rows:
        """Return the same with some of its pairs."""
        return replace(self, pairs={pair: self.pairs[pair] for pair in pairs if pair in self.pairs})

    def of(self, names: Iterable[str]) -> Rows:
        """Return the rows of some shapes, and of the pairs of these."""
        kept = set(names)
        return Rows(
            {name: row for name, row in self.shapes.items() if name in kept},
            {pair: row for pair, row in self.pairs.items() if kept.issuperset(pair)},
            self.files,
            self.origins,
            self.damaged,
        )


K = TypeVar("K")


def _merge(mine: dict[K, Record], theirs: dict[K, Record]) -> None:
    for name, record in theirs.items():
        if name not in mine or _counts_more(record, mine[name]):
            mine[name] = record


def _counts_more(one: Record, other: Record) -> bool:
    if any(one.get(of_file) != other.get(of_file) for of_file in ("size", "changed")):
        return bool(one["time"] > other["time"])  # the file of the shape changed
    return (one["state"] == "done", one["time"]) > (other["state"] == "done", other["time"])


class Ledger:
    """A ledger that is open for writing; `rows` are its contents."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection, self._path = connection, path
        self.rows = _rows(connection, path)

    def put_shape(self, name: str, record: Record) -> None:
        """Write the row of a shape."""
        self.rows.shapes[name] = record
        self._put("INSERT OR REPLACE INTO shapes VALUES (?, ?)", name, record)

    def put_pair(self, pair: Pair, record: Record) -> None:
        """Write the row of a pair."""
        self.rows.pairs[pair] = record
        self._put("INSERT OR REPLACE INTO pairs VALUES (?, ?, ?)", *pair, record)

    def put_file(self, name: str, record: Record) -> None:
        """Write the row of a file, by its path in the folder."""
        self.rows.files[name] = record
        self._put("INSERT OR REPLACE INTO files VALUES (?, ?)", name, record)

    def forget_file(self, name: str) -> None:
        """Remove the row of a file, if there is one."""
        if self.rows.files.pop(name, None):
            self._execute("DELETE FROM files WHERE name = ?", name)

    def put_origin(self, name: str, made_with: Record) -> None:
        """Write a version and settings, by the name that rows have for them."""
        if name not in self.rows.origins:
            self.rows.origins[name] = {"state": "done", "time": time.time(), "made_with": made_with}
            self._put("INSERT OR REPLACE INTO origins VALUES (?, ?)", name, self.rows.origins[name])

    def forget_failed_shapes(self) -> None:
        """Remove the rows of shapes that could not be prepared."""
        for name in [name for name, record in self.rows.shapes.items() if record["state"] == "failed"]:
            del self.rows.shapes[name]
            self._execute("DELETE FROM shapes WHERE name = ?", name)

    def _put(self, command: str, *values: str | Record) -> None:
        *names, record = values
        self._execute(command, *names, json.dumps(record))

    def _execute(self, command: str, *values: Any) -> None:
        try:
            self._connection.execute(command, values)
        except sqlite3.Error as error:
            raise UnwritableFileError(
                f"{self._path}: cannot be written ({error}); make room, and run again to continue"
            ) from None


@contextmanager
def writing_ledger(path: Path, *, one_host: bool = True) -> Iterator[Ledger]:
    """Open a ledger for writing; it is made if it does not exist.

    Parameters
    ----------
    path : Path
        The file.
    one_host : bool
        Whether only processes of this machine read it meanwhile. They need not wait then (SQLite's write-ahead log),
        which does not work across machines.

    Raises
    ------
    UnwritableFileError
        If another process writes it, or it cannot be written.
    FormatError
        If the file is something else.
    """
    with claimed(path), closing(_connected(path, one_host)) as connection:
        with _named(path, "not a ledger"):
            ledger = Ledger(connection, path)
        yield ledger
        with suppress(sqlite3.OperationalError):  # somebody reads it
            connection.execute("PRAGMA busy_timeout = 0")
            connection.execute(
                "PRAGMA journal_mode = DELETE"
            )  # leaves a file that needs no others, also to be read


def _connected(path: Path, one_host: bool) -> sqlite3.Connection:
    try:
        connection = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
    except sqlite3.Error as error:
        raise UnwritableFileError(f"{path}: cannot be written ({error}); give a writable folder") from None
    try:
        with _named(path, "not a ledger"):
            connection.execute(f"PRAGMA journal_mode = {'WAL' if one_host else 'DELETE'}")
            if (
                one_host
            ):  # a power failure may take the last rows; the files of maps, which have them too, stay
                connection.execute("PRAGMA synchronous = NORMAL")
            connection.executescript(_TABLES)
    except BaseException:
        connection.close()
        raise
    return connection


@contextmanager
def _named(path: Path, problem: str) -> Iterator[None]:
    """Turn errors of SQLite into ours; a file that is locked, or on a full disk, is not reported as damaged."""
    try:
        yield
    except sqlite3.Error as error:
        damaged = (
            not isinstance(error, sqlite3.OperationalError) or error.sqlite_errorcode == sqlite3.SQLITE_ERROR
        )
        if damaged:
            raise FormatError(f"{path}: {problem} ({error}); move it away, and run again") from None
        raise UnwritableFileError(
            f"{path}: cannot be used ({error}); wait until nobody else uses it, or make room, and run again"
        ) from None


def read_ledgers(paths: Iterable[Path]) -> Rows:
    """Read the rows of several ledgers, also while they are written.

    Raises
    ------
    FormatError
        If a file is no ledger.
    """
    rows = Rows()
    for path in paths:
        # reading undoes the half-written changes of a killed process, which mode=ro could not
        address = f"{path.resolve().as_uri()}?mode=rw"
        with (
            _named(path, "cannot be read as a ledger"),
            closing(sqlite3.connect(address, timeout=PATIENCE, uri=True)) as connection,
        ):
            rows.merge(_rows(connection, path))
    return rows


def _rows(connection: sqlite3.Connection, path: Path) -> Rows:
    present = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
    rows = Rows()
    tables: dict[str, tuple[dict[Any, Record], Kinds]] = {
        "shapes": (rows.shapes, OF_SHAPES),
        "pairs": (rows.pairs, OF_PAIRS),
        "files": (rows.files, OF_FILES),
        "origins": (rows.origins, OF_ORIGINS),
    }
    for table, (into, kinds) in tables.items():
        if table not in present:  # another process has just begun it, or it is of an earlier version
            continue
        # all at once: while rows are read, nobody can write them
        for *names, text in connection.execute(f"SELECT * FROM {table}").fetchall():
            record = record_of(text, kinds)
            if record is None:
                rows.damaged.append(f"the row of {' and '.join(map(str, names))} in {path.name}")
            else:
                into[names[0] if len(names) == 1 else tuple(names)] = record
    return rows
