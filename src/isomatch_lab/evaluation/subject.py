"""The subject of a row: a pair made ready for methods, whose distances are computed once."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.cached import cached_method
from isomatch._core.memory import memory_budget
from isomatch._core.threads import n_threads, parallel_map, serial_blas
from isomatch.correspondence import Correspondence
from isomatch.evaluation import (
    TABLE_THRESHOLDS,
    area_under_curve,
    counted,
    coverage,
    cumulative_curve,
    cycle_errors,
    sided_errors,
    smallest,
)
from isomatch.geodesics import DistanceEngine, distance_engine, pair_distances
from isomatch.settings import Config
from isomatch.shapes import prepare
from isomatch_lab.evaluation.benchmark_run import BenchmarkRun, PairNames
from isomatch_lab.evaluation.distortion import metric_distortion
from isomatch_lab.evaluation.ledger import Row
from isomatch_lab.evaluation.methods import MatchInput, Method
from isomatch_lab.evaluation.smoothness import dirichlet_energy
from isomatch_lab.evaluation.true_landmarks import true_landmarks

DISTORTION_ROWS = 100  # number of points whose distances to 1000 others are compared for each pair; chosen
TABLE_DIVISOR = 4  # points for each row of the table; the distances of a row are slow on large meshes; chosen


@dataclass(frozen=True)
class Answer:
    """The map that a method found, and its cost."""

    map: Correspondence
    diagnostics: dict[str, Any]  # what the method reports about the map
    seconds: float  # without preparation; includes the map it was started from
    preparations: frozenset[Config | None]  # settings of the prepared shapes that were used


class Subject:
    """A pair of a benchmark run, with the engines, landmarks and prepared shapes that its methods share."""

    def __init__(self, run: BenchmarkRun, names: PairNames) -> None:
        self._run, self._names = run, names
        self._dense, self._judged = run.load(names)
        self.pair = self._dense.given
        limit = memory_budget() / (8 * (run.jobs or n_threads()))
        # a shape that is not damaged is its own whole, and has one engine
        engine = cache(lambda mesh: CachingEngine(distance_engine(mesh), limit))
        self._engines, self._whole_engines = (
            (engine(shapes.source), engine(shapes.target)) for shapes in (self.pair, self._dense.whole)
        )

    @cached_method
    def _prepared(self, config: Config | None) -> tuple[tuple[MatchInput, MatchInput], float]:
        """Prepare both shapes, or take the meshes themselves; also give the seconds."""
        meshes = self.pair.source, self.pair.target
        if config is None:
            return meshes, 0.0
        started = time.perf_counter()
        with serial_blas():
            source, target = parallel_map(lambda mesh: prepare(mesh, config), meshes)
        return (source, target), time.perf_counter() - started

    @cached_method
    def _landmarks(self, count: int) -> IntArray:
        """Choose true landmarks (count, 2)."""
        return true_landmarks(self.pair, count, self._run.seed, self._engines)

    def match(self, method: Method, start: Answer | None = None, backwards: bool = False) -> Answer:
        """Match source to target, or backwards, from another map or from true landmarks if the method needs them."""
        (source, target), _ = self._prepared(method.preparation)
        priors: dict[str, Any] = {} if start is None else {"initial_map": start.map.vertices}
        if method.reads_maps:
            priors["pair"] = self._run.named(self._names, self._dense)
        if method.n_landmarks:
            priors["landmarks"] = self._landmarks(method.n_landmarks)[:, :: -1 if backwards else 1]
        started = time.perf_counter()
        if backwards:
            source, target = target, source
        try:
            image, diagnostics = method(source, target, priors)
        except Exception as problem:
            if backwards:
                problem.add_note("(target to source, for the cycle error)")
            raise
        seconds, preparations = time.perf_counter() - started, frozenset([method.preparation])
        if start is not None:
            seconds, preparations = seconds + start.seconds, preparations | start.preparations
        return Answer(image, diagnostics, seconds, preparations)

    def measures(self, answer: Answer, back: Answer | None = None) -> Row:
        """Measure a map, and its cycle error with a map back; the seconds count each preparation once."""
        run, pair = self._run, self.pair
        numbers = {
            "image_area": coverage(pair.target, answer.map, reach=0.0),
            "smoothness": dirichlet_energy(pair.source, pair.target, answer.map),
        }
        if run.distortion:
            numbers |= self._distortion("distortion_l2", answer.map, n_rows=DISTORTION_ROWS)
        if run.table_distortion:
            n_points = min(run.n_points, len(pair.truth))
            draw = {"n_rows": n_points // TABLE_DIVISOR, "n_columns": n_points, "same_points": True}
            numbers |= self._distortion("distortion_table", answer.map, **draw)
        if back is not None:
            cycle = cycle_errors(pair.source, answer.map, back.map, run.n_points, run.seed, self._engines[0])
            numbers["cycle"] = 100 * counted(cycle).mean()
        return {
            "n_source": pair.source.n_vertices,
            "n_target": pair.target.n_vertices,
            "seconds": answer.seconds + sum(self._prepared(config)[1] for config in answer.preparations),
            "group": pair.group,
            "outcome": answer.diagnostics.get("outcome", ""),
            "notes": "; ".join(filter(None, (*pair.notes, answer.diagnostics.get("read")))),
            "details": answer.diagnostics,
            **self._errors(answer.map),
            **_plain(numbers | self._matched(answer.map)),
        }

    def _errors(self, image: Correspondence) -> Row:
        """Errors × 100 on the whole target, and their curves; a vertex without an image counts as √(target area)."""
        run, judged = self._run, self._judged.whole
        n_points = run.n_points if run.landmarks is None else None
        # for truly symmetric shapes, the whole pair is judged by either the direct or the mirrored truth
        sides = smallest(
            sided_errors(
                judged.target,
                lift,
                judged.truth,
                judged.mirrored,
                n_points,
                run.seed,
                self._whole_engines[1],
                points=judged.points,
                unit=judged.unit,
            )
            for lift in self._lifted(image)
        )
        direct, better = counted(sides.direct), counted(sides.better)
        errors = better if judged.symmetric else direct
        numbers = {
            "error": 100 * errors.mean(),
            "median": 100 * np.median(errors),
            "p95": 100 * np.quantile(errors, 0.95),
            "direct": 100 * direct.mean(),
            "mirrored": np.nan if sides.mirrored is None else 100 * counted(sides.mirrored).mean(),
            "either": 100 * better.mean(),
            "unmatched": np.isinf(sides.direct).mean(),
            "auc": area_under_curve(errors),
        }
        if self.pair.alone is not None and np.isfinite(sides.direct).any():
            numbers["error_matched"] = 100 * errors[np.isfinite(sides.direct)].mean()
        for threshold, share in zip(TABLE_THRESHOLDS, cumulative_curve(errors, TABLE_THRESHOLDS)):
            numbers[f"within_{100 * threshold:02.0f}"] = share
        curves = {"curve": direct, "curve_either": better}
        return _plain(numbers) | {
            name: [round(float(share), 4) for share in cumulative_curve(values)]
            for name, values in curves.items()
        }

    def _matched(self, image: Correspondence) -> dict[str, float]:
        """Precision, recall and overlap of the matched vertices, where it is known which have a counterpart."""
        has, alone = np.unique(self.pair.truth[:, 0]), self.pair.alone
        if alone is None:
            return {}
        areas = self.pair.source.vertex_areas
        # overlap: area with a counterpart and an image, divided by area with either
        right, wrong = has[image.matched[has]], alone[image.matched[alone]]
        either = areas[has].sum() + areas[wrong].sum()
        return {
            "precision": len(right) / max(len(right) + len(wrong), 1),
            "recall": len(right) / len(has),
            "iou": areas[right].sum() / either if either > 0 else np.nan,
        }

    def _lifted(self, image: Correspondence) -> list[Correspondence]:
        """Carry a map between the damaged shapes to the whole ones."""
        n_target = self._dense.whole.target.n_vertices
        return [Correspondence(images, n_target) for images in self._dense.lifted(image.vertices)]

    def _distortion(self, name: str, image: Correspondence, **draw: Any) -> dict[str, float]:
        """Mean square distortion of a map and of the truth, over random points of the whole shapes."""
        whole = self._dense.whole
        distortion = metric_distortion(
            whole.source,
            whole.target,
            self._lifted(image)[0],
            whole.truth,
            seed=self._run.seed,
            engines=self._whole_engines,
            unit=whole.unit,
            **draw,
        )
        return {name: distortion.l2, f"{name}_truth": distortion.truth.l2 if distortion.truth else np.nan}


def _plain(numbers: Mapping[str, Any]) -> Row:
    """Turn numbers into JSON numbers, with None in place of numbers that are not finite."""
    return {name: float(number) if np.isfinite(number) else None for name, number in numbers.items()}


class CachingEngine:
    """A distance engine that keeps the columns it has computed.

    Parameters
    ----------
    engine : DistanceEngine
        Computes the columns.
    limit : float
        Bytes of columns to keep at most; further columns are computed each time.
    """

    def __init__(self, engine: DistanceEngine, limit: float) -> None:
        self.name, self.n_points = engine.name, engine.n_points
        self._engine = engine
        self._most = int(limit / (8 * max(self.n_points, 1)))
        self._kept: dict[int, FloatArray] = {}

    def distances_from(self, sources: IntArray) -> FloatArray:
        """(m, n) distances from each of m sources; the caller may change the array."""
        wanted = np.asarray(sources).tolist()
        new = [vertex for vertex in dict.fromkeys(wanted) if vertex not in self._kept]
        computed = dict(zip(new, self._engine.distances_from(np.array(new)))) if new else {}
        columns = [self._kept.get(vertex, computed.get(vertex)) for vertex in wanted]
        for vertex in new[: self._most - len(self._kept)]:
            self._kept[vertex] = computed[vertex].copy()
        return np.array(columns, dtype=np.float64).reshape(len(wanted), self.n_points)

    def pair_distances(self, pairs: IntArray) -> FloatArray:
        """Distances (m,) of m pairs, as the engine finds them; nothing is kept."""
        return pair_distances(self._engine, pairs)

    def lower(self, nearest: FloatArray, source: int) -> FloatArray | None:
        """Lower ``nearest`` as the engine does; nothing is kept."""
        return self._engine.lower(nearest, source)
