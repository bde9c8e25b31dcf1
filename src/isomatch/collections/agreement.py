"""Agreement: find the maps that contradict the others of a collection, and replace them by compositions that agree."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from isomatch.collections.collection import Collection
from isomatch.collections.consistency import CONTRADICTED, inconsistency, trust_in, turned_shapes
from isomatch.collections.cycles import N_SAMPLES, CycleJob, Repair
from isomatch.collections.ledger import Ledger, Rows, read_ledgers, writing_ledger
from isomatch.collections.map_file import Record
from isomatch.collections.pairs import Pair, tiles_of
from isomatch.collections.run import Event
from isomatch.collections.states import is_contradicted
from isomatch.collections.workers import Task, Workers, late_after, workers_of
from isomatch.correspondence import UNMATCHED
from isomatch.matching import Evidence, Outcome, lowered, outcome_of
from isomatch.runtime.memory import require_memory
from isomatch.settings import Config
from isomatch.storage.files import claimed
from isomatch.values.arrays import FloatArray

MOST_ROUNDS = 3
TILE = 8  # shapes on either side of a tile of pairs
UNSURE = 0.25  # weight of a map that its own match does not trust
BYTES = 48  # of memory for a triangle, measured with 150 shapes: its reading, and five times that to weigh it
MOST_PATHS = 8  # compositions that are compared; more hardly change which is in their middle


class Agreement(NamedTuple):
    """The agreement of the maps of a collection.

    Parameters
    ----------
    compared : int
        Pairs that are in triangles of matched pairs.
    contradicted : list of two str
        Those whose maps the others still contradict.
    replaced : list of two str
        Those whose maps were replaced.
    turned : list of str
        Shapes whose maps to the others mostly reverse the orientation. Maps that are wrong in the same way agree with
        each other; if all maps to one symmetric shape are mirrored, only the orientation shows it.
    """

    compared: int
    contradicted: list[Pair]
    replaced: list[Pair]
    turned: list[str]


def agree(
    collection: Collection,
    executor: str | Executor = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[Event]:
    """Find the maps that most others contradict, replace them where that is possible, and yield each that was tried.

    A map is replaced by that composition of two others that agrees with most, refined by a match that starts from it;
    if it then agrees better, and no other map of the pair fits clearly better than it. A map that stays contradicted
    has low confidence. The rows of pairs get ``inconsistency``, now and ``before``, and ``replaced_by``. Maps are
    compared each time; a replacement that was tried with as many shapes is not tried again.

    Parameters
    ----------
    collection : Collection
        Pairs that are in no triangle of matched pairs stay as they are: all pairs make triangles, a star none.
    executor, jobs, time_limit
        As for `Collection.run`.

    Raises
    ------
    UnwritableFileError
        If a run of the collection or of a shard goes on, or the folder cannot be written.
    MemoryBudgetError
        If there are too many shapes to compare.

    Notes
    -----
    For n shapes in triangles, 3 n² maps are read up to four times, with O(n³) time and memory: 48 n³ bytes.
    """
    late = late_after(time_limit)
    own = collection.layout.ledger()
    with ExitStack() as held:
        workers = held.enter_context(workers_of(executor, jobs))
        others = [path for path in collection.layout.ledgers() if path != own]
        for path in others:
            held.enter_context(claimed(path))  # shards wait
        ledger = held.enter_context(writing_ledger(own))
        ledger.rows.merge(read_ledgers(others))
        ledger.rows = ledger.rows.of(collection.names)
        names = _in_triangles(ledger.rows)
        require_memory(
            BYTES * len(names) ** 3,
            f"the comparison of the maps of {len(names)} shapes",
            "match all pairs of fewer shapes, or leave the maps as they are (--no-agree)",
        )
        job = CycleJob(collection.of(names), {name: ledger.rows.shapes[name]["key"] for name in names})
        for _ in range(MOST_ROUNDS):
            inconsistencies = _measured(job, ledger, workers, late)
            if late():
                return
            _write(ledger, job, inconsistencies)
            repairs = _repairs(ledger.rows, job, inconsistencies)
            n_replaced = 0
            tasks = [Task((repair,), job.repaired) for repair in repairs]
            for count, (repair, result) in enumerate(workers.completed(tasks, late), 1):
                row = _after(ledger.rows.pairs[repair.pair], result, len(job.prepared))
                n_replaced += not isinstance(result, Exception) and "replaced_by" in result
                ledger.put_pair(repair.pair, row)
                yield Event("agreement", repair.pair, row, count, len(repairs))
            if not n_replaced:
                return
        inconsistencies = _measured(job, ledger, workers, late)
        if not late():
            _write(ledger, job, inconsistencies)


def agreement_of(rows: Rows) -> Agreement:
    """Sum up the rows of a collection."""
    compared = [pair for pair, row in rows.pairs.items() if "agreement" in row]
    names = sorted({name for pair in compared for name in pair})
    number = {name: i for i, name in enumerate(names)}
    orientations = np.full((len(names), len(names)), np.nan)
    for pair in compared:
        i, j = (number[name] for name in pair)
        orientation = rows.pairs[pair]["there"]["quality"]["orientation"]
        orientations[i, j] = orientations[j, i] = np.nan if orientation is None else orientation
    return Agreement(
        len(compared),
        [pair for pair in compared if is_contradicted(rows.pairs[pair])],
        [pair for pair in compared if "replaced_by" in rows.pairs[pair]],
        [names[i] for i in turned_shapes(orientations)] if names else [],
    )


def _in_triangles(rows: Rows) -> list[str]:
    """Names of the prepared shapes that are in triangles of matched pairs."""
    prepared = {name for name, row in rows.shapes.items() if "key" in row}
    done = [pair for pair, row in rows.pairs.items() if row["state"] == "done" and prepared.issuperset(pair)]
    near: dict[str, set[str]] = {name: set() for name in prepared}
    for a, b in done:
        near[a].add(b)
        near[b].add(a)
    in_triangles = {name for a, b in done if not near[a].isdisjoint(near[b]) for name in (a, b)}
    return [name for name in rows.shapes if name in in_triangles]


def _measured(job: CycleJob, ledger: Ledger, workers: Workers, late: Callable[[], bool]) -> FloatArray:
    """Inconsistency (n, n) of all pairs of the prepared shapes."""
    rows, names = ledger.rows, list(job.prepared)
    number = {name: i for i, name in enumerate(names)}
    done = [pair for pair in rows.pairs if number.keys() >= set(pair) and rows.is_current(pair)]
    images = np.full((len(names), len(names), N_SAMPLES), UNMATCHED)
    tiles = tiles_of(done, names, TILE, max(1, len(done) // workers.count()))
    for pair, result in workers.completed([Task(tuple(tile), job.images) for tile in tiles], late):
        if isinstance(result, Exception) or "images" not in result:
            continue  # the next run matches it again
        if result["record"]["key"] != rows.pairs[pair]["key"]:
            continue  # by a run that was killed before it wrote the row, as the next one does
        saved = {"time": time.time(), **result["record"]}
        if saved["file"] != rows.pairs[pair].get("file", saved["file"]):
            if saved.get("replaced_by") in (None, rows.pairs[pair].get("replaced_by")):
                continue  # it was changed after it was written; the next run matches it again
            ledger.put_pair(pair, _after(rows.pairs[pair], saved, len(names)))  # likewise
        a, b = (number[name] for name in pair)
        images[a, b], images[b, a] = result["images"]
    readings = np.full((len(names),) * 3, np.nan)
    side = max(1, -(-len(names) // workers.count()))  # the images travel with each task
    tasks = [
        Task(tuple(names[i : i + side]), partial(job.readings, images)) for i in range(0, len(names), side)
    ]
    for name, result in workers.completed(tasks, late):
        if not isinstance(result, Exception) and "readings" in result:
            readings[:, :, number[name]] = result["readings"]
    prior = np.ones(readings.shape[:2])
    for pair in done:
        a, b = (number[name] for name in pair)
        prior[a, b] = prior[b, a] = _prior(rows.pairs[pair], job.collection.config)
    return inconsistency(readings, prior)


def _prior(row: Record, config: Config) -> float:
    """Weight of a map by its own evidence: less if it has low confidence, or not the orientation that is wanted."""
    outcomes = row.get("agreement", {}).get("outcomes") or [
        row[side]["outcome"] for side in ("there", "back")
    ]
    wanted = {"preserve": 1, "reverse": -1, "any": 0}[config.orientation]
    turned = any(wanted * (row[side]["quality"]["orientation"] or 0.0) < 0 for side in ("there", "back"))
    unsure = any(Outcome[outcome].is_doubtful for outcome in outcomes)
    return UNSURE if turned or unsure else 1.0


def _write(ledger: Ledger, job: CycleJob, inconsistencies: FloatArray) -> None:
    """Write how far each pair is from the others; those that are contradicted have low confidence."""
    for a, b, value in _values_of_pairs(job, inconsistencies):
        pair = (a, b) if (a, b) in ledger.rows.pairs else (b, a)
        row = ledger.rows.pairs[pair]
        known = {"before": value, **row.get("agreement", {})}
        own = known.get("outcomes") or [row[side]["outcome"] for side in ("there", "back")]
        agreement = {**known, "inconsistency": value, "outcomes": own}
        sides = {}
        for side, outcome in zip(("there", "back"), own):
            held = lowered(Outcome[outcome], Evidence(poor=value > CONTRADICTED))
            sides[side] = {**row[side], "outcome": held.name, "advice": held.advice}
        new = {**row, **sides, "agreement": agreement}
        if new != row:
            ledger.put_pair(pair, {**new, "time": time.time()})


def _values_of_pairs(job: CycleJob, inconsistencies: FloatArray) -> Iterator[tuple[str, str, float]]:
    names = list(job.prepared)
    for i, j in np.argwhere(np.triu(np.isfinite(inconsistencies), 1)):
        yield names[i], names[j], round(float(inconsistencies[i, j]), 4)


def _repairs(rows: Rows, job: CycleJob, inconsistencies: FloatArray) -> Sequence[Repair]:
    """Plan the repair of contradicted pairs, without those already tried with as many shapes."""
    names = list(job.prepared)
    trusted = np.where(inconsistencies <= CONTRADICTED, trust_in(inconsistencies), 0.0)
    repairs = []
    for a, c in np.argwhere(np.triu(inconsistencies > CONTRADICTED)):
        pair = (names[a], names[c]) if (names[a], names[c]) in rows.pairs else (names[c], names[a])
        paths = trusted[a] * trusted[c]
        middles = [int(b) for b in np.argsort(-paths)[:MOST_PATHS] if paths[b] > 0]
        if not middles or rows.pairs[pair]["agreement"].get("tried_with") == len(names):
            continue
        outcomes = [_least_sure(rows, pair, names[b]) for b in middles]
        seed = job.collection.seed + rows.pairs[pair]["attempt"]
        repairs.append(
            Repair(pair, tuple(names[b] for b in middles), tuple(paths[middles]), tuple(outcomes), seed)
        )
    return repairs


def _least_sure(rows: Rows, pair: Pair, middle: str) -> str:
    legs = [rows.pairs.get((end, middle)) or rows.pairs[middle, end] for end in pair]
    outcomes = [Outcome[leg[side]["outcome"]] for leg in legs for side in ("there", "back")]
    return outcome_of(map(Evidence.of, outcomes)).name


def _after(row: Record, result: Any, n_shapes: int) -> Record:
    """Row of a pair after an attempt to replace its map."""
    agreement = {**row.get("agreement", {}), "tried_with": n_shapes}
    if isinstance(result, Exception):
        result = {"refused": f"the worker died ({result})"}
    if "replaced_by" in result:
        for told_before in ("outcomes", "refused"):
            agreement.pop(told_before, None)
        return {**row, **result, "agreement": agreement}
    reason = result.get("refused") or result["error"]
    return {**row, "agreement": {**agreement, "refused": reason}, "time": time.time()}
