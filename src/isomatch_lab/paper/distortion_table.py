"""The table: mean square distortion of geodesic distances, for each class of TOSCA and each method."""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch import IsomatchError
from isomatch_lab.paper import distortion_bars
from isomatch_lab.paper.benchmark_rows import benchmark_rows
from isomatch_lab.paper.item import Item, Reproduction, Setting, Verdict
from isomatch_lab.sets import BenchmarkSet, benchmark_set

PUBLISHED = {  # distortion of GDD over distortion of the truth in the paper's table
    "horse": 0.845, "victoria": 0.879, "cat": 0.770, "wolf": 0.841, "centaur": 0.799, "david": 0.853,
}  # fmt: skip
SHOWN = tuple(distortion_bars.LABELS)
POST_LIMIT = 1.05  # largest distortion, over the truth's, after the paper's post-processing


def classes_of(chosen: BenchmarkSet, setting: Setting) -> dict[str, list[tuple[str, str]]]:
    """Draw pairs of each class, a sixth of the number asked for; in a quick run, take the set as one class."""
    if setting.quick:
        return {chosen.name: list(chosen.pairs[: setting.n_pairs])}
    count = max(1, setting.n_pairs // len(PUBLISHED))
    drawn = {}
    for name in PUBLISHED:
        pairs = tuple(pair for pair in chosen.pairs if pair[0].rstrip("0123456789") == name)
        if pairs:
            drawn[name] = list(BenchmarkSet(name, pairs, chosen.load).chosen(count, setting.seed).pairs)
    return drawn


def distortions(
    rows: list[dict[str, Any]], classes: dict[str, list[tuple[str, str]]]
) -> list[dict[str, Any]]:
    """Mean distortion of the truth and of each method over the pairs of each class, and their ratios."""
    failed = [row for row in rows if "problem" in row]
    if failed:
        problems = "; ".join(f"{row['method']} on {row['pair']}: {row['problem']}" for row in failed)
        raise IsomatchError(
            f"the distortion table needs a map for every pair and method, but {problems}; remove the cause and run the "
            "table again: all other rows are kept"
        )
    by_pair = {(row["pair"], row["method"]): row for row in rows}
    table = []
    for kind, pairs in classes.items():
        names = ["-".join(pair) for pair in pairs]
        values = {"truth": [by_pair[name, SHOWN[0]]["distortion_table_truth"] for name in names]}
        values |= {method: [by_pair[name, method]["distortion_table"] for name in names] for method in SHOWN}
        mean = {method: float(np.array(of, dtype=float).mean()) for method, of in values.items()}
        ratios = {f"{method}_over_truth": mean[method] / mean["truth"] for method in SHOWN}
        table.append(
            {"class": kind, "pairs": len(pairs)} | mean | ratios | {"paper_gdd": PUBLISHED.get(kind, "")}
        )
    return table


def make(setting: Setting) -> Reproduction:
    """Run all methods on all pairs, and compare the means of classes with the truth."""
    set_name = "example" if setting.quick else "tosca"
    classes = classes_of(benchmark_set(set_name, setting.folder), setting)
    pairs = tuple(pair for drawn in classes.values() for pair in drawn)
    rows = distortions(benchmark_rows(setting, set_name, SHOWN, pairs=pairs, table_distortion=True), classes)
    facts = {
        "points": f"distances from {setting.n_points // 4} of {setting.n_points} random points to all of them",
        "unit": "mean of squared differences of geodesic distances, each shape's divided by its √area",
        "pairs": {kind: ["-".join(names) for names in drawn] for kind, drawn in classes.items()},
    }
    return Reproduction(distortion_bars.draw(rows), rows, verdicts_on(rows), facts)


def verdicts_on(rows: list[dict[str, Any]]) -> list[Verdict]:
    """Compare GDD with the paper's ratio, and post-processing with GDD and the truth."""
    plain, post = (
        {row["class"]: row[f"{method}_over_truth"] for row in rows} for method in ("gdd", "gdd_post")
    )
    listed = [", ".join(f"{kind} {ratio:.3f}" for kind, ratio in ratios.items()) for ratios in (plain, post)]
    paper = ", ".join(f"{row['class']} {row['paper_gdd']}" for row in rows if row["paper_gdd"])
    return [
        Verdict(
            "GDD distorts distances less than the truth itself" + (f"; ratios {paper}" if paper else ""),
            f"GDD / truth: {listed[0]}",
            all(plain[row["class"]] <= (row["paper_gdd"] or 1.0) for row in rows),
        ),
        Verdict(
            f"post-processing lies between GDD and about {POST_LIMIT} × the truth",
            f"post / truth: {listed[1]}",
            all(plain[kind] <= post[kind] <= POST_LIMIT for kind in post),
        ),
    ]


ITEM = Item(
    "the table", "Mean square distortion of geodesic distances, as a share of that of the true map", make
)
