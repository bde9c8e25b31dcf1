"""Rows about shapes, pairs and files, and the SQLite ledgers that keep them as JSON."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from types import UnionType
from typing import Any, ClassVar, Literal, Self

from isomatch._core.errors import FormatError, UnwritableFileError
from isomatch._core.files import claimed
from isomatch._core.tables import read_table
from isomatch._core.texts import write_csv
from isomatch.correspondence import SIDES
from isomatch.matching import MatchResult, Outcome

State = Literal["todo", "failed", "done"]  # state of a shape or a pair
Pair = tuple[str, str]
"""Names of two shapes; both directions are matched."""
# √area; other maps contradict a map if the mean distance of its images from the images under compositions of two other
# maps exceeds this. Right maps have at most 0.03 to 0.16 in four sets, wrong maps at least 0.14 to 0.21: decisions.md,
# contradicted maps
MAX_INCONSISTENCY = 0.1
# Numbers of Laplace eigenvalues, and of quantiles of geodesic distances, that describe a shape; chosen.
N_EIGENVALUES, N_QUANTILES = 30, 20
# number of quantiles of the distances of vertices from their centroid, to find equal shapes; chosen
N_RANKS = 64
LOCK_TIMEOUT = 60.0  # longest wait, in seconds, for another process that reads or writes the ledger; chosen
_CREATE_TABLES = """
BEGIN IMMEDIATE;
CREATE TABLE IF NOT EXISTS shapes (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS pairs (source TEXT, target TEXT, record TEXT NOT NULL, PRIMARY KEY (source, target));
CREATE TABLE IF NOT EXISTS files (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS origins (name TEXT PRIMARY KEY, record TEXT NOT NULL);
COMMIT;
"""


@dataclass(frozen=True)
class MapSummary:
    """The map of a pair in one direction: `MatchResult.to_dict` without the settings."""

    values: Mapping[str, Any] = field(default_factory=dict)  # empty where nothing is matched

    @classmethod
    def of(cls, result: MatchResult, *, settings: bool = False) -> MapSummary:
        """Describe a result, by default without the settings, which are those of the collection."""
        return cls({name: value for name, value in result.to_dict().items() if settings or name != "config"})

    @property
    def outcome(self) -> Outcome:
        """How the match ended, or what the comparison with other maps made of it."""
        return Outcome[self.values["outcome"]]

    @property
    def measures(self) -> Mapping[str, float | None]:
        """The measures of `Quality`, None where there is none."""
        return dict(self.values.get("quality", {}))

    @property
    def notes(self) -> list[str]:
        """The notes of the match."""
        return list(self.values["notes"])

    @property
    def doubtful_area(self) -> float | None:
        """Share of the surface in doubtful regions; None without a map, or if all may be wrong."""
        areas = [region["area"] for region in self.values.get("regions", [])]
        is_unclear = not self.values or (self.outcome.is_doubtful and not areas)
        return None if is_unclear else float(sum(areas))

    def with_outcome(self, outcome: Outcome) -> MapSummary:
        """Return the same with another outcome."""
        return MapSummary({**self.values, "outcome": outcome.name, "advice": outcome.advice})


@dataclass(frozen=True, kw_only=True)
class Row:
    """Values that are written as one JSON object; those equal to their default are left out."""

    always: ClassVar[tuple[str, ...]] = ("state", "time")  # fields that are written even with their defaults
    of_done: ClassVar[tuple[str, ...]] = ()  # further fields of this kind if the state is "done"
    # values that were read under names that this version does not know
    more: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def from_json(cls, record: Mapping[str, Any]) -> Self:
        """Take the values of an object."""
        known = cls.defaults()
        named = {_FIELD_OF_KEY.get(key, key): value for key, value in record.items()}
        values = {name: _READERS.get(name, _plain)(value) for name, value in named.items() if name in known}
        return cls(more={name: value for name, value in named.items() if name not in known}, **values)

    def to_json(self) -> dict[str, Any]:
        """Return the object."""
        given = {_KEY_OF_FIELD.get(name, name): _to_plain(value) for name, value in self.given().items()}
        return {**given, **self.more}

    def given(self) -> dict[str, Any]:
        """Return the values that are written, by the names of their fields."""
        needed = {*self.always, *(self.of_done if getattr(self, "state", "") == "done" else ())}
        values = ((name, getattr(self, name), default) for name, default in self.defaults().items())
        return {name: value for name, value, default in values if name in needed or value != default}

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Return the default of each value."""
        stored = [x for x in fields(cls) if x.name != "more"]
        made = {x.name: x.default_factory() for x in stored if x.default_factory is not MISSING}
        return {x.name: made.get(x.name, x.default) for x in stored}


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _to_plain(value: Any) -> Any:
    if isinstance(value, MapSummary):
        return value.values
    return value.to_json() if isinstance(value, Row) else value


@dataclass(frozen=True, kw_only=True)
class ShapeRow(Row):
    """What is known of a shape."""

    of_done = ("reflected", "bytes", "n_vertices", "area", "features", "holes", "notes")
    size: int | None = None  # size of the shape's file, in bytes
    changed: int | None = None  # when the shape's file was changed, in ns since the epoch
    state: State
    time: float = 0.0  # when the row was made, in seconds since the epoch
    error: str = ""
    seconds: float | None = None  # wall time of the preparation
    key: str = ""  # identifies the prepared shape
    hash: str = ""  # content hash of the surface in the shape's file
    reflected: bool = False  # whether the shape is matched as its mirror image
    bytes: int = 0  # size of the file of the prepared shape
    file: str = ""  # digest of the file of the prepared shape
    n_vertices: int = 0  # vertices of the surface in the shape's file
    area: float = 0.0  # area of the surface in the shape's file
    features: tuple[float, ...] = ()  # numbers by which a template is chosen, see `features_of`
    # number of different positions of its vertices; for this and the next three, see `likeness_of`
    n_points: int = 0
    spread: float = 0.0  # root mean square distance of these positions from their centroid
    ranks: tuple[float, ...] = ()  # quantiles of these distances over the spread
    handedness: float | None = None  # number without a unit that changes its sign by a reflection
    holes: tuple[int, float] | None = None  # number of boundaries, and their total length in √area
    notes: tuple[str, ...] = ()
    made_with: str = ""  # key of its `OriginRow`
    again: tuple[str, ...] = ()  # why the shape was prepared again

    @property
    def hashes(self) -> tuple[str, ...]:
        """Hash of the surface in its file."""
        return (self.hash,)


@dataclass(frozen=True, kw_only=True)
class PairAgreement(Row):
    """How the maps of a pair agree with the others of a collection, see `agree`."""

    before: float | None = None  # the inconsistency when it was measured for the first time
    # mean distance, in √area, of the images of the map from the images under compositions of two other maps
    inconsistency: float | None = None
    outcomes: tuple[str, ...] = ()  # outcomes of the match of the pair itself, in both directions
    tried_with: int | None = None  # number of compared shapes when a replacement was tried last
    refused: str = ""  # why the map was not replaced


@dataclass(frozen=True, kw_only=True)
class MapRecord(Row):
    """What the file of the maps of a pair tells of them."""

    always: ClassVar[tuple[str, ...]] = ("reflected", "memory")
    key: str = ""  # identifies the match
    source_hash: str = ""  # hash of the surface in the source's file
    target_hash: str = ""
    reflected: tuple[str, ...] = ()  # names of the shapes that were matched as mirror images
    led_by: str = ""  # key of the map of the leading structure from which the match started
    forward: MapSummary = MapSummary()  # the map source → target
    backward: MapSummary = MapSummary()  # the map target → source
    seconds: float | None = None  # wall time of the match
    memory: float | None = None  # most bytes of memory that the process had used when the match ended
    replaced_by: tuple[str, ...] = ()  # shapes along the composition of maps that replaced the map

    @property
    def sides(self) -> tuple[MapSummary, MapSummary]:
        """Both directions."""
        return self.forward, self.backward

    @property
    def hashes(self) -> tuple[str, ...]:
        """Hashes of the surfaces in both files."""
        return self.source_hash, self.target_hash


@dataclass(frozen=True, kw_only=True)
class PairRow(MapRecord):
    """What is known of a pair and its maps."""

    always = ("state", "time", "reflected", "attempt")
    of_done = ("memory",)
    attempt: int = 0  # number of earlier attempts, added to the seed
    state: State
    time: float = 0.0  # when the row was made, in seconds since the epoch
    error: str = ""
    file: str = ""  # digest of the file of the maps
    contradicted: bool | None = None  # whether other maps contradict the map that a new one is to replace
    made_with: str = ""  # key of its `OriginRow`
    again: tuple[str, ...] = ()  # why the pair was matched again
    not_reflected: Mapping[str, str] = field(default_factory=dict)  # why a shape is not reflected
    agreement: PairAgreement | None = None  # None if the pair was not compared

    @property
    def verdict(self) -> Literal["todo", "failed", "low", "done"]:
        """Its state; "low" if it is matched with low confidence."""
        return "low" if self.state == "done" and self.forward.outcome.is_doubtful else self.state

    @property
    def ending(self) -> str:
        """Name of the outcome; the state where there is no map."""
        return self.forward.outcome.name if self.forward.values else self.state

    @property
    def is_mirrored(self) -> bool:
        """Whether the mirror image of one of its shapes fits clearly better."""
        return self.state == "done" and any(side.outcome is Outcome.MIRROR_IMAGE for side in self.sides)

    @property
    def inconsistency(self) -> float:
        """Mean distance of its maps from compositions of others, in √area; 0 if not compared."""
        return (self.agreement.inconsistency if self.agreement else None) or 0.0

    @property
    def is_contradicted(self) -> bool:
        """Whether other maps contradict its map; False where they were not compared."""
        return self.inconsistency > MAX_INCONSISTENCY


@dataclass(frozen=True, kw_only=True)
class FileRow(Row):
    """The digest of a file."""

    state: State = "done"
    time: float  # when the row was made, in seconds since the epoch
    file: str


@dataclass(frozen=True, kw_only=True)
class OriginRow(Row):
    """Version and settings, which rows name by ``made_with``."""

    state: State = "done"
    time: float  # when the row was made, in seconds since the epoch
    made_with: Mapping[str, Any]


Cell = str | float  # cell of a table: a text if the table was read


@dataclass(frozen=True, kw_only=True)
class SurfaceRow:
    """A line of ``shapes.csv``: a shape in the template's topology; empty cells have no value."""

    name: str
    key: str = ""  # identifies the map
    turned: Cell = ""  # share of the faces that are inverted; for this and the next three, see `WrapQuality`
    stretch: Cell = ""  # 99th percentile of the factor by which edges grow or shrink, relative to the median
    distance: Cell = ""  # mean distance of the vertices from the shape's surface, in √area
    extended: Cell = ""  # number of vertices without a counterpart on the shape
    error: str = ""
    expected_error: Cell = ""  # expected error of the map, in √area
    ways: Cell = ""  # number of maps from the template, along different shapes, whose median this surface is
    scale: Cell = ""  # factor by which positions were multiplied
    reflected: str = ""  # yes if the shape was matched as its mirror image
    mirror_image: str = ""
    unlike: str = ""  # why the shape is far from all others
    # mean distance, in √area, of the template's vertices from their images around a ring
    loop_error: Cell = ""
    greatest_loop_error: Cell = ""  # largest of these distances
    again: str = ""  # what was wrong with the former file of the surface; not a column of the table

    @classmethod
    def read(cls, path: Path) -> dict[str, SurfaceRow]:
        """Read a table if it exists; lines without our columns are left out."""
        lines = read_table(path).records() if path.exists() else []
        lines = [line for line in lines if set(OLDEST_COLUMNS) <= set(line)]
        return {line["name"]: cls(**{name: line.get(name, "") for name in SURFACE_COLUMNS}) for line in lines}

    @staticmethod
    def write(path: Path, lines: Iterable[SurfaceRow]) -> None:
        """Write a table."""
        write_csv(path, map(vars, lines), SURFACE_COLUMNS)


# columns of the table of surfaces: all fields but ``again``
SURFACE_COLUMNS = tuple(column.name for column in fields(SurfaceRow))[:-1]
OLDEST_COLUMNS = SURFACE_COLUMNS[: SURFACE_COLUMNS.index("error") + 1]  # columns that every version writes
_KEY_OF_FIELD = dict(zip(("forward", "backward"), SIDES))  # keys in JSON of fields with other names
_FIELD_OF_KEY = dict(zip(SIDES, _KEY_OF_FIELD))  # fields by their keys in JSON
_READERS: Mapping[str, Callable[[Any], Any]] = {  # functions from JSON to the values of some fields
    **dict.fromkeys(_KEY_OF_FIELD, lambda value: MapSummary(value or {})),
    "agreement": PairAgreement.from_json,
}


@dataclass
class Rows:
    """The rows of shapes, pairs, files and settings of a collection."""

    shapes: dict[str, ShapeRow] = field(default_factory=dict)
    pairs: dict[Pair, PairRow] = field(default_factory=dict)
    files: dict[str, FileRow] = field(default_factory=dict)  # rows of files by their paths in the folder
    # rows of origins, by the key that other rows call ``made_with``
    origins: dict[str, OriginRow] = field(default_factory=dict)
    damaged: list[str] = field(default_factory=list)  # damaged rows: "the row of a and b in ledger.sqlite"

    def merge(self, other: Rows) -> None:
        """Add rows; on conflict keep the finished one, or the newer if a file changed."""
        for table in ("shapes", "pairs", "files"):
            mine = getattr(self, table)
            for name, row in getattr(other, table).items():
                if name not in mine or _counts_more(row, mine[name]):
                    mine[name] = row
        self.origins |= other.origins
        self.damaged += other.damaged

    def pair(self, pair: Pair) -> PairRow:
        """Return the row of a pair, also if it was not tried yet."""
        return self.pairs.get(pair, PairRow(state="todo"))

    def untried(self, pairs: Iterable[Pair]) -> list[Pair]:
        """Select the pairs that were not tried yet, or are to be matched again."""
        return [pair for pair in pairs if self.pair(pair).state == "todo"]

    def is_prepared(self, name: str) -> bool:
        """Whether a shape is prepared."""
        return name in self.shapes and self.shapes[name].state == "done"

    def reflected(self, names: Iterable[str]) -> list[str]:
        """Select the shapes that are matched as mirror images."""
        return [name for name in names if name in self.shapes and self.shapes[name].reflected]

    def is_current(self, pair: Pair) -> bool:
        """Whether a pair is matched, and its shapes have not changed since."""
        row = self.pairs.get(pair)
        if row is None or row.state != "done" or list(row.reflected) != self.reflected(pair):
            return False
        return row.hashes == tuple(self.shapes[name].hash if name in self.shapes else None for name in pair)

    def is_doubtful(self, pair: Pair) -> bool:
        """Whether a pair is current, and one of its maps may be wrong altogether."""
        return self.is_current(pair) and any(side.outcome.is_doubtful for side in self.pairs[pair].sides)

    def path(self, source: str, target: str) -> tuple[str, ...] | None:
        """Find the shortest path between two shapes by maps that are not doubtful, if any."""
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


def _counts_more(one: ShapeRow | PairRow | FileRow, other: ShapeRow | PairRow | FileRow) -> bool:
    of_file = [(row.size, row.changed) for row in (one, other) if isinstance(row, ShapeRow)]
    if of_file and of_file[0] != of_file[1]:
        return one.time > other.time
    return (one.state == "done", one.time) > (other.state == "done", other.time)


# kind of the value of a row: a type, or a function that tells which values are allowed
ValueKind = type | UnionType | Callable[[Any], bool]
RowKinds = Mapping[str, Mapping[str, ValueKind]]  # kinds of values, by name, that a row needs in each state
NUMBER = int | float  # kind of a value: a number


def _list_of(kind: ValueKind, count: int | None = None) -> Callable[[Any], bool]:
    def is_list(value: Any) -> bool:
        return isinstance(value, list) and count in (None, len(value)) and all(_is(x, kind) for x in value)

    return is_list


def _is_summary(value: Any) -> bool:
    """Whether a value has what is read of a `MapSummary`."""
    quality = value.get("quality") if isinstance(value, dict) else None
    return (
        isinstance(quality, dict)
        and value.get("outcome") in Outcome.__members__
        and {"spectral_residual", "orientation", "mirrored"} <= quality.keys()
        and all(isinstance(measure, NUMBER | None) for measure in quality.values())
    )


# checks of values that are lists: of texts, and the fields ``holes`` and ``features`` of a `ShapeRow`
_TEXTS, _HOLES, _FEATURES = _list_of(str), _list_of(NUMBER, 2), _list_of(NUMBER, N_EIGENVALUES + N_QUANTILES)
_SHAPE_VALUES: RowKinds = {  # kinds of the values that a row of a shape needs, by its state
    "done": {"key": str, "hash": str, "bytes": int, "area": NUMBER, "features": _FEATURES, "notes": _TEXTS},
    "failed": {"error": str},
}
# kinds of the values that a row of a matched pair needs
_MATCH_VALUES: dict[str, ValueKind] = dict.fromkeys(("source_hash", "target_hash"), str)
_MATCH_VALUES |= dict.fromkeys(SIDES, _is_summary)
_PAIR_VALUES: RowKinds = {  # kinds of the values that a row of a pair needs, by its state
    "done": {"key": str, "attempt": int, **_MATCH_VALUES},
    "failed": {"key": str, "attempt": int, "error": str},
    "todo": {"attempt": int},
}
TABLES: Mapping[str, tuple[type[Row], RowKinds]] = {
    "shapes": (ShapeRow, _SHAPE_VALUES),
    "pairs": (PairRow, _PAIR_VALUES),
    "files": (FileRow, {"done": {"file": str}}),
    "origins": (OriginRow, {"done": {"made_with": dict}}),
}
"""Class of the rows of each table of `Rows`, and the values that they must have."""
_OPTIONAL_VALUES: Mapping[str, ValueKind] = {  # kinds of the values that a row may have, but need not
    **dict.fromkeys(("file", "error", "source_hash", "target_hash", "led_by"), str),
    **dict.fromkeys(("seconds", "spread", "handedness"), NUMBER),
    **dict.fromkeys(("again", "replaced_by"), _TEXTS),
    "memory": NUMBER | None,
    "reflected": lambda value: isinstance(value, bool) or _TEXTS(value),
    "made_with": str | dict,
    "agreement": lambda value: isinstance(value, dict) and _is(value.get("inconsistency", 0.0), NUMBER),
    "not_reflected": lambda value: isinstance(value, dict) and _TEXTS(list(value.values())),
    "n_points": int,
    "ranks": _list_of(NUMBER, N_RANKS),
    "holes": lambda value: value is None or _HOLES(value),
}


def row_of(table: str, text: Any) -> Row | None:
    """Read a row of a table; None if it is damaged."""
    kind, kinds = TABLES[table]
    try:
        record: dict[str, Any] = json.loads(text)
        needed = {"time": NUMBER, **kinds[record["state"]]}
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    wanted = {name: kind for name, kind in _OPTIONAL_VALUES.items() if name in record} | needed
    is_whole = all(_is(record.get(name), kind) for name, kind in wanted.items())
    return kind.from_json(record) if is_whole else None


def _is(value: Any, kind: ValueKind) -> bool:
    return isinstance(value, kind) if isinstance(kind, type | UnionType) else kind(value)


class Ledger:
    """A ledger that is open for writing; `rows` are its contents."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection, self._path = connection, path
        self.rows = _rows(connection, path)

    def put(self, name: str | Pair, row: Row) -> None:
        """Write the row of a shape, a pair, a file by its path in the folder, or settings."""
        record, table = row.to_json(), next(table for table, (kind, _) in TABLES.items() if type(row) is kind)
        getattr(self.rows, table)[name] = type(row).from_json(record)  # the row as a later run would read it
        values = *([name] if isinstance(name, str) else name), json.dumps(record)
        self._execute(f"INSERT OR REPLACE INTO {table} VALUES ({', '.join('?' * len(values))})", *values)

    def forget(self, table: Literal["shapes", "files"], name: str) -> None:
        """Remove a row, if it is there."""
        if getattr(self.rows, table).pop(name, None):
            self._execute(f"DELETE FROM {table} WHERE name = ?", name)

    def _execute(self, command: str, *values: Any) -> None:
        try:
            self._connection.execute(command, values)
        except sqlite3.Error as error:
            remedy = "make room, and run again to continue"
            raise UnwritableFileError(f"{self._path}: cannot be written ({error}); {remedy}") from None


@contextmanager
def writing_ledger(path: Path, *, one_host: bool = True) -> Iterator[Ledger]:
    """Open or make a ledger for writing; on ``one_host``, readers need not wait."""
    with claimed(path), ExitStack() as opened:
        with _naming(path, "not a ledger"):
            connection = sqlite3.connect(path, timeout=LOCK_TIMEOUT, isolation_level=None)
            opened.enter_context(closing(connection))
            connection.execute(f"PRAGMA journal_mode = {'WAL' if one_host else 'DELETE'}")
            if one_host:
                # A power failure might lose the last rows; they are restored from the files of maps.
                connection.execute("PRAGMA synchronous = NORMAL")
            connection.executescript(_CREATE_TABLES)
            ledger = Ledger(connection, path)
        yield ledger
        with suppress(sqlite3.OperationalError):  # another process reads the ledger
            connection.execute("PRAGMA busy_timeout = 0")
            connection.execute("PRAGMA journal_mode = DELETE")  # leaves one file, to be copied and read


@contextmanager
def _naming(path: Path, problem: str) -> Iterator[None]:
    """Turn errors of SQLite into ours; a locked file, or a full disk, is not reported as damage."""
    try:
        yield
    except sqlite3.Error as error:
        is_usual = isinstance(error, sqlite3.OperationalError)
        if not is_usual or error.sqlite_errorcode == sqlite3.SQLITE_ERROR:
            raise FormatError(f"{path}: {problem} ({error}); move it away, and run again") from None
        remedy = "wait until nobody else uses it, or make room, and run again"
        raise UnwritableFileError(f"{path}: cannot be used ({error}); {remedy}") from None


def read_ledgers(paths: Iterable[Path]) -> Rows:
    """Read ledgers, also while they are written; `FormatError` if a file is no ledger."""
    rows = Rows()
    for path in paths:
        # Reading undoes half-written changes of a killed process, so the file must be writable (mode=rw).
        address = f"{path.resolve().as_uri()}?mode=rw"
        with (
            _naming(path, "cannot be read as a ledger"),
            closing(sqlite3.connect(address, timeout=LOCK_TIMEOUT, uri=True)) as connection,
        ):
            rows.merge(_rows(connection, path))
    return rows


def _rows(connection: sqlite3.Connection, path: Path) -> Rows:
    present = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
    rows = Rows()
    for table in filter(present.__contains__, TABLES):  # a new or an old ledger may lack tables
        # All rows are fetched at once, since no other process can write while rows are read.
        for *names, text in connection.execute(f"SELECT * FROM {table}").fetchall():
            row = row_of(table, text)
            if row is None:
                rows.damaged.append(f"the row of {' and '.join(map(str, names))} in {path.name}")
            else:
                getattr(rows, table)[names[0] if len(names) == 1 else tuple(names)] = row
    return rows
