"""A run of a collection: open jobs are planned, sent to workers, and their rows written to the ledger."""

from __future__ import annotations

import math
import time
from collections.abc import Container, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Literal, NamedTuple

from isomatch.collections.jobs import LOADED, Job, PlannedPair
from isomatch.collections.layout import key_of
from isomatch.collections.ledger import Ledger, Rows, read_ledgers, writing_ledger
from isomatch.collections.map_file import Record
from isomatch.collections.pairs import SIDE, Pair, pairs_of, tiles_of
from isomatch.collections.plan import Plan
from isomatch.collections.shapes import Entry
from isomatch.collections.workers import Task, Workers, workers_of
from isomatch.storage.files import writing

MOST_PAIRS = 64  # of a tile, whose rows come when all of it is done
TILES_PER_WORKER = 4  # so that the last ones end at about the same time


class Event(NamedTuple):
    """A step of a run: its kind, the shape or pair, its row, and how many of how many steps are done."""

    what: Literal["shape", "pair", "agreement"]
    name: str | Pair
    record: Record
    done: int
    of: int


@dataclass(frozen=True)
class Run:
    """A run of one shard of a collection: its index from 0, and the number of shards."""

    collection: Plan
    shard: tuple[int, int]

    def events(self, executor: str | Executor, jobs: int | None, time_limit: float | None) -> Iterator[Event]:
        """Prepare and match all that is still open, and yield each step; see `Collection.run`."""
        end = math.inf if time_limit is None else time.time() + time_limit
        layout = self.collection.layout
        job = Job(layout, self.collection.config, self.collection.seed, end)
        for folder in ("prepared", "maps"):
            with writing(layout.folder / folder):
                (layout.folder / folder).mkdir(parents=True, exist_ok=True)
        with (
            workers_of(executor, jobs) as workers,
            writing_ledger(layout.ledger(self.shard), one_host=self.shard[1] == 1) as ledger,
        ):
            layout.remove_unfinished(self.shard)
            own = layout.ledger(self.shard)
            ledger.rows.merge(read_ledgers(path for path in layout.ledgers() if path != own))
            yield from self._prepared_shapes(job, workers, ledger)
            if not job.is_late():
                yield from self._matched_pairs(job, workers, ledger)

    def _prepared_shapes(self, job: Job, workers: Workers, ledger: Ledger) -> Iterator[Event]:
        """Prepare the shapes that are not prepared yet."""
        todo = [entry for entry in self._entries(ledger.rows) if not self._is_prepared(entry, ledger.rows)]
        tasks = [Task((entry,), job.prepare_shapes) for entry in todo]
        for count, (entry, record) in enumerate(workers.completed(tasks, job.is_late), 1):
            row = _row_of(record)
            ledger.put_shape(entry.name, row)
            yield Event("shape", entry.name, row, count, len(todo))

    def _matched_pairs(self, job: Job, workers: Workers, ledger: Ledger) -> Iterator[Event]:
        """Match the pairs that are not matched yet, in tiles, as far as their shapes could be prepared."""
        rows = ledger.rows
        usable = {name for name, record in rows.shapes.items() if record["state"] == "done"}
        pairs = [pair for pair in self.pairs_of_shard(rows) if usable.issuperset(pair)]
        plans = [self._planned(pair, rows) for pair in pairs]
        files = {path.name for path in (self.collection.layout.folder / "maps").iterdir()}
        missing = {
            plan.pair: plan for plan in plans if not self._is_matched(plan, rows.pairs.get(plan.pair), files)
        }
        largest = max((rows.shapes[name]["bytes"] for pair in missing for name in pair), default=1)
        most = min(max(1, len(missing) // (TILES_PER_WORKER * workers.count())), MOST_PAIRS)
        tiles = tiles_of(list(missing), self.collection.names, max(1, LOADED // (2 * largest)), most)
        tasks = [Task(tuple(missing[pair] for pair in tile), job.match_pairs) for tile in tiles]
        for count, (plan, record) in enumerate(workers.completed(tasks, job.is_late), 1):
            row = {**_row_of(record), "key": plan.key, "attempt": plan.attempt}
            if row["state"] == "failed":  # the map that was there before is judged as before
                row["contradicted"] = plan.contradicted
            ledger.put_pair(plan.pair, row)
            yield Event("pair", plan.pair, row, count, len(missing))

    def pairs_of_shard(self, rows: Rows) -> list[Pair]:
        """List the pairs of the shard: as many as of any other, and of few different shapes."""
        names, template = self.collection.names, self.collection.chosen_template(rows)
        pairs = pairs_of(names, self.collection.pairs, template)
        index, count = self.shard
        if count == 1:
            return pairs
        in_order = [pair for tile in tiles_of(pairs, names, SIDE, len(pairs)) for pair in tile]
        return in_order[len(pairs) * index // count : len(pairs) * (index + 1) // count]

    def _entries(self, rows: Rows) -> list[Entry]:
        """List the shapes of the shard's pairs; all if they decide on the template, each shard beginning elsewhere."""
        shapes, (index, count) = self.collection.shapes, self.shard
        if self.collection.pairs == "star" and self.collection.template is None:
            first = len(shapes) * index // count
            return [*shapes[first:], *shapes[:first]]
        if count == 1:
            return list(shapes)
        needed = {name for pair in self.pairs_of_shard(rows) for name in pair}
        return [entry for entry in shapes if entry.name in needed]

    def _is_prepared(self, entry: Entry, rows: Rows) -> bool:
        record = rows.shapes.get(entry.name)
        if record is None or not entry.path.exists():
            return False
        stat = entry.path.stat()
        if (record.get("size"), record.get("changed")) != (stat.st_size, stat.st_mtime_ns):
            return False
        if record["state"] == "failed":
            return True
        key = key_of(self.collection.config, self.collection.seed, record["hash"])
        return bool(record["key"] == key) and self.collection.layout.prepared(key).exists()

    def _planned(self, pair: Pair, rows: Rows) -> PlannedPair:
        shapes = [rows.shapes[name] for name in pair]
        hashes = (shapes[0]["hash"], shapes[1]["hash"])
        row = rows.pairs.get(pair, {})
        attempt = row.get("attempt", 0)
        key = key_of(self.collection.config, self.collection.seed + attempt, *hashes)
        keys = (shapes[0]["key"], shapes[1]["key"])
        return PlannedPair(pair, key, keys, hashes, attempt, row.get("contradicted", False))

    def _is_matched(self, plan: PlannedPair, row: Record | None, files: Container[str]) -> bool:
        if row is None or row["state"] == "todo" or row["key"] != plan.key:
            return False
        return row["state"] == "failed" or self.collection.layout.maps(plan.pair).name in files


def _row_of(record: Record | Exception) -> Record:
    """Return the row of a job, or one with the error if its worker died."""
    if not isinstance(record, Exception):
        return record
    reason = f"three workers died of it, killed or out of memory ({type(record).__name__}: {record})"
    return {"state": "failed", "time": time.time(), "error": reason}
