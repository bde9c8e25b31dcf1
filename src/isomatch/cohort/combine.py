"""Agreement: find the maps that contradict the others of a collection, and replace them by compositions that agree."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.files import claimed
from isomatch._core.memory import peak_memory, require_memory
from isomatch.cohort.collection import Collection
from isomatch.cohort.jobs import Event, loaded_shape
from isomatch.cohort.ledger import (
    CONTRADICTED,
    Ledger,
    MapRecord,
    MapSummary,
    Pair,
    PairAgreement,
    PairRow,
    Rows,
    read_ledgers,
    writing_ledger,
)
from isomatch.cohort.map_file import PairMaps, digest_of
from isomatch.cohort.plan import tiles_of
from isomatch.cohort.workers import Attempt, Task, Workers, attempted, workers_of
from isomatch.correspondence import UNMATCHED
from isomatch.matching import Evidence, Outcome, lower_outcome, match_both, outcome_of
from isomatch.settings import Config
from isomatch.shapes import PreparedShape

MOST_ROUNDS = 3
TILE = 8  # shapes on either side of a tile of pairs
UNSURE = 0.25  # weight of a map that its own match does not trust
BYTES = 48  # of memory for a triangle, measured with 150 shapes: its reading, and five times that to weigh it
MOST_PATHS = 8  # compositions that are compared; more hardly change which is in their middle
N_SAMPLES = 100  # spacing 0.1 √area: enough for a mean distance
LEAST_SHARED = 0.5  # share of the samples that two maps must both match to be compared
ORIENTATIONS = {"preserve": 1, "reverse": -1, "any": 0}
SHARPNESS = 1.3 ** np.arange(15)  # 1 to 39, in 1/√area


class Agreement(NamedTuple):
    """The agreement of the maps of a collection.

    Maps that are wrong in the same way agree with each other: if all maps to one symmetric shape are mirrored, only the
    orientation shows it.
    """

    compared: int  # pairs that are in triangles of matched pairs
    contradicted: list[Pair]  # those whose maps the others still contradict
    replaced: list[Pair]  # those whose maps were replaced
    turned: list[str]  # shapes whose maps to the others mostly reverse the orientation


def agree(
    collection: Collection,
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[Event]:
    """Find the maps that most others contradict, replace them where that is possible, and yield each that was tried.

    A map is replaced by that composition of two others that agrees with most, refined by a match that starts from it;
    if it then agrees better, and no other map of the pair fits clearly better than it. A map that stays contradicted
    has low confidence. The rows of pairs get ``inconsistency``, now and ``before``, and ``replaced_by``. Maps are
    compared each time; a replacement that was tried with as many shapes is not tried again.

    Pairs that are in no triangle of matched pairs stay as they are: all pairs make triangles, a star none. Of n shapes in
    triangles, 3 n² maps are read up to four times, with O(n³) time and 48 n³ bytes of memory, or a `MemoryBudgetError`.
    Other arguments are those of `Collection.run`.
    """
    own = collection.layout.ledger()
    with ExitStack() as held:
        workers = held.enter_context(workers_of(executor, jobs, time_limit))
        others = [path for path in collection.layout.ledgers() if path != own]
        for path in others:
            held.enter_context(claimed(path))  # shards wait
        ledger = held.enter_context(writing_ledger(own))
        ledger.rows.merge(read_ledgers(others))
        ledger.rows = ledger.rows.of(collection.names)
        names = _in_triangles(ledger.rows)
        what = f"the comparison of the maps of {len(names)} shapes"
        remedy = "match all pairs of fewer shapes, or leave the maps as they are (--no-agree)"
        require_memory(BYTES * len(names) ** 3, what, remedy)
        job = CycleJob(collection.of(names), {name: ledger.rows.shapes[name].key for name in names})
        for _ in range(MOST_ROUNDS):
            inconsistencies = _measured(job, ledger, workers)
            if workers.is_late():
                return
            _write(ledger, job, inconsistencies)
            repairs = _repairs(ledger.rows, job, inconsistencies)
            n_replaced = 0
            tasks = [Task((repair,), partial(attempted, job.repaired)) for repair in repairs]
            for count, (repair, attempt) in enumerate(workers.completed(tasks), 1):
                row = _after(ledger.rows.pairs[repair.pair], attempt, len(job.prepared))
                n_replaced += not isinstance(attempt, Exception) and isinstance(attempt.result, Replacement)
                ledger.put(repair.pair, row)
                yield Event("agreement", repair.pair, row, count, len(repairs))
            if not n_replaced:
                return
        inconsistencies = _measured(job, ledger, workers)
        if not workers.is_late():
            _write(ledger, job, inconsistencies)


def agreement_of(rows: Rows) -> Agreement:
    """Sum up the rows of a collection."""
    compared = [pair for pair, row in rows.pairs.items() if row.agreement is not None]
    names = sorted({name for pair in compared for name in pair})
    number = {name: i for i, name in enumerate(names)}
    orientations = np.full((len(names), len(names)), np.nan)
    for pair in compared:
        i, j = (number[name] for name in pair)
        orientation = rows.pairs[pair].there.measures["orientation"]
        orientations[i, j] = orientations[j, i] = np.nan if orientation is None else orientation
    contradicted = [pair for pair in compared if rows.pairs[pair].is_contradicted]
    replaced = [pair for pair in compared if rows.pairs[pair].replaced_by]
    turned = [names[i] for i in turned_shapes(orientations)] if names else []
    return Agreement(len(compared), contradicted, replaced, turned)


def _in_triangles(rows: Rows) -> list[str]:
    """Names of the prepared shapes that are in triangles of matched pairs."""
    prepared = {name for name, row in rows.shapes.items() if row.key}
    done = [pair for pair, row in rows.pairs.items() if row.state == "done" and prepared.issuperset(pair)]
    near: dict[str, set[str]] = {name: set() for name in prepared}
    for a, b in done:
        near[a].add(b)
        near[b].add(a)
    in_triangles = {name for a, b in done if not near[a].isdisjoint(near[b]) for name in (a, b)}
    return [name for name in rows.shapes if name in in_triangles]


def _measured(job: CycleJob, ledger: Ledger, workers: Workers) -> FloatArray:
    """Inconsistency (n, n) of all pairs of the prepared shapes."""
    rows, names = ledger.rows, list(job.prepared)
    number = {name: i for i, name in enumerate(names)}
    done = [pair for pair in rows.pairs if number.keys() >= set(pair) and rows.is_current(pair)]
    images = np.full((len(names), len(names), N_SAMPLES), UNMATCHED)
    tiles = tiles_of(done, names, TILE, max(1, len(done) // workers.count()))
    tasks = [Task(tuple(tile), partial(attempted, job.images)) for tile in tiles]
    for pair, attempt in workers.completed(tasks):
        if isinstance(attempt, Exception) or attempt.result is None:
            continue  # the next run matches it again
        both, (record, file) = attempt.result
        row = rows.pairs[pair]
        if record.key != row.key:
            continue  # by a run that was killed before it wrote the row, as the next one does
        if file != (row.file or file):
            if record.replaced_by in ((), row.replaced_by):
                continue  # it was changed after it was written; the next run matches it again
            likewise = Attempt(attempt.result[1], "", time.time())
            ledger.put(pair, _after(row, likewise, len(names)))
        a, b = (number[name] for name in pair)
        images[a, b], images[b, a] = both
    readings = np.full((len(names),) * 3, np.nan)
    side = max(1, -(-len(names) // workers.count()))  # the images travel with each task
    compared = partial(attempted, partial(job.readings, images))
    tasks = [Task(tuple(names[i : i + side]), compared) for i in range(0, len(names), side)]
    for name, attempt in workers.completed(tasks):
        if not isinstance(attempt, Exception) and attempt.result is not None:
            readings[:, :, number[name]] = attempt.result
    prior = np.ones(readings.shape[:2])
    for pair in done:
        a, b = (number[name] for name in pair)
        prior[a, b] = prior[b, a] = _prior(rows.pairs[pair], job.collection.config)
    return inconsistency(readings, prior)


def _prior(row: PairRow, config: Config) -> float:
    """Weight of a map by its own evidence: less if it has low confidence, or not the orientation that is wanted."""
    wanted = ORIENTATIONS[config.orientation]
    turned = any(wanted * (side.measures["orientation"] or 0.0) < 0 for side in row.sides)
    unsure = any(outcome.is_doubtful for outcome in _own_outcomes(row))
    return UNSURE if turned or unsure else 1.0


def _own_outcomes(row: PairRow) -> list[Outcome]:
    """Return how the match of a pair itself ended, in both directions."""
    kept = row.agreement.outcomes if row.agreement else ()
    return [Outcome[name] for name in kept] or [side.outcome for side in row.sides]


def _write(ledger: Ledger, job: CycleJob, inconsistencies: FloatArray) -> None:
    """Write how far each pair is from the others; those that are contradicted have low confidence."""
    names = list(job.prepared)
    for i, j in np.argwhere(np.triu(np.isfinite(inconsistencies), 1)):
        value = round(float(inconsistencies[i, j]), 4)
        pair = _as_matched(ledger.rows, names[i], names[j])
        row = ledger.rows.pairs[pair]
        agreement, own = row.agreement or PairAgreement(), _own_outcomes(row)
        agreement = replace(
            agreement,
            before=value if agreement.before is None else agreement.before,
            inconsistency=value,
            outcomes=tuple(outcome.name for outcome in own),
            order=("before", *agreement.order),
        )
        poor = Evidence(poor=value > CONTRADICTED)
        there, back = (side.with_outcome(lower_outcome(x, poor)) for side, x in zip(row.sides, own))
        new = replace(row, agreement=agreement, there=there, back=back)
        if new != row:
            ledger.put(pair, replace(new, time=time.time()))


def _as_matched(rows: Rows, a: str, b: str) -> Pair:
    return (a, b) if (a, b) in rows.pairs else (b, a)


def _repairs(rows: Rows, job: CycleJob, inconsistencies: FloatArray) -> Sequence[Repair]:
    """Plan the repair of contradicted pairs, without those already tried with as many shapes."""
    names = list(job.prepared)
    trusted = np.where(inconsistencies <= CONTRADICTED, trust_in(inconsistencies), 0.0)
    repairs = []
    for a, c in np.argwhere(np.triu(inconsistencies > CONTRADICTED)):
        pair = _as_matched(rows, names[a], names[c])
        paths = trusted[a] * trusted[c]
        middles = [int(b) for b in np.argsort(-paths)[:MOST_PATHS] if paths[b] > 0]
        agreement = rows.pairs[pair].agreement
        if not middles or (agreement and agreement.tried_with == len(names)):
            continue
        outcomes = [_least_sure(rows, pair, names[b]) for b in middles]
        seed = job.collection.seed + rows.pairs[pair].attempt
        over = tuple(names[b] for b in middles)
        repairs.append(Repair(pair, over, tuple(paths[middles]), tuple(outcomes), seed))
    return repairs


def _least_sure(rows: Rows, pair: Pair, middle: str) -> str:
    legs = [rows.pairs.get((end, middle)) or rows.pairs[middle, end] for end in pair]
    outcomes = [side.outcome for leg in legs for side in leg.sides]
    return outcome_of(map(Evidence.of, outcomes)).name


def _after(row: PairRow, attempt: Attempt[Any] | Exception, n_shapes: int) -> PairRow:
    """Row of a pair after an attempt to replace its map."""
    agreement = replace(row.agreement or PairAgreement(), tried_with=n_shapes)
    if isinstance(attempt, Exception):
        attempt = Attempt(f"the worker died ({attempt})", "", time.time())
    if isinstance(attempt.result, Replacement):
        agreement = replace(agreement, outcomes=(), refused="")
        record, more = attempt.result.record, {**row.more, **attempt.result.record.more}
        row = replace(row, state="done", time=attempt.time, agreement=agreement, more=more)
        return replace(row, **record.given(), file=attempt.result.file)
    agreement = replace(agreement, refused=attempt.result or attempt.error)
    return replace(row, agreement=agreement, time=time.time())


class Replacement(NamedTuple):
    """What the file of a pair says once a composition took the place of its map, and the digest of that."""

    record: MapRecord
    file: str


class Repair(NamedTuple):
    """A contradicted pair, and the shapes over which trusted maps lead around it."""

    pair: Pair
    middles: tuple[str, ...]  # the other shapes
    trust: tuple[float, ...]  # weight of the path over each
    outcomes: tuple[str, ...]  # name of the least sure outcome along each
    seed: int  # of the match


@dataclass(frozen=True)
class CycleJob:
    """The jobs of an agreement, which worker processes do."""

    collection: Collection
    prepared: dict[str, str]  # key of each prepared shape, by name

    def images(self, pair: Pair) -> tuple[list[IntArray], Replacement]:
        """Map the samples of the shapes of a pair, there and back; with what the file says, and its digest."""
        maps = self.collection.maps(*pair)
        images = [maps.there.vertices[self._samples(pair[0])], maps.back.vertices[self._samples(pair[1])]]
        return images, Replacement(maps.record, digest_of(self.collection.layout.maps(pair)))

    def readings(self, images: IntArray, target: str) -> FloatArray:
        """Compare all maps to a shape with all compositions of two maps that end there."""
        # images (n, n, m): vertex of the second shape that each sample of the first is mapped to, −1 if not known
        names = list(self.prepared)
        shape, column = self._shape(target), names.index(target)
        readings = np.full((len(names), len(names)), np.nan)
        for b in np.flatnonzero((images[:, column] >= 0).any(axis=1)):
            onwards = self._mapped(names[b], target, images[:, b])
            readings[:, b] = _mean_distances(shape, onwards, images[:, column])
        return readings

    def repaired(self, repair: Repair) -> Replacement | str:
        """Write a map for a pair that agrees better and fits as well, or tell why there is none."""
        pair, turned = repair.pair, repair.pair[::-1]
        old = self.collection.maps(*pair)
        paths, paths_back = (self._paths(ends, repair.middles) for ends in (pair, turned))
        source, target = map(self._shape, pair)
        samples, samples_back = map(self._samples, pair)
        trust = np.array(repair.trust)
        ends = paths[:, samples]
        apart = np.array([_mean_distances(target, end[None], ends) for end in ends])
        best = int(np.nan_to_num(apart, nan=1.0).dot(trust).argmin())
        config = self.collection.config
        alone = replace(config, hypotheses="given")
        rematched = match_both(source, target, initial_map=paths[best], config=alone, seed=repair.seed)

        def disagreement(there: IntArray, back: IntArray) -> float:
            forth = _mean_distances(target, ends, there[None, samples])
            home = _mean_distances(source, paths_back[:, samples_back], back[None, samples_back])
            apart, weights = np.concatenate([forth, home]), np.tile(trust, 2)
            finite = np.isfinite(apart)
            return float(np.average(apart[finite], weights=weights[finite])) if finite.any() else np.inf

        before = disagreement(old.there.vertices, old.back.vertices)
        after = disagreement(rematched.there.map.vertices, rematched.back.map.vertices)
        over = repair.middles[best]
        side = ORIENTATIONS[config.orientation]
        refused = ""
        if not after < min(before, CONTRADICTED):
            refused = f"agrees no better once refined: {after:.2f} √area"
        elif any(result.outcome is Outcome.PRIORS_CONTRADICTED for result in rematched):
            refused = "changes when it is refined"
        elif any(side * result.quality.orientation < 0 for result in rematched):
            refused = f"does not {config.orientation} the orientation"
        elif (worst := np.nanmax([0.0, *(1 / x.quality.runner_up for x in rematched)])) > config.outcome.tie:
            refused = f"fits worse than another map, by a factor {worst:.2f}"
        if refused:
            return f"the composition over {over} {refused}"
        note = (
            f"other maps contradict the map that was matched, by {before:.2f} √area; this one is their composition over "
            f"{over}, refined, and its outcome is at most as sure as theirs"
        )
        least = Evidence.of(Outcome[repair.outcomes[best]])
        results = [
            replace(x, outcome=lower_outcome(x.outcome, least), notes=(note, *x.notes)) for x in rematched
        ]
        there, back = (MapSummary.of(result, settings=True) for result in results)
        by = pair[0], over, pair[1]
        record = replace(old.record, there=there, back=back, memory=peak_memory(), replaced_by=by)
        file = self.collection.layout.maps(pair)
        PairMaps.of(results[0], results[1], record).save(file)
        return Replacement(record, digest_of(file))

    def _mapped(self, first: str, last: str, vertices: IntArray) -> IntArray:
        """Images of vertices of one shape on another one, of which −1 have none."""
        return np.where(vertices >= 0, self.collection.maps(first, last).there.vertices[vertices], UNMATCHED)

    def _paths(self, ends: Pair, middles: Sequence[str]) -> IntArray:
        """Image of each vertex (q, n) of the first of two shapes under the maps over each of q others."""
        first, last = ends
        begun = {b: self.collection.maps(first, b).there.vertices for b in middles}
        return np.array([self._mapped(b, last, vertices) for b, vertices in begun.items()])

    def _shape(self, name: str) -> PreparedShape:
        file = self.collection.layout.prepared(self.prepared[name])
        return loaded_shape(file, self.collection.config)

    def _samples(self, name: str) -> IntArray:
        shape = self._shape(name)
        return np.resize(shape.user_vertex[shape.sample_vertices[:N_SAMPLES]], N_SAMPLES)


def _mean_distances(shape: PreparedShape, first: IntArray, second: IntArray) -> FloatArray:
    """Mean distance (q,) between vertices of a surface in rows (q, m) that broadcast; nan where few are matched."""
    both = np.broadcast_arrays(first, second)
    a, b = (np.where(rows >= 0, shape.body_vertex[rows], UNMATCHED) for rows in both)
    matched = (a >= 0) & (b >= 0)
    apart = np.zeros(a.shape)
    apart[matched] = shape.distance(a[matched], b[matched])
    count = matched.sum(axis=1)
    enough = count >= LEAST_SHARED * a.shape[1]
    return np.where(enough, apart.sum(axis=1) / np.maximum(count, 1), np.nan)


def inconsistency(readings: FloatArray, prior: FloatArray | None = None) -> FloatArray:
    """Estimate how far each map of a collection is from the right one, (n, n) in √area; nan in no triangle.

    Both directions of a pair count together. Maps that are wrong in the same way, such as all maps of one shape that is
    mirrored, are consistent.
    """
    # readings (n, n, n), at (a, b, c): mean distance, in √(area of c), between the images of samples of a under
    # a → b → c and under a → c; nan where a map is missing. prior (n, n): weight of the maps of each pair, symmetric.
    # A right map disagrees with the composition of two others exactly if one of these is wrong. So the disagreements
    # d_abc of a map are averaged with the trust in the two other maps of each triangle, in rounds of rising β:
    #     s_ac ← Σ_b w_ab w_bc d_abc / Σ_b w_ab w_bc,   w = prior · exp(−β s)
    # cycle-edge message passing (Lerman & Shi, Robust Group Synchronization via Cycle-Edge Message Passing, FoCM 2022).
    # O(n³) time and memory.
    triangles = _triangles(readings)
    measured = np.isfinite(triangles)
    errors = np.where(measured, triangles, 0.0)
    inconsistencies: FloatArray = np.full(errors.shape[:2], np.nan)
    prior_trust = np.ones_like(inconsistencies) if prior is None else prior
    trust = prior_trust
    for sharpness in SHARPNESS:
        weights = np.where(measured, trust[:, :, None] * trust[None, :, :], 0.0)
        total = weights.sum(axis=1)
        with np.errstate(invalid="ignore"):
            inconsistencies = (weights * errors).sum(axis=1) / total
        trust = prior_trust * trust_in(np.nan_to_num(inconsistencies, nan=np.inf), sharpness)
    return np.asarray((inconsistencies + inconsistencies.T) / 2)  # symmetric, as up to rounding it was


def trust_in(inconsistencies: FloatArray, sharpness: float = SHARPNESS[-1]) -> FloatArray:
    """Weight exp(−sharpness × inconsistency) of maps, from 1 down to 0."""
    return np.asarray(np.exp(-sharpness * inconsistencies))


def turned_shapes(orientations: FloatArray) -> IntArray:
    """Find the shapes that are mirrored against the others, the smaller group of each connected set."""
    links = np.nan_to_num(orientations)  # (n, n) of the maps of pairs: near 1 or −1, nan where it is unclear
    np.fill_diagonal(links, 1.0)
    count, group = connected_components(links != 0, directed=False)
    sides = [_smaller_side(links, np.flatnonzero(group == i)) for i in range(count)]
    return np.sort(np.concatenate(sides))


def _smaller_side(links: FloatArray, members: IntArray) -> IntArray:
    # of a graph that is two groups with links 1 within and −1 between, signs of the leading eigenvector tell which
    side = np.linalg.eigh(links[np.ix_(members, members)])[1][:, -1]
    return min(members[side < 0], members[side >= 0], key=len)


def _triangles(readings: FloatArray) -> FloatArray:
    """Mean over the six readings of each triangle that are known; nan if none is, or two of its shapes are one."""
    turned = [readings.transpose(order) for order in permutations(range(3))]
    n_measured = sum(np.isfinite(reading).astype(np.int64) for reading in turned)
    total = sum(np.nan_to_num(reading) for reading in turned)
    i = np.arange(len(readings))
    mean: FloatArray = np.where(n_measured > 0, total / np.maximum(n_measured, 1), np.nan)
    mean[i, i, :] = mean[i, :, i] = mean[:, i, i] = np.nan
    return mean
