"""Does the outcome tell wrong maps from right ones? Pairs on which maps do go wrong, judged against the truth.

    python -m isomatch_lab.studies.confidence --data DIR -o OUT

writes ``confidence.csv`` (one row for each map) and ``confidence_table.csv``. A map counts as right below a mean
error of 3, as wrong above 10 (geodesic error × 100 / √area), or if the shapes are of different kinds, so that no map
is right.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from zlib import crc32

import numpy as np

import isomatch
from isomatch import Config
from isomatch.settings import SearchSettings
from isomatch_lab.damage import DamageChoice
from isomatch_lab.sets import BenchmarkPair, benchmark_set
from isomatch_lab.studies.shared import (
    UNFLAGGED_OUTCOMES,
    error_after,
    in_parallel,
    mean_error,
    parse_arguments,
    write_rows,
    write_table,
)

MAX_RIGHT_ERROR, MIN_WRONG_ERROR = 3.0, 10.0  # 100 × mean error / √area of right, and of wrong maps
SEED = 2026  # seed of drawn pairs and of damage; chosen
KINDS = {  # how the maps of each kind are provoked
    "plain": "pairs of the benchmark sets",
    "damaged": "one of the shapes damaged: noise, welded limbs, small holes, uneven sampling, decimation",
    "blind": "hypotheses from four extremities without flips: the right map is often not among them",
    "runner-up": "the best alternative of the match, given as initial map and to be trusted",
    "mirrored": "the mirrored truth, given as initial map and to be trusted",
    "exchanged": "five landmarks at extremities, of which two are exchanged, and to be trusted",
    "other kind": "a quadruped and a biped, a cat and a horse, …: no map is right",
    "either side": "a symmetric creature with orientation = 'any': its mirror image fits as well",
}

EVIDENCE = (  # measures of `Quality` that are compared with errors
    "spectral_residual",
    "runner_up",
    "mirrored",
    "residual",
    "stretch",
    "orientation",
    "distortion_p95",
)
# kinds and amounts of damage; the name of a shape decides which one it gets
DAMAGE = ("noise:0.3", "noise:0.6", "weld:0.02", "holes:0.1", "decimate:0.25", "resample:4", "resample:16")
Job = tuple[str, str, str, tuple[str, str]]  # folder of the sets, kind, set, pair


def jobs(data: str) -> Iterator[Job]:
    """Draw the pairs of each kind."""
    for name, counts in (
        ("faust_r", (12, 18, 10, 16, 16, 16)),
        ("tosca_iso_r", (16, 24, 10, 20, 16, 20)),
        ("scape", (6, 4, 0, 4, 0, 4)),
        ("creatures", (8, 24, 10, 12, 0, 14)),
    ):
        for kind, count in zip(("plain", "damaged", "blind", "runner-up", "mirrored", "exchanged"), counts):
            pairs = benchmark_set(name, data).chosen(count, SEED).pairs if count else []
            for pair in (
                pairs if name != "creatures" else [creature_names(i, "asymmetric") for i in range(count)]
            ):
                yield data, kind, name, pair
    rng = np.random.default_rng(SEED)
    shapes = sorted({shape for pair in benchmark_set("tosca_iso_r", data).pairs for shape in pair})
    other = 0
    while other < 24:
        a, b = (str(shape) for shape in rng.choice(shapes, 2))
        classes = {shape.rstrip("0123456789") for shape in (a, b)}
        if len(classes) == 2 and classes != {
            "david",
            "victoria",
        }:  # two humans are left out, as they have a right map
            other += 1
            yield data, "other kind", "tosca_iso_r", (a, b)
    for i in range(8):
        names = [f"{kind}_asymmetric_{i}_{i}_4000" for kind in ("quadruped", "biped")]
        yield data, "other kind", "creatures", (names[0], names[1])
        yield data, "mirrored", "creatures", creature_names(i, "symmetric")
        yield data, "either side", "creatures", creature_names(i, "symmetric")


def creature_names(style: int, symmetry: str) -> tuple[str, str]:
    """Two poses of a creature, in different triangulations."""
    kind = ("quadruped", "biped")[style % 2]
    names = [f"{kind}_{symmetry}_{style}_{pose}_{n}" for pose, n in ((style, 4000), (style + 9, 5000))]
    return names[0], names[1]


def measure_job(job: Job) -> dict[str, Any]:
    """Match one pair and judge the map."""
    data, kind, name, (a, b) = job
    whole = load_pair(data, kind, name, a, b)
    row: dict[str, Any] = {"kind": kind, "set": name, "pair": f"{a}-{b}"}
    damaged = None
    if kind == "damaged":
        choice = DamageChoice.parse(DAMAGE[crc32(whole.name.encode()) % len(DAMAGE)])
        try:
            damaged = choice(whole, SEED)
        except isomatch.MeshError:  # limbs do not touch, so nothing can be welded
            choice = DamageChoice.parse("noise:0.6@both")
            damaged = choice(whole, SEED)
        row["kind"] = f"damaged, {choice.name}"
    pair = damaged.given if damaged else whole
    try:
        result = isomatch.match(pair.source, pair.target, **provoke_maps(kind, pair))
    except isomatch.IsomatchError as problem:
        return row | {"outcome": type(problem).__name__, "error": None}
    error = None
    if damaged:
        error = error_after(damaged, result.map)
    elif len(whole.truth):
        error = mean_error(whole, result.map, kind == "either side")
    row |= {"outcome": result.outcome.name, "error": error}
    return row | {key: result.to_dict()["quality"][key] for key in EVIDENCE}


def load_pair(data: str, kind: str, name: str, a: str, b: str) -> BenchmarkPair:
    """Load a pair; of shapes of different kinds without any truth."""
    shapes = benchmark_set(name, data)
    if kind != "other kind":
        return shapes.load(a, b)
    source, target = shapes.load(a, a).source, shapes.load(b, b).target
    return BenchmarkPair(f"{a}-{b}", source, target, np.zeros((0, 2), int))


def provoke_maps(kind: str, pair: BenchmarkPair) -> dict[str, Any]:
    """Options of `match` that make a wrong map likely."""
    trusted = Config(hypotheses="given")
    if kind == "mirrored":
        assert pair.mirrored is not None
        image = np.full(pair.source.n_vertices, -1)
        image[pair.mirrored[:, 0]] = pair.mirrored[:, 1]
        return {"initial_map": image, "config": trusted}
    if kind == "runner-up":
        others = isomatch.match(pair.source, pair.target).alternatives
        return {"initial_map": others[0].map, "config": trusted} if others else {}
    if kind == "exchanged":
        rows = [
            np.flatnonzero(pair.truth[:, 0] == v) for v in isomatch.prepare(pair.source).column_vertices[:9]
        ]
        landmarks = pair.truth[[row[0] for row in rows if len(row)][:5]]
        landmarks[:2, 1] = landmarks[[1, 0], 1]
        return {"landmarks": landmarks, "config": trusted}
    if kind == "either side":
        return {"config": Config(orientation="any")}
    if kind == "blind":
        return {"config": Config(search=SearchSettings(extremity_counts=(4,), flipped=0))}
    return {}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each kind and in all: how many right maps are flagged, how many wrong ones are not."""
    table = []
    # a right map reported to contradict the landmarks is left out: two landmarks were exchanged
    judged = [row for row in rows if row["kind"] != "either side"]
    groups = {kind: [row for row in rows if row["kind"].startswith(kind)] for kind in KINDS}
    groups |= {
        "undamaged": [row for row in judged if not row["kind"].startswith("damaged")],
        "all but either side": judged,
    }
    for kind, chosen in groups.items():
        error = {id(row): np.inf if row["kind"] == "other kind" else row["error"] for row in chosen}
        measured = [row for row in chosen if error[id(row)] is not None]
        right = [
            r for r in measured if error[id(r)] < MAX_RIGHT_ERROR and r["outcome"] != "PRIORS_CONTRADICTED"
        ]
        poor = [r for r in measured if MAX_RIGHT_ERROR <= error[id(r)] <= MIN_WRONG_ERROR]
        wrong = [r for r in measured if error[id(r)] > MIN_WRONG_ERROR]
        line: dict[str, Any] = {"kind": KINDS.get(kind, kind), "maps": len(chosen)}
        for name, members in (("right", right), ("poor", poor), ("wrong", wrong)):
            flagged = sum(row["outcome"] not in UNFLAGGED_OUTCOMES for row in members)
            line[f"{name}, of them flagged"] = f"{len(members)}, {flagged}"
        table.append(line | {"ambiguous": sum(r["outcome"] == "SYMMETRY_AMBIGUOUS" for r in chosen)})
    return table


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "confidence.csv")
    results = write_rows(
        asked.output / "confidence.csv",
        ("kind", "set", "pair", "error", "outcome", *EVIDENCE),
        in_parallel(measure_job, jobs(asked.data)),
    )
    write_table(asked.output / "confidence_table.csv", summary(results))
