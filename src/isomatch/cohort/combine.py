"""Agreement of maps: contradicted ones are found, and replaced by compositions of others."""

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
from isomatch.cohort.jobs import Event, load_shape
from isomatch.cohort.ledger import (
    MAX_INCONSISTENCY,
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
from isomatch.cohort.plan import TILE_SIDE, tiles_of
from isomatch.cohort.workers import Attempt, Task, Workers, workers_of
from isomatch.correspondence import UNMATCHED
from isomatch.matching import Evidence, Outcome, lower_outcome, match_both, outcome_of
from isomatch.settings import Config
from isomatch.shapes import PreparedShape

MAX_ROUNDS = 3  # largest number of rounds in which contradicted maps are replaced; chosen
# weight of a map with low confidence in its own match, or of the wrong orientation; other maps have 1; chosen
UNSURE_WEIGHT = 0.25
TRIANGLE_BYTES = 48  # bytes of memory for each triple of shapes, 6 numbers; measured with 150 shapes
# A map is replaced by the middle one of at most this many compositions; chosen: with more, it hardly changes.
MAX_PATHS = 8
N_SAMPLES = 100  # number of vertices at which maps are compared; chosen: about 0.1 √area from each other
MIN_SHARED = 0.5  # two maps are compared if both match at least this share of the samples; chosen
# for each setting, the sign that the orientation of a map should have; 0 if both are allowed
WANTED_SIGN = {"preserve": 1, "reverse": -1, "any": 0}
# β in each round of `inconsistency`: the trust in a map is exp(−β × its inconsistency in √area); 1 to 39; chosen
SHARPNESS = 1.3 ** np.arange(15)


class Agreement(NamedTuple):
    """The agreement of the maps of a collection.

    Maps that are wrong in the same way agree with each other: if all maps to one symmetric shape
    are mirrored, only the orientation shows it.
    """

    compared: int  # number of pairs whose maps were compared: those in a triangle of matched pairs
    contradicted: list[Pair]  # pairs whose maps the maps of other pairs still contradict
    replaced: list[Pair]  # pairs whose maps were replaced
    turned: list[str]  # shapes whose maps to other shapes mostly reverse the orientation


def agree(
    collection: Collection,
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[Event]:
    """Find the maps that most others contradict, replace them if possible, and yield each attempt.

    A map is replaced by the composition of two others that agrees with most, refined by a match
    that starts from it, if it then agrees better, and no other map of the pair fits clearly better.
    A map that stays contradicted has low confidence. The rows of pairs get ``inconsistency``, now
    and ``before``, and ``replaced_by``. Maps are compared each time; a replacement that was tried
    with as many shapes is not tried again.

    Pairs in no triangle of matched pairs stay as they are: all pairs make triangles, a star none.
    For n shapes in triangles, 3 n² maps are read up to four times, with O(n³) time and 48 n³ bytes
    of memory, or a `MemoryBudgetError`. Other arguments are those of `Collection.run`.
    """
    ledger_path = collection.layout.ledger()
    with ExitStack() as held:
        workers = held.enter_context(workers_of(executor, jobs, time_limit))
        others = [path for path in collection.layout.ledgers() if path != ledger_path]
        for path in others:
            held.enter_context(claimed(path))  # runs of shards wait for these files
        ledger = held.enter_context(writing_ledger(ledger_path))
        ledger.rows.merge(read_ledgers(others))
        ledger.rows = ledger.rows.of(collection.names)
        names = _names_in_triangles(ledger.rows)
        what = f"the comparison of the maps of {len(names)} shapes"
        remedy = "match all pairs of fewer shapes, or leave the maps as they are (--no-agree)"
        require_memory(TRIANGLE_BYTES * len(names) ** 3, what, remedy)
        job = CycleJob(collection.of(names), {name: ledger.rows.shapes[name].key for name in names})
        for round_left in reversed(range(MAX_ROUNDS + 1)):
            inconsistencies = _measure(job, ledger, workers)
            if workers.is_late():
                return
            _record(ledger, job, inconsistencies)
            repairs = _plan_repairs(ledger.rows, job, inconsistencies) if round_left else []
            n_replaced = 0
            tasks = [Task((repair,), job.repair) for repair in repairs]
            for count, (repair, attempt) in enumerate(workers.completed(tasks), 1):
                row = _row_after(ledger.rows.pairs[repair.pair], attempt, len(job.prepared))
                n_replaced += isinstance(attempt.result, Replacement)
                ledger.put(repair.pair, row)
                yield Event("agreement", repair.pair, row, count, len(repairs))
            if not n_replaced:
                return


def agreement_of(rows: Rows) -> Agreement:
    """Sum up the rows of a collection."""
    compared = [pair for pair, row in rows.pairs.items() if row.agreement is not None]
    names = sorted({name for pair in compared for name in pair})
    number = {name: i for i, name in enumerate(names)}
    orientations = np.full((len(names), len(names)), np.nan)
    for pair in compared:
        i, j = (number[name] for name in pair)
        orientation = rows.pairs[pair].forward.measures["orientation"]
        orientations[i, j] = orientations[j, i] = np.nan if orientation is None else orientation
    contradicted = [pair for pair in compared if rows.pairs[pair].is_contradicted]
    replaced = [pair for pair in compared if rows.pairs[pair].replaced_by]
    turned = [names[i] for i in turned_shapes(orientations)] if names else []
    return Agreement(len(compared), contradicted, replaced, turned)


def _names_in_triangles(rows: Rows) -> list[str]:
    """List the prepared shapes that are in triangles of matched pairs."""
    prepared = {name for name, row in rows.shapes.items() if row.key}
    done = [pair for pair, row in rows.pairs.items() if row.state == "done" and prepared.issuperset(pair)]
    near: dict[str, set[str]] = {name: set() for name in prepared}
    for a, b in done:
        near[a].add(b)
        near[b].add(a)
    in_triangles = {name for a, b in done if not near[a].isdisjoint(near[b]) for name in (a, b)}
    return [name for name in rows.shapes if name in in_triangles]


def _measure(job: CycleJob, ledger: Ledger, workers: Workers) -> FloatArray:
    """Measure the inconsistency (n, n) of all pairs of the prepared shapes."""
    rows, names = ledger.rows, list(job.prepared)
    number = {name: i for i, name in enumerate(names)}
    done = [pair for pair in rows.pairs if number.keys() >= set(pair) and rows.is_current(pair)]
    images = np.full((len(names), len(names), N_SAMPLES), UNMATCHED)
    tiles = tiles_of(done, names, TILE_SIDE, max(1, len(done) // workers.count()))
    tasks = [Task(tuple(tile), job.images) for tile in tiles]
    for pair, attempt in workers.completed(tasks):
        if attempt.result is None:
            continue  # the file is damaged; the next run matches the pair again
        both, (record, file) = attempt.result
        row = rows.pairs[pair]
        if record.key != row.key:
            continue  # a run was killed after it wrote the map; the next run writes the row
        if file != (row.file or file):
            if record.replaced_by in ((), row.replaced_by):
                continue  # the file was changed later; the next run matches the pair again
            replaced = Attempt(attempt.result[1], "", time.time())
            ledger.put(pair, _row_after(row, replaced, len(names)))
        a, b = (number[name] for name in pair)
        images[a, b], images[b, a] = both
    readings = np.full((len(names),) * 3, np.nan)
    side = max(1, -(-len(names) // workers.count()))  # one task for each worker, as each carries all images
    compare = partial(job.readings, images)
    tasks = [Task(tuple(names[i : i + side]), compare) for i in range(0, len(names), side)]
    for name, attempt in workers.completed(tasks):
        if attempt.result is not None:
            readings[:, :, number[name]] = attempt.result
    prior = np.ones(readings.shape[:2])
    for pair in done:
        a, b = (number[name] for name in pair)
        prior[a, b] = prior[b, a] = _prior(rows.pairs[pair], job.collection.config)
    return inconsistency(readings, prior)


def _prior(row: PairRow, config: Config) -> float:
    """Weigh a map by its own evidence: less with low confidence, or the wrong orientation."""
    wanted = WANTED_SIGN[config.orientation]
    is_turned = any(wanted * (side.measures["orientation"] or 0.0) < 0 for side in row.sides)
    return UNSURE_WEIGHT if is_turned or any(x.is_doubtful for x in _own_outcomes(row)) else 1.0


def _own_outcomes(row: PairRow) -> list[Outcome]:
    """Return how the match of a pair itself ended, in both directions."""
    kept = row.agreement.outcomes if row.agreement else ()
    return [Outcome[name] for name in kept] or [side.outcome for side in row.sides]


def _record(ledger: Ledger, job: CycleJob, inconsistencies: FloatArray) -> None:
    """Write the inconsistency of each pair; a contradicted one has low confidence."""
    names = list(job.prepared)
    for i, j in np.argwhere(np.triu(np.isfinite(inconsistencies), 1)):
        value = round(float(inconsistencies[i, j]), 4)
        pair = _as_matched(ledger.rows, names[i], names[j])
        row = ledger.rows.pairs[pair]
        agreement, match_outcomes = row.agreement or PairAgreement(), _own_outcomes(row)
        before = value if agreement.before is None else agreement.before
        outcomes = tuple(outcome.name for outcome in match_outcomes)
        agreement = replace(agreement, before=before, inconsistency=value, outcomes=outcomes)
        poor = Evidence(poor=value > MAX_INCONSISTENCY)
        lowered = (lower_outcome(outcome, poor) for outcome in match_outcomes)
        forward, backward = (side.with_outcome(outcome) for side, outcome in zip(row.sides, lowered))
        new = replace(row, agreement=agreement, forward=forward, backward=backward)
        if new != row:
            ledger.put(pair, replace(new, time=time.time()))


def _as_matched(rows: Rows, a: str, b: str) -> Pair:
    return (a, b) if (a, b) in rows.pairs else (b, a)


def _plan_repairs(rows: Rows, job: CycleJob, inconsistencies: FloatArray) -> Sequence[Repair]:
    """Plan the repair of contradicted pairs that were not tried with as many shapes before."""
    names = list(job.prepared)
    trusted = np.where(inconsistencies <= MAX_INCONSISTENCY, trust_in(inconsistencies), 0.0)
    repairs = []
    for a, c in np.argwhere(np.triu(inconsistencies > MAX_INCONSISTENCY)):
        pair = _as_matched(rows, names[a], names[c])
        paths = trusted[a] * trusted[c]
        numbers = [int(b) for b in np.argsort(-paths)[:MAX_PATHS] if paths[b] > 0]
        agreement = rows.pairs[pair].agreement
        if not numbers or (agreement and agreement.tried_with == len(names)):
            continue
        middles = tuple(names[b] for b in numbers)
        outcomes = tuple(_least_sure(rows, pair, middle) for middle in middles)
        seed = job.collection.seed + rows.pairs[pair].attempt
        repairs.append(Repair(pair, middles, tuple(paths[numbers]), outcomes, seed))
    return repairs


def _least_sure(rows: Rows, pair: Pair, middle: str) -> str:
    legs = [rows.pairs.get((end, middle)) or rows.pairs[middle, end] for end in pair]
    outcomes = [side.outcome for leg in legs for side in leg.sides]
    return outcome_of(map(Evidence.of, outcomes)).name


def _row_after(row: PairRow, attempt: Attempt[Any], n_shapes: int) -> PairRow:
    """Return the row of a pair after an attempt to replace its map."""
    agreement = replace(row.agreement or PairAgreement(), tried_with=n_shapes)
    if isinstance(attempt.result, Replacement):
        agreement = replace(agreement, outcomes=(), refused="")
        record, more = attempt.result.record, {**row.more, **attempt.result.record.more}
        row = replace(row, state="done", time=attempt.time, agreement=agreement, more=more)
        return replace(row, **record.given(), file=attempt.result.file)
    agreement = replace(agreement, refused=attempt.result or attempt.error)
    return replace(row, agreement=agreement, time=time.time())


class Replacement(NamedTuple):
    """The record of the maps that replaced those of a pair, and the digest of their file."""

    record: MapRecord
    file: str


class Repair(NamedTuple):
    """A contradicted pair, and the shapes through which trusted maps lead around it."""

    pair: Pair
    middles: tuple[str, ...]  # names of the shapes through which each path leads
    trust: tuple[float, ...]  # weight of the path through each of these shapes
    outcomes: tuple[str, ...]  # name of the least sure outcome along each path
    seed: int  # seed of the match


@dataclass(frozen=True)
class CycleJob:
    """The jobs of an agreement for worker processes."""

    collection: Collection
    prepared: dict[str, str]  # key of each prepared shape, by name

    def images(self, pair: Pair) -> tuple[list[IntArray], Replacement]:
        """Map the samples of both shapes of a pair; also return record and digest of its file."""
        maps = self.collection.maps(*pair)
        both = maps.forward, maps.backward
        images = [found.vertices[self._samples(name)] for found, name in zip(both, pair)]
        return images, Replacement(maps.record, digest_of(self.collection.layout.maps(pair)))

    def readings(self, images: IntArray, target: str) -> FloatArray:
        """Compare all maps to a shape with all compositions of two maps that end there."""
        # images (n, n, m): vertex of the second shape for each sample of the first, −1 if not known
        names = list(self.prepared)
        shape, column = self._shape(target), names.index(target)
        readings = np.full((len(names), len(names)), np.nan)
        for b in np.flatnonzero((images[:, column] >= 0).any(axis=1)):
            composed = self._images_of(images[:, b], names[b], target)
            readings[:, b] = _mean_distances(shape, composed, images[:, column])
        return readings

    def repair(self, repair: Repair) -> Replacement | str:
        """Write maps of a pair that agree better and fit as well, or tell why there are none."""
        pair, config = repair.pair, self.collection.config
        old = self.collection.maps(*pair)
        paths, paths_back = (self._compositions(*ends, repair.middles) for ends in (pair, pair[::-1]))
        source, target = map(self._shape, pair)
        samples, samples_back = map(self._samples, pair)
        trust, ends = np.array(repair.trust), paths[:, samples]
        distances = np.array([_mean_distances(target, end[None], ends) for end in ends])
        best = int(np.nan_to_num(distances, nan=1.0).dot(trust).argmin())
        alone = replace(config, hypotheses="given")
        rematched = match_both(source, target, initial_map=paths[best], config=alone, seed=repair.seed)

        def disagreement(forward: IntArray, backward: IntArray) -> float:
            at_target = _mean_distances(target, ends, forward[None, samples])
            at_source = _mean_distances(source, paths_back[:, samples_back], backward[None, samples_back])
            distances, weights = np.concatenate([at_target, at_source]), np.tile(trust, 2)
            finite = np.isfinite(distances)
            return float(np.average(distances[finite], weights=weights[finite])) if finite.any() else np.inf

        before = disagreement(old.forward.vertices, old.backward.vertices)
        after = disagreement(rematched.source_to_target.map.vertices, rematched.target_to_source.map.vertices)
        middle, side = repair.middles[best], WANTED_SIGN[config.orientation]
        refused = ""
        if not after < min(before, MAX_INCONSISTENCY):
            refused = f"agrees no better once refined: {after:.2f} √area"
        elif any(result.outcome is Outcome.PRIORS_CONTRADICTED for result in rematched):
            refused = "changes when it is refined"
        elif any(side * result.quality.orientation < 0 for result in rematched):
            refused = f"does not {config.orientation} the orientation"
        elif (worst := np.nanmax([0.0, *(1 / x.quality.runner_up for x in rematched)])) > config.outcome.tie:
            refused = f"fits worse than another map, by a factor {worst:.2f}"
        if refused:
            return f"the composition over {middle} {refused}"
        note = f"other maps contradict the map that was matched, by {before:.2f} √area; this one is their composition "
        note += f"over {middle}, refined, and its outcome is at most as sure as theirs"
        least = Evidence.of(Outcome[repair.outcomes[best]])
        lowered = ((x, lower_outcome(x.outcome, least)) for x in rematched)
        results = [replace(x, outcome=outcome, notes=(note, *x.notes)) for x, outcome in lowered]
        forward, backward = (MapSummary.of(result, settings=True) for result in results)
        by = pair[0], middle, pair[1]
        record = replace(old.record, forward=forward, backward=backward, memory=peak_memory(), replaced_by=by)
        file = self.collection.layout.maps(pair)
        PairMaps.of(results[0], results[1], record).save(file)
        return Replacement(record, digest_of(file))

    def _images_of(self, vertices: IntArray, source: str, target: str) -> IntArray:
        """Map vertices of one shape to another; −1 stays −1."""
        images = self.collection.maps(source, target).forward.vertices[vertices]
        return np.where(vertices >= 0, images, UNMATCHED)

    def _compositions(self, source: str, target: str, middles: Sequence[str]) -> IntArray:
        """Map the vertices of the source through each of q other shapes, (q, n)."""
        begun = {middle: self.collection.maps(source, middle).forward.vertices for middle in middles}
        return np.array([self._images_of(vertices, middle, target) for middle, vertices in begun.items()])

    def _shape(self, name: str) -> PreparedShape:
        file = self.collection.layout.prepared(self.prepared[name])
        return load_shape(file, self.collection.config)

    def _samples(self, name: str) -> IntArray:
        shape = self._shape(name)
        return np.resize(shape.user_vertex[shape.sample_vertices[:N_SAMPLES]], N_SAMPLES)


def _mean_distances(shape: PreparedShape, first: IntArray, second: IntArray) -> FloatArray:
    """Mean distance (q,) of vertices in rows (q, m), which broadcast; nan where few are matched."""
    both = np.broadcast_arrays(first, second)
    a, b = (np.where(rows >= 0, shape.body_vertex[rows], UNMATCHED) for rows in both)
    matched = (a >= 0) & (b >= 0)
    distances = np.zeros(a.shape)
    distances[matched] = shape.distance(a[matched], b[matched])
    count = matched.sum(axis=1)
    enough = count >= MIN_SHARED * a.shape[1]
    return np.where(enough, distances.sum(axis=1) / np.maximum(count, 1), np.nan)


def inconsistency(readings: FloatArray, prior: FloatArray | None = None) -> FloatArray:
    """Estimate how far each map of a collection is from the right one, (n, n) in √area.

    It is nan for maps in no triangle. Both directions of a pair count together. Maps that are wrong
    in the same way, such as all maps of one mirrored shape, are consistent.
    """
    # readings (n, n, n), at (a, b, c): mean distance, in √(area of c), between the images of
    # samples of a under a → b → c and under a → c; nan where a map is missing.
    # prior (n, n), symmetric: weight of the maps of each pair.
    # A right map disagrees with the composition of two others exactly if one of these is wrong. So we average the
    # disagreements d_abc (readings) of the map a → c over b, weighted by the trust w in the two other maps of each
    # triangle, in rounds of rising β; s_ac is the inconsistency:
    #     s_ac ← Σ_b w_ab w_bc d_abc / Σ_b w_ab w_bc,   w = prior · exp(−β s)
    # This is cycle-edge message passing (Lerman & Shi, Robust Group Synchronization via Cycle-Edge
    # Message Passing, FoCM 2022). O(n³) time and memory.
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
    return np.asarray((inconsistencies + inconsistencies.T) / 2)  # the transpose differs by rounding


def trust_in(inconsistencies: FloatArray, sharpness: float = SHARPNESS[-1]) -> FloatArray:
    """Weight exp(−sharpness × inconsistency) of maps, from 1 down to 0."""
    return np.asarray(np.exp(-sharpness * inconsistencies))


def turned_shapes(orientations: FloatArray) -> IntArray:
    """Find the shapes mirrored against the others, the smaller group of each connected set."""
    links = np.nan_to_num(orientations)  # (n, n): near 1 or −1 for each pair, 0 where it is unclear
    np.fill_diagonal(links, 1.0)
    count, group = connected_components(links != 0, directed=False)
    sides = [_smaller_side(links, np.flatnonzero(group == i)) for i in range(count)]
    return np.sort(np.concatenate(sides))


def _smaller_side(links: FloatArray, members: IntArray) -> IntArray:
    # Links are 1 in each of two groups, −1 between them: the leading eigenvector has one sign in each.
    side = np.linalg.eigh(links[np.ix_(members, members)])[1][:, -1]
    return min(members[side < 0], members[side >= 0], key=len)


def _triangles(readings: FloatArray) -> FloatArray:
    """Mean of the known readings of each triangle, at most six; nan without any, or if a shape occurs twice."""
    permuted = [readings.transpose(order) for order in permutations(range(3))]
    n_measured = sum(np.isfinite(reading).astype(np.int64) for reading in permuted)
    total = sum(np.nan_to_num(reading) for reading in permuted)
    i = np.arange(len(readings))
    mean: FloatArray = np.where(n_measured > 0, total / np.maximum(n_measured, 1), np.nan)
    mean[i, i, :] = mean[i, :, i] = mean[:, i, i] = np.nan
    return mean
