"""The jobs of a collection, which worker processes run: they read files, write files and return rows for the ledger."""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from isomatch.assets import surface_from
from isomatch.collections.cohort import holes_of
from isomatch.collections.kept import digest_of
from isomatch.collections.layout import Layout, identity_of, key_of
from isomatch.collections.likeness import likeness_of
from isomatch.collections.map_file import SIDES, PairMaps, Record
from isomatch.collections.pairs import Pair
from isomatch.collections.shapes import Entry
from isomatch.collections.template import features_of
from isomatch.errors import FormatError, MissingFileError, UnwritableFileError
from isomatch.matching import MatchResult, Outcome, match_both
from isomatch.runtime.memory import peak_memory
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, prepare
from isomatch.storage.files import is_of_one_file, legible
from isomatch.surfaces import Graph, Mesh, reflected

LOADED = 256 * 2**20  # bytes of files of prepared shapes that a worker keeps; a match itself needs more
REFLECTED = "reflected before it was prepared, x → −x; vertices and faces keep their numbers"


class PlannedPair(NamedTuple):
    """A pair to match.

    Parameters
    ----------
    pair : (str, str)
        Names of the shapes.
    key : str
        Identifies the match.
    shapes : (str, str)
        Keys of the prepared shapes.
    hashes : (str, str)
        ``content_hash`` of the surfaces in the files.
    reflected : tuple of str
        Which of the shapes are matched as their mirror images.
    attempt : int
        Added to the seed.
    contradicted : bool
        Whether other maps contradict the earlier one, so that any new one replaces it.
    """

    pair: Pair
    key: str
    shapes: tuple[str, str]
    hashes: tuple[str, str]
    reflected: tuple[str, ...]
    attempt: int
    contradicted: bool = False


class Reflection(NamedTuple):
    """A shape to turn the other way round, as ``entry`` says, and the pair that is matched with it to see if it fits."""

    entry: Entry
    plan: PlannedPair


@dataclass(frozen=True)
class Job:
    """What all jobs of a run share.

    Parameters
    ----------
    layout : Layout
        The folder.
    config : Config
        Settings of the matches.
    seed : int
        Their seed.
    end : float
        Time, in seconds since the epoch, after which nothing new is begun.
    """

    layout: Layout
    config: Config
    seed: int
    end: float = math.inf

    def is_late(self) -> bool:
        """Whether nothing new is to be begun."""
        return time.time() > self.end

    def prepare_shapes(self, entries: Sequence[Entry]) -> list[Record]:
        """Read and prepare shapes that are not prepared yet; return the rows of all."""
        return [self._row_of_shape(entry) for entry in entries]

    def match_pairs(self, plans: Sequence[PlannedPair]) -> list[Record]:
        """Match pairs that are not matched yet; return the rows of all that there was time for."""
        return [row_of(partial(self._matched, plan)) for plan in plans if not self.is_late()]

    def reflect_shapes(self, reflections: Sequence[Reflection]) -> list[Record]:
        """Turn shapes the other way round, where a match that is not in doubt bears it out.

        Returns
        -------
        list of dict
            The rows of the ``shape`` and of the ``pair``; or ``refused``: why the shape stays as it is.
        """
        return [row_of(partial(self._reflected, reflection)) for reflection in reflections]

    def _row_of_shape(self, entry: Entry) -> Record:
        stat: Record = {}
        if entry.path.exists():
            file = entry.path.stat()
            stat = {"size": file.st_size, "changed": file.st_mtime_ns}
        return stat | row_of(partial(self._prepared, entry))

    def _prepared(self, entry: Entry) -> Record:
        surface = surface_from(entry.path)
        key = key_of(self.config, self.seed, identity_of(surface.content_hash, entry.reflected))
        file = self.layout.prepared(key)
        shape = _loaded_if_whole(file, self.config)
        if shape is None:
            shape = prepare(reflected(surface) if entry.reflected else surface, self.config, self.seed)
            if entry.reflected:
                shape = replace(shape, notes=(REFLECTED, *shape.notes))
            shape.save(file)
        return {
            "key": key,
            "hash": surface.content_hash,
            "reflected": entry.reflected,
            "bytes": file.stat().st_size,
            "file": digest_of(file),
            "n_vertices": surface.n_vertices,
            "area": float(surface.vertex_areas.sum()),
            "features": features_of(shape),
            **({} if isinstance(surface, Graph) else likeness_of(surface)),
            "holes": holes_of(surface) if isinstance(surface, Mesh) else None,
            "notes": list(shape.notes),
        }

    def _matched(self, plan: PlannedPair) -> Record:
        file = self.layout.maps(plan.pair)
        earlier = _maps_if_whole(file)
        if earlier and earlier.record["key"] == plan.key:
            return {**earlier.record, "file": digest_of(file)}
        maps = self._new_maps(plan)
        if (
            earlier
            and plan.attempt
            and not plan.contradicted
            and _surfaces_of(earlier.record) == _surfaces_of(maps.record)
            and _unsureness(earlier.record) <= _unsureness(maps.record)
        ):
            maps = replace(earlier, record={**earlier.record, "key": plan.key})
        maps.save(file)
        return {**maps.record, "file": digest_of(file)}

    def _reflected(self, reflection: Reflection) -> Record:
        entry, plan = reflection
        shape = self._row_of_shape(entry)
        if shape["state"] == "failed":
            return {"refused": shape["error"]}
        file = self.layout.maps(plan.pair)
        maps = _maps_if_whole(file)
        if maps is None or maps.record["key"] != plan.key:  # else a run saved it, and was killed
            maps = self._new_maps(plan)
            outcomes = [Outcome[maps.record[side]["outcome"]] for side in SIDES]
            if any(outcome.is_doubtful for outcome in outcomes):
                doubts = min(outcomes, key=lambda outcome: outcome.sureness)
                return {"refused": f"the other way round, the match ends with {doubts.value}"}
            maps.save(file)
        pair = {"state": "done", "time": time.time(), **maps.record, "file": digest_of(file)}
        return {"shape": shape, "pair": pair}

    def _new_maps(self, plan: PlannedPair) -> PairMaps:
        start = time.perf_counter()
        source, target = (loaded_shape(self.layout.prepared(key), self.config) for key in plan.shapes)
        matches = match_both(source, target, config=self.config, seed=self.seed + plan.attempt)
        record = {
            "key": plan.key,
            "source_hash": plan.hashes[0],
            "target_hash": plan.hashes[1],
            "reflected": list(plan.reflected),
            "there": _summary(matches.there),
            "back": _summary(matches.back),
            "seconds": time.perf_counter() - start,
            "memory": peak_memory(),
        }
        return PairMaps.of(*matches, record)


def _summary(result: MatchResult) -> Record:
    """Describe a result, without the settings, which are those of the collection."""
    return {name: value for name, value in result.to_dict().items() if name != "config"}


def _surfaces_of(record: Record) -> tuple[str, str, list[str]]:
    return record["source_hash"], record["target_hash"], record.get("reflected", [])


def _unsureness(record: Record) -> tuple[int, float]:
    there = record["there"]
    return -Outcome[there["outcome"]].sureness, there["quality"]["misfit"] or 0.0


def row_of(work: Callable[[], Record]) -> Record:
    """Run a job and return its row, with the time; a failure becomes a row with its reason.

    Raises
    ------
    UnwritableFileError
        If the disk is full, or cannot be written for any other reason that the next job would meet, too.
    """
    start = time.perf_counter()
    try:
        record = work()
        return {"state": "done", "time": time.time(), "seconds": time.perf_counter() - start, **record}
    except Exception as error:  # whatever else it is becomes a row with its reason; nothing ends a run
        if isinstance(error, UnwritableFileError) and not is_of_one_file(error):
            raise
        reason = legible(f"{type(error).__name__}: {error}")  # it may name a file
        return {
            "state": "failed",
            "time": time.time(),
            "error": reason,
            "seconds": time.perf_counter() - start,
        }


def _maps_if_whole(file: Path) -> PairMaps | None:
    try:
        return PairMaps.load(file)
    except FormatError:  # none, or one that a full disk cut short
        return None


def _loaded_if_whole(file: Path, config: Config) -> PreparedShape | None:
    try:
        return PreparedShape.load(file, config)
    except FormatError:
        return None


_shapes = OrderedDict[tuple[Path, int, Config], tuple[PreparedShape, int]]()
"""Of this process, by file and time; last used last."""
_taking = Lock()  # a worker of a cluster may have several threads


def loaded_shape(file: Path, config: Config) -> PreparedShape:
    """Read a prepared shape, or take it from memory, from which the least recently used shapes are dropped."""
    with _taking:
        if not file.exists():
            raise MissingFileError(
                f"{file}: no such prepared shape; run isomatch collect again, which makes it"
            )
        stat = file.stat()
        key = file, stat.st_mtime_ns, config
        held = _shapes.pop(key, None) or (PreparedShape.load(file, config), stat.st_size)
        _shapes[key] = held
        while sum(size for _, size in _shapes.values()) > LOADED and len(_shapes) > 2:
            _shapes.popitem(last=False)
    return held[0]
