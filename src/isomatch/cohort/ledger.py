"""The ledger of a collection: rows of shapes, pairs and files, in SQLite, written by the one process that runs it."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import UnionType
from typing import Any

from isomatch._core.errors import FormatError, UnwritableFileError
from isomatch._core.files import claimed
from isomatch.cohort.entries import Pair
from isomatch.matching import Outcome

Record = dict[str, Any]
"""What is known of a shape or a pair, as plain values."""
SIDES = ("there", "back")
CONTRADICTED = 0.1  # √area: a mean error from which a map counts as a failure; right maps reach half of it
N_EIGENVALUES, N_QUANTILES = 30, 20  # of the features by which a template is chosen
N_RANKS = 64  # distances from the centroid by which shapes are compared
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
    """The rows of a collection: those of shapes and of pairs, and of what else its folder holds."""

    shapes: dict[str, Record] = field(default_factory=dict)
    pairs: dict[Pair, Record] = field(default_factory=dict)
    files: dict[str, Record] = field(default_factory=dict)  # "file": digest, by their path in the folder
    origins: dict[str, Record] = field(default_factory=dict)  # version and settings by "made_with" of rows
    damaged: list[str] = field(default_factory=list)  # such as "the row of a and b in ledger.sqlite"

    def merge(self, other: Rows) -> None:
        """Add rows; of two for one name, one that is done counts, else, or if the file of a shape changed, the later."""
        for table in ("shapes", "pairs", "files"):
            mine = getattr(self, table)
            for name, record in getattr(other, table).items():
                if name not in mine or _counts_more(record, mine[name]):
                    mine[name] = record
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
        row = self.pairs.get(pair, {})
        return self.is_current(pair) and any(Outcome[row[side]["outcome"]].is_doubtful for side in SIDES)

    def path(self, source: str, target: str) -> tuple[str, ...] | None:
        """Return the shapes on the shortest way from one to another by maps that are not doubtful; None without any."""
        linked: dict[str, list[str]] = {}
        for pair in self.pairs:
            if self.is_current(pair) and not self.is_doubtful(pair):
                for one, other in (pair, pair[::-1]):
                    linked.setdefault(one, []).append(other)
        before, front = {source: source}, [source]
        while front and target not in before:
            found = {other: one for one in front for other in linked.get(one, ()) if other not in before}
            before |= found
            front = list(found)
        if target not in before:
            return None
        path = [target]
        while path[-1] != source:
            path.append(before[path[-1]])
        return tuple(reversed(path))

    def of(self, names: Iterable[str]) -> Rows:
        """Return the rows of some shapes, and of the pairs of these."""
        kept = set(names)
        shapes = {name: row for name, row in self.shapes.items() if name in kept}
        pairs = {pair: row for pair, row in self.pairs.items() if kept.issuperset(pair)}
        return replace(self, shapes=shapes, pairs=pairs)


def _counts_more(one: Record, other: Record) -> bool:
    if any(one.get(of_file) != other.get(of_file) for of_file in ("size", "changed")):
        return bool(one["time"] > other["time"])
    return (one["state"] == "done", one["time"]) > (other["state"] == "done", other["time"])


class Ledger:
    """A ledger that is open for writing; `rows` are its contents."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection, self._path = connection, path
        self.rows = _rows(connection, path)

    def put_shape(self, name: str, record: Record) -> None:
        """Write the row of a shape."""
        self._put("shapes", name, record)

    def put_pair(self, pair: Pair, record: Record) -> None:
        """Write the row of a pair."""
        self._put("pairs", pair, record)

    def put_file(self, name: str, record: Record) -> None:
        """Write the row of a file, by its path in the folder."""
        self._put("files", name, record)

    def forget_file(self, name: str) -> None:
        """Remove the row of a file, if there is one."""
        if self.rows.files.pop(name, None):
            self._execute("DELETE FROM files WHERE name = ?", name)

    def put_origin(self, name: str, made_with: Record) -> None:
        """Write a version and settings, by the name that rows have for them."""
        if name not in self.rows.origins:
            self._put("origins", name, {"state": "done", "time": time.time(), "made_with": made_with})

    def forget_failed_shapes(self) -> None:
        """Remove the rows of shapes that could not be prepared."""
        for name in [name for name, record in self.rows.shapes.items() if record["state"] == "failed"]:
            del self.rows.shapes[name]
            self._execute("DELETE FROM shapes WHERE name = ?", name)

    def _put(self, table: str, name: str | Pair, record: Record) -> None:
        getattr(self.rows, table)[name] = record
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
    for table, kinds in _KINDS.items():
        if table not in present:  # another process has just begun it, or it is of an earlier version
            continue
        # all at once: while rows are read, nobody can write them
        for *names, text in connection.execute(f"SELECT * FROM {table}").fetchall():
            record = record_of(text, kinds)
            if record is None:
                rows.damaged.append(f"the row of {' and '.join(map(str, names))} in {path.name}")
            else:
                getattr(rows, table)[names[0] if len(names) == 1 else tuple(names)] = record
    return rows


# What the values of a row must be, by its state and names, to be used: others were damaged, or are of another program
Kind = type | UnionType | Callable[[Any], bool]
Kinds = Mapping[str, Mapping[str, Kind]]
NUMBER = int | float


def _list_of(kind: Kind, count: int | None = None) -> Callable[[Any], bool]:
    return lambda value: (
        isinstance(value, list) and count in (None, len(value)) and all(_is(each, kind) for each in value)
    )


def _result(value: Any) -> bool:
    quality = value.get("quality") if isinstance(value, dict) else None
    return (
        isinstance(quality, dict)
        and value.get("outcome") in Outcome.__members__
        and {"spectral_residual", "orientation", "mirrored"} <= quality.keys()
        and all(isinstance(each, NUMBER | None) for each in quality.values())
    )


_FEATURES, _holes, _texts = _list_of(NUMBER, N_EIGENVALUES + N_QUANTILES), _list_of(NUMBER, 2), _list_of(str)
_OF_SHAPES: Kinds = {
    "done": {"key": str, "hash": str, "bytes": int, "area": NUMBER, "features": _FEATURES, "notes": _texts},
    "failed": {"error": str},
}
_OF_MATCH: Mapping[str, Kind] = {"source_hash": str, "target_hash": str, **dict.fromkeys(SIDES, _result)}
_OF_PAIRS: Kinds = {
    "done": {"key": str, "attempt": int, **_OF_MATCH},
    "failed": {"key": str, "attempt": int, "error": str},
    "todo": {"attempt": int},
}
_KINDS = {
    "shapes": _OF_SHAPES,
    "pairs": _OF_PAIRS,
    "files": {"done": {"file": str}},
    "origins": {"done": {"made_with": dict}},
}
_OPTIONAL: Mapping[str, Kind] = {  # what other values must be, where a row has them
    **dict.fromkeys(("file", "error", "source_hash", "target_hash", "led_by"), str),
    **dict.fromkeys(("seconds", "spread", "handedness"), NUMBER),
    **dict.fromkeys(("again", "replaced_by"), _texts),
    "memory": NUMBER | None,
    "reflected": lambda value: isinstance(value, bool) or _texts(value),
    "made_with": str | dict,
    "agreement": lambda value: isinstance(value, dict) and _is(value.get("inconsistency", 0.0), NUMBER),
    "not_reflected": lambda value: isinstance(value, dict) and _texts(list(value.values())),
    "n_points": int,
    "ranks": _list_of(NUMBER, N_RANKS),
    "holes": lambda value: value is None or _holes(value),
}


def record_of(text: Any, kinds: Kinds) -> Record | None:
    """Read a row, which has a state and the time and what belongs to its state; None if it is no such row."""
    try:
        record: Record = json.loads(text)
        needed = {"time": NUMBER, **kinds[record["state"]]}
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    wanted = {name: kind for name, kind in _OPTIONAL.items() if name in record} | needed
    return record if all(_is(record.get(name), kind) for name, kind in wanted.items()) else None


def _is(value: Any, kind: Kind) -> bool:
    return isinstance(value, kind) if isinstance(kind, type | UnionType) else kind(value)


def state_of(record: Record) -> str:
    """Return the state of a pair: "todo", "failed", "low" (matched with low confidence) or "done"."""
    if record["state"] == "done" and Outcome[record["there"]["outcome"]].is_doubtful:
        return "low"
    return str(record["state"])


def is_mirrored(record: Record) -> bool:
    """Whether the mirror image of one of its shapes fits clearly better than the map of a pair."""
    outcomes = [record[side]["outcome"] for side in SIDES] if record["state"] == "done" else []
    return Outcome.MIRROR_IMAGE.name in outcomes


def is_contradicted(record: Record) -> bool:
    """Whether other maps contradict that of a pair, as far as they were compared."""
    return bool(record.get("agreement", {}).get("inconsistency", 0.0) > CONTRADICTED)


def was_contradicted(record: Record) -> bool:
    """Whether other maps contradict that of a pair, or did before it was to be matched again."""
    return is_contradicted(record) or bool(record.get("contradicted", False))
