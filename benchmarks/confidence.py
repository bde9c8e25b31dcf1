"""Does the outcome tell wrong maps from right ones? Pairs on which maps do go wrong, judged against the truth.

    python benchmarks/confidence.py --data DIR -o OUT

writes ``confidence.csv`` (one row for each map) and prints a table. A map counts as right below a mean error of 3, as
wrong above 10 (geodesic error × 100 / √area), or if the shapes are of different kinds, so that no map is right.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

import isomatch
from isomatch import Config
from isomatch.datasets import BenchmarkPair, benchmark_set, noise
from isomatch.matching import SearchSettings
from studies import asked_for, in_parallel, mean_error

RIGHT, WRONG = 3.0, 10.0
SEED = 2026
KINDS = {  # how the maps of each kind are provoked
    "plain": "pairs of the benchmark sets",
    "weakened": "hypotheses from four extremities and flips of one map only",
    "blind": "the same without flips: the right map is often not among the hypotheses",
    "noise": "Gaussian noise of 0.35 and of 0.6 edge lengths on both shapes",
    "other kind": "a quadruped and a biped, a cat and a horse, …: no map is right",
    "given mirror": "a symmetric creature with its mirror image given as initial map, and to be trusted",
    "either side": "a symmetric creature with orientation = 'any': its mirror image fits as well",
}

EVIDENCE = ("misfit", "rival", "mirrored", "residual", "stretch", "orientation", "distortion_p95")
Job = tuple[str, str, str, tuple[str, str]]  # folder of the sets, kind, set, pair


def jobs(data: str) -> Iterator[Job]:
    """Draw the pairs of each kind."""
    for name, plain, weakened, noisy in (
        ("faust_r", 12, 16, 6), ("tosca_iso_r", 16, 24, 6), ("scape", 8, 12, 0), ("creatures", 8, 12, 8)
    ):  # fmt: skip
        for kind, count in (("plain", plain), ("weakened", weakened), ("blind", weakened), ("noise", noisy)):
            if count:
                for pair in benchmark_set(name, data).chosen(count, SEED).pairs:
                    yield data, kind, name, pair
    rng = np.random.default_rng(SEED)
    shapes = sorted({shape for pair in benchmark_set("tosca_iso_r", data).pairs for shape in pair})
    other = 0
    while other < 16:
        a, b = (str(shape) for shape in rng.choice(shapes, 2))
        classes = {shape.rstrip("0123456789") for shape in (a, b)}
        if len(classes) == 2 and classes != {"david", "victoria"}:  # two humans are near-isometric
            other += 1
            yield data, "other kind", "tosca_iso_r", (a, b)
    for i in range(8):
        yield (
            data,
            "other kind",
            "creatures",
            (f"quadruped_asymmetric_{i}_{i}_5000", f"biped_asymmetric_{i}_{i}_5000"),
        )
        pair = tuple(
            f"{('quadruped', 'biped')[i % 2]}_symmetric_{i}_{pose}_{size}"
            for pose, size in ((i, 5000), (i + 9, 7000))
        )
        yield data, "given mirror", "creatures", pair
        yield data, "either side", "creatures", pair


def judged(job: Job) -> dict[str, Any]:
    """Match one pair and judge the map."""
    data, kind, name, (a, b) = job
    known = benchmark_set(name, data)
    row: dict[str, Any] = {"kind": kind, "set": name, "pair": f"{a}-{b}"}
    if kind == "other kind":
        pair = BenchmarkPair(
            f"{a}-{b}", known.load(a, a).source, known.load(b, b).target, np.zeros((0, 2), int)
        )
    else:
        pair = known.load(a, b)
    source, target = pair.source, pair.target
    if kind == "noise":
        share = (0.35, 0.6)[crc32(pair.name.encode()) % 2]
        source, target = (
            noise(mesh, share, seed=SEED + side).mesh for side, mesh in enumerate((source, target))
        )
    options: dict[str, Any] = {}
    if kind == "given mirror":
        assert pair.mirrored is not None
        options = {"initial_map": pair.mirrored[:, 1], "config": Config(hypotheses="given")}
    elif kind == "either side":
        options = {"config": Config(orientation="any")}
    if kind in ("weakened", "blind"):
        search = SearchSettings(extremity_counts=(4,), flipped=int(kind == "weakened"))
        options = {"config": Config(search=search)}
    try:
        found = isomatch.match(source, target, **options)
    except isomatch.IsomatchError as error:
        return row | {"outcome": type(error).__name__, "error": None}
    error = mean_error(pair, found.map, kind == "either side") if len(pair.truth) else None
    row |= {"outcome": found.outcome.name, "error": error}
    return row | {key: found.to_dict()["quality"][key] for key in EVIDENCE}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each kind and in all: how many right maps are flagged, how many wrong ones are not."""
    table = []
    for kind in (*KINDS, "all but either side"):
        chosen = [
            row for row in rows if row["kind"] == kind or (kind not in KINDS and row["kind"] != "either side")
        ]
        wrong = [
            r for r in chosen if r["kind"] == "other kind" or (r["error"] is not None and r["error"] > WRONG)
        ]
        right = [r for r in chosen if r["error"] is not None and r["error"] < RIGHT]
        table.append(
            {
                "kind": kind,
                "maps": len(chosen),
                "right": len(right),
                "right_flagged": sum(r["outcome"] != "CONVERGED" for r in right),
                "wrong": len(wrong),
                "wrong_flagged": sum(r["outcome"] != "CONVERGED" for r in wrong),
                "ambiguous": sum(r["outcome"] == "SYMMETRY_AMBIGUOUS" for r in chosen),
            }
        )
    return table


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ("kind", "set", "pair", "error", "outcome", *EVIDENCE))
        writer.writeheader()
        writer.writerows(
            {key: round(value, 4) if isinstance(value, float) else value for key, value in row.items()}
            for row in rows
        )


if __name__ == "__main__":
    asked = asked_for(__doc__, "confidence.csv")
    results = list(in_parallel(judged, jobs(asked.data)))
    _write(asked.output / "confidence.csv", results)
    for line in summary(results):
        print("  ".join(f"{key} {value}" for key, value in line.items()))
