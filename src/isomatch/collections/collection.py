"""`Collection`: many shapes in correspondence, in a folder that survives every interruption."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Container, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from isomatch._cached import cached_property
from isomatch._files import write_text, writing
from isomatch.collections.consistency import CONTRADICTED
from isomatch.collections.jobs import LOADED, Job, PlannedPair
from isomatch.collections.layout import Layout, key_of
from isomatch.collections.ledger import Rows, read_ledgers, writing_ledger
from isomatch.collections.map_file import PairMaps, Record
from isomatch.collections.pairs import PATTERNS, SIDE, Pair, pairs_of, tiles_of
from isomatch.collections.shapes import Entry, entries_of
from isomatch.collections.template import medoid
from isomatch.collections.workers import Task, workers_of
from isomatch.errors import FormatError, InputError, SettingError
from isomatch.matching import Config

TILES_PER_WORKER = 4  # so that the last ones end at about the same time


class Event(NamedTuple):
    """A step of a run: what was done for which shape or pair, its row, and how many of how many are."""

    what: Literal["shape", "pair", "agreement"]
    name: str | Pair
    record: Record
    done: int
    of: int


@dataclass(frozen=True)
class Collection:
    """Shapes in a folder with their maps.

    Parameters
    ----------
    folder : path_like
        The folder, see `create` and `open`.
    shapes : tuple of Entry
        Names and files of the shapes.
    pairs : str
        Which pairs are matched, see `create`.
    template : str, optional
        Name of the template; None for that in the middle of all, which is found once all are prepared.
    config : Config
        Settings of the matches.
    seed : int
        Their seed.
    """

    folder: Path
    shapes: tuple[Entry, ...]
    pairs: str
    template: str | None
    config: Config
    seed: int

    @classmethod
    def create(
        cls,
        folder: str | Path,
        shapes: str | Path | Iterable[str | Path],
        *,
        pairs: str = "star",
        template: str | None = None,
        config: Config | None = None,
        seed: int = 0,
    ) -> Collection:
        """Make a collection, or continue one with the same settings; shapes may be added.

        Parameters
        ----------
        folder : path_like
            Where prepared shapes, maps and tables are kept.
        shapes : path_like or iterable of path_like
            A folder, all files of which that can be read are taken; a pattern such as ``'scans/*.vtp'``; a CSV file
            with a column ``path``, relative to its folder, and perhaps ``name``; or the files.
        pairs : str
            "star": the template with each other shape; "all"; "chain", each with the next; or a CSV file with
            columns ``source`` and ``target``. Each pair is matched in both directions.
        template : str, optional
            Name of a shape, or its file; by default the one in the middle of all, by spectra and distances.
        config : Config, optional
            Settings of the matches.
        seed : int
            Their seed.

        Raises
        ------
        InputError
            If the shapes, pairs or template are not usable.
        SettingError
            If the folder holds a collection with other settings.
        """
        entries, layout = entries_of(shapes), Layout(Path(folder))
        names = [entry.name for entry in entries]
        if template is not None and template not in names:
            by_file = {entry.path.resolve(): entry.name for entry in entries}
            found = by_file.get(Path(template).resolve())
            if found is None:
                raise InputError(
                    f"template {template!r} is no shape of this collection; give its name or file"
                )
            template = found
        if pairs not in PATTERNS:
            pairs = str(Path(pairs).resolve())
            pairs_of(names, pairs, template)
        new = cls(layout.folder, entries, pairs, template, config or Config(), seed)
        if layout.plan.exists():
            new._require_same(cls.open(folder))
        layout.folder.mkdir(parents=True, exist_ok=True)
        plan = {
            "shapes": {entry.name: str(entry.path.resolve()) for entry in entries},
            "pairs": pairs,
            "template": template,
            "config": new.config.to_dict(),
            "seed": seed,
        }
        write_text(layout.plan, json.dumps(plan, indent=2) + "\n")
        return new

    @classmethod
    def open(cls, folder: str | Path) -> Collection:
        """Open the collection in a folder.

        Raises
        ------
        FormatError
            If the folder holds none, or its plan is damaged.
        """
        path = Layout(Path(folder)).plan
        try:
            plan = json.loads(path.read_text(encoding="utf-8"))
            shapes = tuple(Entry(name, Path(file)) for name, file in plan["shapes"].items())
            config = Config.from_dict(plan["config"])
            return cls(Path(folder), shapes, plan["pairs"], plan["template"], config, plan["seed"])
        except FileNotFoundError:
            raise FormatError(f"{folder}: holds no collection; make one with isomatch collect") from None
        except (ValueError, KeyError, TypeError, AttributeError, SettingError) as error:
            raise FormatError(f"{path}: not the plan of a collection ({error}); make it again") from None

    @property
    def layout(self) -> Layout:
        """Where each file is."""
        return Layout(Path(self.folder))

    @property
    def names(self) -> list[str]:
        """Names of the shapes."""
        return [entry.name for entry in self.shapes]

    @cached_property
    def paths(self) -> dict[str, Path]:
        """File of each shape, by name."""
        return {entry.name: entry.path for entry in self.shapes}

    def rows(self) -> Rows:
        """Return what is known so far, from the ledgers of all shards, also while they are written."""
        return read_ledgers(self.layout.ledgers())

    def maps(self, source: str, target: str) -> PairMaps:
        """Read the maps of a pair; ``there`` leads from source to target, in whichever order they were matched.

        Raises
        ------
        FormatError
            If the pair is not matched.
        """
        path = self.layout.maps((source, target))
        if not path.exists():
            turned = PairMaps.load(self.layout.maps((target, source)))
            return PairMaps(turned.back, turned.there, turned.record)
        return PairMaps.load(path)

    def chosen_template(self, rows: Rows) -> str | None:
        """Return the template asked for, or the medoid; None as long as not all shapes are prepared.

        The medoid stays the template of a star that has been begun, also where shapes are added.
        """
        if self.template is not None:
            return self.template
        known = [name for name in self.names if name in rows.shapes]
        usable = [name for name in known if rows.shapes[name]["state"] == "done"]
        centres = Counter(source for source, _ in rows.pairs if source in usable)
        if self.pairs == "star" and centres:
            return centres.most_common(1)[0][0]
        if not usable or len(known) < len(self.names):
            return None
        return usable[medoid(np.array([rows.shapes[name]["features"] for name in usable]))]

    def wanted_pairs(self, rows: Rows) -> list[Pair]:
        """List the pairs to match, as far as their shapes could be prepared."""
        usable = {name for name, record in rows.shapes.items() if record["state"] == "done"}
        pairs = pairs_of(self.names, self.pairs, self.chosen_template(rows))
        return [pair for pair in pairs if usable.issuperset(pair)]

    def run(
        self,
        executor: str | Executor = "local",
        jobs: int | None = None,
        shard: tuple[int, int] = (0, 1),
        time_limit: float | None = None,
    ) -> Iterator[Event]:
        """Prepare the shapes and match the pairs that are not done, and yield each as soon as it is.

        What was done before is not done again, also where the last run was killed. A failure is a row with its reason.

        Parameters
        ----------
        executor : str or Executor
            "local": processes of this machine; "dask:ADDRESS": those of a Dask cluster, which see the same files; or any
            executor of ``concurrent.futures``.
        jobs : int, optional
            How many run at once; by default one for each processor.
        shard : (int, int)
            Which part of the pairs: index from 0, and their number. Several runs, on one machine or on many that see
            the same folder, each do one. Each prepares the shapes it needs.
        time_limit : float, optional
            Seconds after which nothing new is begun.

        Raises
        ------
        InputError
            If the executor is not known, or the cluster does not answer.
        UnwritableFileError
            If another run does the same shard, or the folder cannot be written.
        """
        end = math.inf if time_limit is None else time.time() + time_limit
        layout, job = self.layout, Job(self.layout, self.config, self.seed, end)
        for folder in ("prepared", "maps"):
            with writing(layout.folder / folder):
                (layout.folder / folder).mkdir(parents=True, exist_ok=True)
        with (
            workers_of(executor, jobs) as workers,
            writing_ledger(layout.ledger(shard), one_host=shard[1] == 1) as ledger,
        ):
            layout.remove_unfinished(shard)
            known = self.rows()
            todo = [entry for entry in self._needed(shard, known) if not self._is_prepared(entry, known)]
            tasks = [Task((entry,), job.prepare_shapes) for entry in todo]
            for count, (entry, record) in enumerate(workers.completed(tasks, job.is_late), 1):
                known.shapes[entry.name] = _row_of(record)
                ledger.put_shape(entry.name, known.shapes[entry.name])
                yield Event("shape", entry.name, known.shapes[entry.name], count, len(todo))
            if job.is_late():
                return
            usable = {name for name, record in known.shapes.items() if record["state"] == "done"}
            pairs = [pair for pair in self._in_shard(shard, known) if usable.issuperset(pair)]
            plans = [self._planned(pair, known) for pair in pairs]
            files = {path.name for path in (layout.folder / "maps").iterdir()}
            missing = {
                plan.pair: plan
                for plan in plans
                if not self._is_matched(plan, known.pairs.get(plan.pair), files)
            }
            largest = max((known.shapes[name]["bytes"] for pair in missing for name in pair), default=1)
            most = max(1, len(missing) // (TILES_PER_WORKER * workers.count()))
            tiles = tiles_of(list(missing), self.names, max(1, LOADED // (2 * largest)), most)
            tasks = [Task(tuple(missing[pair] for pair in tile), job.match_pairs) for tile in tiles]
            for count, (plan, record) in enumerate(workers.completed(tasks, job.is_late), 1):
                row = {**_row_of(record), "key": plan.key, "attempt": plan.attempt}
                if row["state"] == "failed":  # the map that was there before is judged as before
                    row["contradicted"] = plan.contradicted
                ledger.put_pair(plan.pair, row)
                yield Event("pair", plan.pair, row, count, len(missing))

    def retry(self, which: Literal["failed", "low"]) -> list[Pair]:
        """Let the next run match pairs again: those that failed, or those that ended with low confidence.

        The same input gives the same map, so the latter are matched with another seed, and the surer map is kept; a map
        that others contradict gives way to the new one. Shapes that could not be prepared are tried again with
        "failed".

        Returns
        -------
        list of two str
            The pairs.
        """
        again: list[Pair] = []
        for path in self.layout.ledgers():
            with writing_ledger(path) as ledger:
                if which == "failed":
                    ledger.forget_failed_shapes()
                for pair, record in list(ledger.rows.pairs.items()):
                    if state_of(record) == which:
                        attempt = record["attempt"] + (which == "low")
                        todo = {"state": "todo", "time": time.time(), "attempt": attempt}
                        ledger.put_pair(pair, {**todo, "contradicted": _was_contradicted(record)})
                        again.append(pair)
        return again

    def _in_shard(self, shard: tuple[int, int], rows: Rows) -> list[Pair]:
        """List the pairs of a shard: as many as of any other, and of few different shapes."""
        pairs = pairs_of(self.names, self.pairs, self.chosen_template(rows))
        index, count = shard
        if count == 1:
            return pairs
        in_order = [pair for tile in tiles_of(pairs, self.names, SIDE, len(pairs)) for pair in tile]
        return in_order[len(pairs) * index // count : len(pairs) * (index + 1) // count]

    def _needed(self, shard: tuple[int, int], rows: Rows) -> list[Entry]:
        """List the shapes of a shard's pairs; all if they decide on the template, each shard beginning elsewhere."""
        if self.pairs == "star" and self.template is None:
            first = len(self.shapes) * shard[0] // shard[1]
            return [*self.shapes[first:], *self.shapes[:first]]
        if shard[1] == 1:
            return list(self.shapes)
        needed = {name for pair in self._in_shard(shard, rows) for name in pair}
        return [entry for entry in self.shapes if entry.name in needed]

    def _is_prepared(self, entry: Entry, rows: Rows) -> bool:
        record = rows.shapes.get(entry.name)
        if record is None or not entry.path.exists():
            return False
        stat = entry.path.stat()
        if (record.get("size"), record.get("changed")) != (stat.st_size, stat.st_mtime_ns):
            return False
        if record["state"] == "failed":
            return True
        key = key_of(self.config, self.seed, record["hash"])
        return bool(record["key"] == key) and self.layout.prepared(key).exists()

    def _planned(self, pair: Pair, rows: Rows) -> PlannedPair:
        shapes = [rows.shapes[name] for name in pair]
        hashes = (shapes[0]["hash"], shapes[1]["hash"])
        row = rows.pairs.get(pair, {})
        attempt = row.get("attempt", 0)
        key = key_of(self.config, self.seed + attempt, *hashes)
        keys = (shapes[0]["key"], shapes[1]["key"])
        return PlannedPair(pair, key, keys, hashes, attempt, row.get("contradicted", False))

    def _is_matched(self, plan: PlannedPair, row: Record | None, files: Container[str]) -> bool:
        if row is None or row["state"] == "todo" or row["key"] != plan.key:
            return False
        return row["state"] == "failed" or self.layout.maps(plan.pair).name in files

    def _require_same(self, old: Collection) -> None:
        """Raise `SettingError` unless another collection has the same settings."""
        mine, theirs = self.config.changed(), old.config.changed()
        different = [name for name in {**mine, **theirs} if mine.get(name) != theirs.get(name)]
        different += [
            name for name in ("pairs", "template", "seed") if getattr(self, name) != getattr(old, name)
        ]
        if different:
            raise SettingError(
                f"{self.folder}: holds a collection with other {', '.join(different)}; continue it with the same, or "
                "give another folder"
            )


def state_of(record: Record) -> str:
    """How a pair stands: "todo", "failed", "low" (matched with low confidence) or "done"."""
    if record["state"] == "done" and record["there"]["outcome"] in ("LOW_CONFIDENCE", "HINTS_CONTRADICTED"):
        return "low"
    return str(record["state"])


def is_contradicted(record: Record) -> bool:
    """Whether other maps contradict that of a pair, as far as they were compared."""
    return bool(record.get("agreement", {}).get("inconsistency", 0.0) > CONTRADICTED)


def _was_contradicted(record: Record) -> bool:
    return is_contradicted(record) or bool(record.get("contradicted", False))


def _row_of(record: Record | Exception) -> Record:
    """Row of a job, or of its end: a worker that died of it."""
    if not isinstance(record, Exception):
        return record
    reason = f"three workers died of it, killed or out of memory ({type(record).__name__}: {record})"
    return {"state": "failed", "time": time.time(), "error": reason}
