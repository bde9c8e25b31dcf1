"""A run of a collection: jobs are planned, done by worker processes, and recorded in the ledger."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Container, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any, Literal, NamedTuple, TypeVar, cast

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import FormatError, MissingFileError
from isomatch._core.files import writing
from isomatch._core.memory import peak_memory
from isomatch._core.settings import generator
from isomatch.cohort.ledger import (
    Ledger,
    MapRecord,
    MapSummary,
    OriginRow,
    Pair,
    PairRow,
    Rows,
    ShapeRow,
    State,
    read_ledgers,
    writing_ledger,
)
from isomatch.cohort.map_file import PairMaps, as_matched, changed_files, digest_of, maps_of_pair
from isomatch.cohort.plan import (
    TILE_SIDE,
    Entry,
    Layout,
    Plan,
    features_of,
    identity_of,
    identity_of_map,
    key_of,
    made_with,
    pairs_of,
    tiles_of,
    why_again,
)
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.unusual_shapes import KINDS_BEFORE_MATCHING, Outlier, holes_of, likeness_of, outliers
from isomatch.cohort.workers import Attempt, Task, Workers, try_job, workers_of
from isomatch.correspondence import carry_along
from isomatch.io import mesh_from, surface_from
from isomatch.matching import match_both
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, prepare
from isomatch.surfaces import Graph, Mesh, reflected

# Largest number of pairs of shapes in a task of a worker, whose results are recorded once all its pairs are matched;
# chosen.
MAX_TILE_PAIRS = 64
# number of tasks over number of workers; chosen: with fewer, some would be idle at the end
TILES_PER_WORKER = 4
# largest size, in bytes of their files, of the prepared shapes that a worker keeps in memory for later pairs; chosen
MAX_LOADED_BYTES = 256 * 2**20
# largest number of vertices of a leader's surface that carry other surfaces along; chosen
MAX_CARRIERS = 1500
REFLECTED_NOTE = "reflected before it was prepared, x → −x; vertices and faces keep their numbers"
logger = logging.getLogger(__name__)
T = TypeVar("T")
R = TypeVar("R", ShapeRow, PairRow)


class Event(NamedTuple):
    """A step of a run: its kind, the shape or pair, its row, and the number of steps done of all.

    A reflection has the row of the pair by which the shape was judged, an outlier an `Outlier`.
    """

    what: Literal["shape", "outlier", "pair", "reflection", "agreement"]
    name: str | Pair
    row: ShapeRow | PairRow | Outlier
    done: int
    of: int

    @property
    def state(self) -> State:
        """State of the row."""
        return "done" if isinstance(self.row, Outlier) else self.row.state

    @property
    def again(self) -> tuple[str, ...]:
        """Why a shape or a pair was done again, if it was."""
        is_repeatable = self.what in ("shape", "pair") and not isinstance(self.row, Outlier)
        return cast("ShapeRow | PairRow", self.row).again if is_repeatable else ()

    @property
    def progress(self) -> tuple[str, float]:
        """The step in words, and the share of all steps that are done."""
        name = self.name if isinstance(self.name, str) else " and ".join(self.name)
        again = f"; again, because {'; '.join(self.again)}" if self.again else ""
        step = f"{_PAST_VERBS[self.what]} {self.done} of {self.of}"
        return f"{step}: {name}, {_outcome_in_words(self.row)}{again}", self.done / self.of


_PAST_VERBS = dict(  # what was done in a step, by `Event.what`
    shape="prepared", outlier="looked at", pair="matched", reflection="reflected", agreement="compared"
)


def _outcome_in_words(row: ShapeRow | PairRow | Outlier) -> str:
    if isinstance(row, Outlier):
        return row.reason
    if row.state == "failed":
        return f"failed: {row.error}"
    if isinstance(row, ShapeRow):
        return "done"
    if row.not_reflected:
        return f"not kept: {', '.join(row.not_reflected.values())}"
    if row.agreement and row.agreement.refused:
        return f"contradicted, but not replaced: {row.agreement.refused}"
    if row.replaced_by:
        return f"replaced by the composition over {row.replaced_by[1]}"
    return row.ending.lower().replace("_", " ") if row.forward.values else "done"


@dataclass(frozen=True)
class Run:
    """A run of one shard of a collection, given by its index from 0 and the number of shards."""

    collection: Plan
    shard: tuple[int, int]

    def events(
        self, executor: str | Executor | Workers, jobs: int | None, time_limit: float | None
    ) -> Iterator[Event]:
        """Prepare and match all that is not done, and yield each step; see `Collection.run`."""
        layout = self.collection.layout
        for folder in ("prepared", "maps"):
            with writing(layout.folder / folder):
                (layout.folder / folder).mkdir(parents=True, exist_ok=True)
        with (
            workers_of(executor, jobs, time_limit) as workers,
            writing_ledger(layout.ledger(self.shard), one_host=self.shard[1] == 1) as ledger,
        ):
            settings = self.collection.config, self.collection.seed
            job = Job(layout, *settings, self.collection.leader)
            layout.remove_unfinished(self.shard)
            ledger_path = layout.ledger(self.shard)
            ledger.rows.merge(read_ledgers(path for path in layout.ledgers() if path != ledger_path))
            name, origin = made_with(*settings)
            if name not in ledger.rows.origins:
                ledger.put(name, OriginRow(time=time.time(), made_with=origin))
            yield from self._prepare_shapes(job, workers, ledger)
            odd = outliers(self.collection, Rows(ledger.rows.shapes))
            odd = [outlier for outlier in odd if outlier.kind in KINDS_BEFORE_MATCHING]
            for count, outlier in enumerate(odd, 1):
                yield Event("outlier", outlier.name, outlier, count, len(odd))
            tried: set[str] = set()
            while not workers.is_late():
                yield from self._match_pairs(job, workers, ledger)
                reflections = [] if workers.is_late() else self._plan_reflections(ledger.rows, tried)
                if not reflections:
                    break
                tried |= {entry.name for entry, _ in reflections}
                yield from self._reflect_shapes(job, workers, ledger, reflections)

    def _prepare_shapes(self, job: Job, workers: Workers, ledger: Ledger) -> Iterator[Event]:
        """Prepare the shapes that are not prepared yet."""
        removed = self._remove_changed("prepared", ledger.rows)
        todo = [entry for entry in self._entries(ledger.rows) if not self._is_prepared(entry, ledger.rows)]
        tasks = [Task((entry,), job.prepare_shape) for entry in todo]
        for count, (entry, attempt) in enumerate(workers.completed(tasks), 1):
            old = ledger.rows.shapes.get(entry.name)
            why = removed.get(self.collection.layout.prepared(old.key)) if old else None
            new = attempt.result or _failed_shape(attempt)
            row = self._with_reasons(new, old, (entry.name,), why, ledger.rows)
            ledger.put(entry.name, row)
            yield Event("shape", entry.name, row, count, len(todo))

    def _match_pairs(self, job: Job, workers: Workers, ledger: Ledger) -> Iterator[Event]:
        """Match the pairs of prepared shapes that are not matched yet, in tiles."""
        rows = ledger.rows
        pairs = [pair for pair in self.pairs_of_shard(rows) if all(map(rows.is_prepared, pair))]
        plans = [self._plan(pair, rows) for pair in pairs]
        known = {pair: rows.pairs[pair] for pair in pairs if pair in rows.pairs}
        removed = self._remove_changed("maps", replace(rows, pairs=known))
        files = {path.name for path in (self.collection.layout.folder / "maps").iterdir()}
        todo = {plan.pair: plan for plan in plans if not self._is_matched(plan, rows, files)}
        largest = max((rows.shapes[name].bytes for pair in todo for name in pair), default=1)
        most = min(max(1, len(todo) // (TILES_PER_WORKER * workers.count())), MAX_TILE_PAIRS)
        tiles = tiles_of([*todo], self.collection.names, max(1, MAX_LOADED_BYTES // (2 * largest)), most)
        tasks = [Task(tuple(todo[pair] for pair in tile), job.match_pair) for tile in tiles]
        for count, (plan, attempt) in enumerate(workers.completed(tasks), 1):
            why = removed.get(self.collection.layout.maps(plan.pair))
            row = self._with_reasons(plan.row(attempt), rows.pairs.get(plan.pair), plan.pair, why, rows)
            ledger.put(plan.pair, row)
            yield Event("pair", plan.pair, row, count, len(todo))

    def _reflect_shapes(
        self, job: Job, workers: Workers, ledger: Ledger, reflections: Sequence[Reflection]
    ) -> Iterator[Event]:
        """Reflect shapes, or undo it, where the match of a pair confirms it."""
        tasks = [Task((reflection,), job.reflect_shape) for reflection in reflections]
        for count, ((entry, plan), attempt) in enumerate(workers.completed(tasks), 1):
            rows = ledger.rows
            old = rows.pairs[plan.pair]
            if isinstance(attempt.result, tuple):
                shape, pair = attempt.result
                # The row of the shape is written first, as it decides which pairs are matched again.
                shape = self._with_reasons(shape, rows.shapes[entry.name], (entry.name,), None, rows)
                ledger.put(entry.name, shape)
                row = self._with_reasons(pair, old, plan.pair, None, rows)
            else:
                why_not = {entry.name: attempt.result or attempt.error}
                row = replace(old, not_reflected=why_not, time=time.time())
            ledger.put(plan.pair, row)
            yield Event("reflection", entry.name, row, count, len(reflections))

    def _plan_reflections(self, rows: Rows, tried: Container[str]) -> list[Reflection]:
        """Plan which shapes to reflect; a shard knows enough pairs for it only in a star."""
        if self.collection.reflect != "auto" or (self.collection.pairs != "star" and self.shard[1] > 1):
            return []
        shard_pairs, reflections = set(self.pairs_of_shard(rows)), list[Reflection]()
        for name, pair in Snapshot(self.collection, rows).mirror_images.items():
            if pair in shard_pairs and name not in tried and name not in rows.pairs[pair].not_reflected:
                is_reflected, row = not rows.reflected([name]), rows.shapes[name]
                key = self._key(identity_of(row.hash, is_reflected))
                shapes = {other: rows.shapes[other] for other in pair}
                shapes[name] = replace(row, reflected=is_reflected, key=key)
                entry = Entry(name, self.collection.paths[name], is_reflected)
                reflections.append((entry, self._plan(pair, Rows(shapes, {pair: rows.pairs[pair]}))))
        return reflections

    def pairs_of_shard(self, rows: Rows) -> list[Pair]:
        """List the pairs of the shard: as many as any other has, of few different shapes."""
        names, template = self.collection.names, self.collection.chosen_template(rows)
        pairs = pairs_of(names, self.collection.pairs, template)
        index, count = self.shard
        if count == 1:
            return pairs
        in_order = [pair for tile in tiles_of(pairs, names, TILE_SIDE, len(pairs)) for pair in tile]
        return in_order[len(pairs) * index // count : len(pairs) * (index + 1) // count]

    def _entries(self, rows: Rows) -> list[Entry]:
        """List the shapes that the shard needs: of its pairs, or all to choose the template."""
        names, (index, count) = self.collection.names, self.shard
        if self.collection.pairs == "star" and self.collection.template is None:
            first = len(names) * index // count  # shards begin at different shapes, to share the work
            names = [*names[first:], *names[:first]]
        elif count > 1:
            needed = {name for pair in self.pairs_of_shard(rows) for name in pair}
            names = [name for name in names if name in needed]
        return [self.collection.entry(name, rows) for name in names]

    def _is_prepared(self, entry: Entry, rows: Rows) -> bool:
        row = rows.shapes.get(entry.name)
        if row is None or not entry.path.exists():
            return False
        stat = entry.path.stat()
        is_same = (row.size, row.changed) == (stat.st_size, stat.st_mtime_ns)
        if not is_same or row.state == "failed":
            return is_same
        if not row.file:  # an earlier version wrote the row: the job reads the file, and keeps it if whole
            return False
        key = self._key(identity_of(row.hash, entry.reflected))
        return row.key == key and self.collection.layout.prepared(key).exists()

    def _plan(self, pair: Pair, rows: Rows) -> PlannedPair:
        source, target = (rows.shapes[name] for name in pair)
        row, sides = rows.pair(pair), tuple(rows.reflected(pair))
        led_by = self._identify_leading_map(pair, sides)
        keys, hashes = (source.key, target.key), (source.hash, target.hash)
        surfaces = [identity_of(content, name in sides) for name, content in zip(pair, hashes)]
        key = self._key(*surfaces, *filter(None, [led_by]), attempt=row.attempt)
        return PlannedPair(pair, key, keys, hashes, sides, row.attempt, bool(row.contradicted), led_by)

    def _identify_leading_map(self, pair: Pair, sides: tuple[str, ...]) -> str:
        """Identify the map of the leader that a pair starts from; empty without a reliable one."""
        for ends in (pair, pair[::-1]):
            if self._leader_rows.is_current(ends) and not self._leader_rows.is_doubtful(ends):
                row = self._leader_rows.pairs[ends]
                return identity_of_map(row) if set(row.reflected) == set(sides) else ""
        return ""

    @cached_property
    def _leader_rows(self) -> Rows:
        return self.collection.leader.rows() if self.collection.leader else Rows()

    def _remove_changed(self, folder: str, rows: Rows) -> dict[Path, str]:
        """Remove files that changed since they were written, and tell what is wrong with them."""
        changed = changed_files(self.collection.layout, rows, [folder])
        for path in changed:
            with writing(path):
                path.unlink(missing_ok=True)
        return changed

    def _with_reasons(self, row: R, old: R | None, names: Sequence[str], wrong: str | None, rows: Rows) -> R:
        """Add to a row its settings and, if it replaces an old one, why it was made again."""
        row = replace(row, made_with=made_with(self.collection.config, self.collection.seed)[0])
        of_file = [f"its file {wrong}"] if wrong else []
        if old and (reasons := of_file + why_again(old, row, names, rows.origins)):
            row = replace(row, again=tuple(reasons))
            logger.info("%s: again, because %s", " and ".join(names), "; ".join(reasons))
        return row

    def _key(self, *surfaces: str, attempt: int = 0) -> str:
        return key_of(self.collection.config, self.collection.seed + attempt, *surfaces)

    def _is_matched(self, plan: PlannedPair, rows: Rows, files: Container[str]) -> bool:
        row = rows.pair(plan.pair)
        if row.state == "todo" or row.key != plan.key:
            return False
        has_file = bool(row.file) and self.collection.layout.maps(plan.pair).name in files
        return row.state == "failed" or has_file


def _failed_shape(attempt: Attempt[Any]) -> ShapeRow:
    return ShapeRow(state="failed", time=attempt.time, error=attempt.error, seconds=attempt.seconds)


class PlannedPair(NamedTuple):
    """A pair to match."""

    pair: Pair
    key: str  # identifies the match by its inputs, see `key_of`
    shapes: tuple[str, str]  # keys that identify the prepared shapes
    hashes: tuple[str, str]  # content_hash of the surfaces in the files
    reflected: tuple[str, ...]  # names of the shapes that are matched as mirror images
    attempt: int  # number of earlier attempts, added to the seed
    contradicted: bool = False  # whether other maps contradict the earlier map, so that a new one replaces it
    led_by: str = ""  # key of the map of the leading structure from which the match starts

    @property
    def known(self) -> dict[str, Any]:
        """The values of rows and files that are known before the pair is matched."""
        hashes = dict(zip(("source_hash", "target_hash"), self.hashes))
        return {**hashes, "reflected": self.reflected, "led_by": self.led_by}

    def row(self, found: Attempt[tuple[MapRecord, str]]) -> PairRow:
        """Return the row of the pair, with the record and the digest of the file of its maps."""
        ended: dict[str, Any] = {"attempt": self.attempt, "state": found.state, "time": found.time}
        if found.result is None:  # the match failed: the earlier map stays, and is judged as before
            ended |= {"error": found.error, "seconds": found.seconds, "contradicted": self.contradicted}
            return PairRow(**self.known, **ended, key=self.key)
        record, file = found.result
        values = {**self.known, "seconds": found.seconds, **record.given(), **ended, "key": self.key}
        return PairRow(**values, file=file, more=record.more)


Reflection = tuple[Entry, PlannedPair]
"""A shape, reflected as its entry says, and a pair of it that is matched to see if that fits."""


@dataclass(frozen=True)
class Job:
    """The jobs of a run for worker processes, which read and write files and return rows."""

    layout: Layout
    config: Config
    seed: int
    leader: Plan | None = None

    def prepare_shape(self, entry: Entry) -> ShapeRow:
        """Read and prepare a shape that is not prepared yet, and return its row."""
        file = entry.path.stat() if entry.path.exists() else None
        size, changed = (file.st_size, file.st_mtime_ns) if file else (None, None)
        attempt = try_job(self._prepare, entry)
        row = attempt.result or _failed_shape(attempt)
        return replace(row, size=size, changed=changed, time=attempt.time, seconds=attempt.seconds)

    def _prepare(self, entry: Entry) -> ShapeRow:
        surface = surface_from(entry.path)
        key = key_of(self.config, self.seed, identity_of(surface.content_hash, entry.reflected))
        file = self.layout.prepared(key)
        shape = _load_if_whole(lambda: PreparedShape.load(file, self.config))
        if shape is None:
            shape = prepare(reflected(surface) if entry.reflected else surface, self.config, self.seed)
            if entry.reflected:
                shape = replace(shape, notes=(REFLECTED_NOTE, *shape.notes))
            shape.save(file)
            load_shape(file, self.config, prepared=shape)  # the pairs of this worker need not read it
        return ShapeRow(
            state="done",
            key=key,
            hash=surface.content_hash,
            reflected=entry.reflected,
            bytes=file.stat().st_size,
            file=digest_of(file),
            n_vertices=surface.n_vertices,
            area=float(surface.vertex_areas.sum()),
            features=features_of(shape),
            **({} if isinstance(surface, Graph) else likeness_of(surface)),
            holes=holes_of(surface) if isinstance(surface, Mesh) else None,
            notes=shape.notes,
        )

    def match_pair(self, plan: PlannedPair) -> tuple[MapRecord, str]:
        """Match a pair that is not matched yet; return record and digest of its file of maps."""
        file = self.layout.maps(plan.pair)
        earlier = _load_if_whole(lambda: PairMaps.load(file))
        if earlier and earlier.record.key == plan.key:
            return earlier.record, digest_of(file)
        maps = self._new_maps(plan)
        if earlier and plan.attempt and not plan.contradicted:
            old, new = earlier.record, maps.record
            is_same = (old.hashes, old.reflected) == (new.hashes, new.reflected)
            if is_same and _unsureness(old) <= _unsureness(new):
                maps = replace(earlier, record=replace(old, key=plan.key))
        maps.save(file)
        return maps.record, digest_of(file)

    def reflect_shape(self, reflection: Reflection) -> tuple[ShapeRow, PairRow] | str:
        """Reflect a shape if a match confirms it; return its row and the pair's row, or why not."""
        entry, plan = reflection
        shape = self.prepare_shape(entry)
        if shape.state == "failed":
            return shape.error
        file = self.layout.maps(plan.pair)
        maps = _load_if_whole(lambda: PairMaps.load(file))
        if maps is None or maps.record.key != plan.key:  # if it is equal, a killed run saved the maps
            maps = self._new_maps(plan)
            worst = min((side.outcome for side in maps.record.sides), key=lambda outcome: outcome.sureness)
            if worst.is_doubtful:
                return f"the other way round, the match ends with {worst.value}"
            maps.save(file)
        return shape, plan.row(Attempt((maps.record, digest_of(file)), "", time.time()))

    def _new_maps(self, plan: PlannedPair) -> PairMaps:
        start = time.perf_counter()
        source, target = (load_shape(self.layout.prepared(key), self.config) for key in plan.shapes)
        first_map, config = None, self.config
        if self.leader and plan.led_by:
            first_map = _carry_map(self.leader, plan, source, target)
            config = replace(config, hypotheses="given", start="auto", part="none")
        seed = self.seed + plan.attempt
        matches = match_both(source, target, initial_map=first_map, config=config, seed=seed)
        forward, backward = map(MapSummary.of, matches)
        effort: dict[str, Any] = {"seconds": time.perf_counter() - start, "memory": peak_memory()}
        record = MapRecord(key=plan.key, **plan.known, forward=forward, backward=backward, **effort)
        return PairMaps.of(*matches, record)


def _carry_map(leader: Plan, plan: PlannedPair, source: PreparedShape, target: PreparedShape) -> IntArray:
    """Carry a surface along with the leader's map, and find the nearest target vertices (n,)."""
    maps, (a, b) = maps_of_pair(leader.layout, *plan.pair), plan.pair
    sides = a in plan.reflected, b in plan.reflected
    surfaces = mesh_from(leader.paths[a]), mesh_from(leader.paths[b])
    leader_map, leader_source, leader_target = as_matched(maps.forward, *surfaces, sides)
    images = leader_map.pull_back(leader_target.vertices)
    rows = np.flatnonzero(np.isfinite(images).all(axis=1))
    rows = generator(0).permutation(rows)[:MAX_CARRIERS]
    mirrored = (maps.record.forward.measures["orientation"] or 0.0) < 0
    scale = float(np.sqrt(leader_target.area / leader_source.area))
    points, goals = cast(Mesh, source.surface).vertices, cast(Mesh, target.surface).vertices
    moved = carry_along(points, leader_source.vertices[rows], images[rows], scale=scale, mirrored=mirrored)
    # In two subjects, sheets such as cartilages might cover different parts of their leaders, so we align the centroids
    # of the two sheets.
    return np.asarray(cKDTree(goals - goals.mean(axis=0)).query(moved - moved.mean(axis=0))[1])


def _unsureness(record: MapRecord) -> tuple[int, float]:
    return -record.forward.outcome.sureness, record.forward.measures["spectral_residual"] or 0.0


def _load_if_whole(load: Callable[[], T]) -> T | None:
    try:
        return load()
    except FormatError:  # the file is missing, or was cut short when the disk was full
        return None


_loaded_shapes = OrderedDict[tuple[Path, int, Config], tuple[PreparedShape, int]]()
"""Prepared shapes with their bytes, by file, time of its change (ns) and settings; the last used is last."""
_loaded_shapes_lock = Lock()  # guards `_loaded_shapes`: a worker may have several threads


def load_shape(
    file: Path, config: Config, room: int = MAX_LOADED_BYTES, prepared: PreparedShape | None = None
) -> PreparedShape:
    """Take a shape from memory, or as it is given, or from its file; memory drops those not used for longest."""
    with _loaded_shapes_lock:
        if not file.exists():
            remedy = "run isomatch collect again, which makes it"
            raise MissingFileError(f"{file}: no such prepared shape; {remedy}")
        stat = file.stat()
        key = file, stat.st_mtime_ns, config
        held = _loaded_shapes.pop(key, None)
        shape = held[0] if held else prepared or PreparedShape.load(file, config)
        _loaded_shapes[key] = shape, stat.st_size
        while sum(size for _, size in _loaded_shapes.values()) > room and len(_loaded_shapes) > 2:
            _loaded_shapes.popitem(last=False)
    return shape
