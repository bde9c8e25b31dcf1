"""Do regions of doubt tell where a map is wrong? Pairs of the sets as they are, and with fused limbs.

    python benchmarks/regions.py --data DIR -o OUT

writes ``regions.csv``, one row for each map, and ``regions_table.csv``. A map is wrong somewhere if more than 2 % of the
true points are farther than 0.15 √area from their images. The bound of the mismatch was chosen on 122 other pairs and
kinds of damage of these sets.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import isomatch
from isomatch import Config, Correspondence
from isomatch.evaluation import counted, geodesic_errors
from isomatch.matching import lowered
from isomatch.matching.verification import region_evidence
from isomatch.settings import OutcomeSettings
from isomatch_lab.damage import damaged_pair
from isomatch_lab.sets import benchmark_set
from studies import SURE, asked_for, in_parallel, write_rows, write_table
from welds import PAIRS, fused_pair

COUNTS = {"faust_r": 24, "tosca_iso_r": 24, "scape": 12, "creatures": 10, "cross": 10}
DAMAGES = ("weld", "stitched", "remesh")
SEED = 77
N_POINTS = 400
FAR, SOMEWHERE = 0.15, 0.02
Job = tuple[str, str, tuple[Any, ...]]


def jobs(data: str) -> Iterator[Job]:
    """Draw pairs of each set, and list those with fused limbs."""
    for name, count in COUNTS.items():
        for pair in benchmark_set(name, data).chosen(count, SEED).pairs:
            yield data, name, pair
    for damage in DAMAGES:
        for given in PAIRS:
            yield data, damage, given


def judged(job: Job) -> dict[str, Any]:
    """Match one pair; outcome without and with the regions, and errors inside and outside of them."""
    data, kind, names = job
    pair = fused_pair(data, kind, *names) if kind in DAMAGES else None
    if pair is None:
        pair = damaged_pair(benchmark_set(kind, data).load(*names))
    found = isomatch.match(
        pair.given.source, pair.given.target, config=Config(outcome=OutcomeSettings(doubtful_area=1.0))
    )
    truth, n_target = pair.whole.truth, pair.whole.target.n_vertices
    rows = np.random.default_rng(SEED).choice(len(truth), min(N_POINTS, len(truth)), replace=False)
    images = [Correspondence(image, n_target) for image in pair.lifted(found.map.vertices)]
    errors = np.min([geodesic_errors(pair.whole.target, image, truth[rows]) for image in images], axis=0)
    errors = counted(errors)
    inside = np.zeros(pair.given.source.n_vertices, dtype=bool)
    for region in found.regions:
        inside[region.vertices] |= region.area > OutcomeSettings().doubtful_area
    doubtful = inside[pair.given.truth[rows, 0]]
    after = lowered(found.outcome, region_evidence(found.regions, OutcomeSettings().doubtful_area))
    return {
        "kind": kind,
        "pair": "-".join(names[:2] if kind not in DAMAGES else names[1:3]),
        "error": 100 * errors.mean(),
        "wrong": (errors > FAR).mean(),
        "before": found.outcome.name,
        "after": after.name,
        "doubtful": doubtful.mean(),
        "inside": 100 * errors[doubtful].mean() if doubtful.any() else np.nan,
        "outside": 100 * errors[~doubtful].mean() if not doubtful.all() else np.nan,
        "regions": "; ".join(map(str, found.regions)),
    }


def table(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """For each kind: right maps flagged, and maps that are wrong somewhere called right, without and with regions."""
    for kind in dict.fromkeys(row["kind"] for row in rows):
        found = [row for row in rows if row["kind"] == kind]
        right, wrong = (
            [row for row in found if (row["wrong"] > SOMEWHERE) is is_wrong] for is_wrong in (False, True)
        )
        flagged = [sum(row[when] not in SURE for row in right) for when in ("before", "after")]
        called_right = [sum(row[when] in SURE for row in wrong) for when in ("before", "after")]
        yield {
            "pairs": kind,
            "right": len(right),
            "flagged before, after": "{}, {}".format(*flagged),
            "wrong somewhere": len(wrong),
            "called right before, after": "{}, {}".format(*called_right),
        }


if __name__ == "__main__":
    asked = asked_for(__doc__, "regions.csv")
    results = write_rows(asked.output / "regions.csv", None, in_parallel(judged, jobs(asked.data)))
    write_table(asked.output / "regions_table.csv", list(table(results)))
