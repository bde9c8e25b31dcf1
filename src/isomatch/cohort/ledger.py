"""The ledger of a collection: rows of shapes, pairs and files, in SQLite, written by the one process that runs it."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from isomatch._core.errors import FormatError, UnwritableFileError
from isomatch._core.files import claimed
from isomatch.cohort.entries import Pair
from isomatch.cohort.rows import TABLES, FileRow, OriginRow, PairRow, Row, Rows, ShapeRow, row_of

PATIENCE = 60.0  # seconds that a ledger is waited for while another process reads or writes it
_TABLES = """
BEGIN IMMEDIATE;
CREATE TABLE IF NOT EXISTS shapes (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS pairs (source TEXT, target TEXT, record TEXT NOT NULL, PRIMARY KEY (source, target));
CREATE TABLE IF NOT EXISTS files (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS origins (name TEXT PRIMARY KEY, record TEXT NOT NULL);
COMMIT;
"""


class Ledger:
    """A ledger that is open for writing; `rows` are its contents."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection, self._path = connection, path
        self.rows = _rows(connection, path)

    def put_shape(self, name: str, row: ShapeRow) -> None:
        """Write the row of a shape."""
        self._put("shapes", name, row)

    def put_pair(self, pair: Pair, row: PairRow) -> None:
        """Write the row of a pair."""
        self._put("pairs", pair, row)

    def put_file(self, name: str, digest: str) -> None:
        """Write the digest of a file, by its path in the folder."""
        self._put("files", name, FileRow(time=time.time(), file=digest))

    def forget_file(self, name: str) -> None:
        """Remove the row of a file, if there is one."""
        if self.rows.files.pop(name, None):
            self._execute("DELETE FROM files WHERE name = ?", name)

    def put_origin(self, name: str, made_with: Mapping[str, Any]) -> None:
        """Write a version and settings, by the name that rows have for them."""
        if name not in self.rows.origins:
            self._put("origins", name, OriginRow(time=time.time(), made_with=made_with))

    def forget_failed_shapes(self) -> None:
        """Remove the rows of shapes that could not be prepared."""
        for name in [name for name, row in self.rows.shapes.items() if row.state == "failed"]:
            del self.rows.shapes[name]
            self._execute("DELETE FROM shapes WHERE name = ?", name)

    def _put(self, table: str, name: str | Pair, row: Row) -> None:
        record = row.to_json()
        getattr(self.rows, table)[name] = type(row).from_json(record)  # as it would be read
        values = *([name] if isinstance(name, str) else name), json.dumps(record)
        self._execute(f"INSERT OR REPLACE INTO {table} VALUES ({', '.join('?' * len(values))})", *values)

    def _execute(self, command: str, *values: Any) -> None:
        try:
            self._connection.execute(command, values)
        except sqlite3.Error as error:
            raise UnwritableFileError(
                f"{self._path}: cannot be written ({error}); make room, and run again to continue"
            ) from None


@contextmanager
def writing_ledger(path: Path, *, one_host: bool = True) -> Iterator[Ledger]:
    """Open a ledger for writing; it is made if it does not exist, and no other process may write it.

    Where only processes of ``one_host`` read it meanwhile, they need not wait (SQLite's write-ahead log).
    """
    with claimed(path), closing(_connected(path, one_host)) as connection:
        with _named(path, "not a ledger"):
            ledger = Ledger(connection, path)
        yield ledger
        with suppress(sqlite3.OperationalError):  # somebody reads it
            connection.execute("PRAGMA busy_timeout = 0")
            # leaves a file that needs no others, also to be read
            connection.execute("PRAGMA journal_mode = DELETE")


def _connected(path: Path, one_host: bool) -> sqlite3.Connection:
    try:
        connection = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
    except sqlite3.Error as error:
        raise UnwritableFileError(f"{path}: cannot be written ({error}); give a writable folder") from None
    try:
        with _named(path, "not a ledger"):
            connection.execute(f"PRAGMA journal_mode = {'WAL' if one_host else 'DELETE'}")
            if one_host:
                # a power failure may take the last rows; the files of maps, which have them too, stay
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
        is_usual = isinstance(error, sqlite3.OperationalError)
        if not is_usual or error.sqlite_errorcode == sqlite3.SQLITE_ERROR:
            raise FormatError(f"{path}: {problem} ({error}); move it away, and run again") from None
        raise UnwritableFileError(
            f"{path}: cannot be used ({error}); wait until nobody else uses it, or make room, and run again"
        ) from None


def read_ledgers(paths: Iterable[Path]) -> Rows:
    """Read the rows of several ledgers, also while they are written; `FormatError` if a file is none."""
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
    for table in TABLES:
        if table not in present:  # another process has just begun it, or it is of an earlier version
            continue
        # all at once: while rows are read, nobody can write them
        for *names, text in connection.execute(f"SELECT * FROM {table}").fetchall():
            row = row_of(table, text)
            if row is None:
                rows.damaged.append(f"the row of {' and '.join(map(str, names))} in {path.name}")
            else:
                getattr(rows, table)[names[0] if len(names) == 1 else tuple(names)] = row
    return rows
