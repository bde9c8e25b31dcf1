"""Is a map the same on another processor? The same pairs, their coordinates disturbed by far less than any scan knows.

    python -m isomatch_lab.studies.steadiness --data DIR -o OUT

writes ``steadiness.csv``, a row for each match, and ``steadiness_table.csv``: how many outcomes differ from the
undisturbed outcome, and the share of images that lie more than an edge from the undisturbed ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import groupby, product
from typing import Any

import numpy as np
from scipy.sparse import csr_array

import isomatch
from isomatch import Mesh
from isomatch._core.arrays import IntArray
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import Job, draw_jobs, in_parallel, parse_arguments, write_rows, write_table

PAIRS = {  # number of pairs that are drawn from each set
    "example": 1,
    "organs": 1,
    "faust_r": 3,
    "tosca_iso_r": 3,
    "topkids": 1,
    "smal": 1,
    "shrec16_cuts": 1,
    "shrec16_holes": 1,
}
N_DISTURBED = 30  # number of matches of each pair with disturbed coordinates; chosen
MAX_MOVE_RATIO = 1e-9  # largest move of a coordinate over the extent of the shape; chosen


def disturb(mesh: Mesh, seed: int) -> Mesh:
    """Move each coordinate by up to `MAX_MOVE_RATIO`; seed 0 moves nothing."""
    if seed == 0:
        return mesh
    moves = np.random.default_rng(seed).uniform(-1, 1, mesh.vertices.shape)
    return mesh.moved(mesh.vertices + MAX_MOVE_RATIO * np.ptp(mesh.vertices, axis=0).max() * moves)


def match_disturbed(job: tuple[Job, int]) -> tuple[str, IntArray]:
    """Outcome and images of a pair disturbed by a seed."""
    (data, name, names), seed = job
    pair = benchmark_set(name, data).load(*names)
    result = isomatch.match(disturb(pair.source, 2 * seed), disturb(pair.target, 2 * seed + bool(seed)))
    return result.outcome.name, result.map.vertices


def beyond_an_edge(target: Mesh, image: IntArray, other: IntArray) -> float:
    """Share of vertices whose images (n,) and (n,) are neither equal nor joined by an edge."""
    i, j = target.edges.T
    ones = np.ones(2 * len(i), dtype=bool)
    joined = csr_array((ones, (np.append(i, j), np.append(j, i))), shape=(target.n_vertices,) * 2)
    both = (image >= 0) & (other >= 0)
    near = np.asarray(joined[image[both], other[both]]).ravel() | (image[both] == other[both])
    return float((((image >= 0) != (other >= 0)).sum() + (~near).sum()) / len(image))


def measure(jobs: list[tuple[Job, int]]) -> Iterator[dict[str, Any]]:
    """Make a row for each disturbed match."""
    results = zip(jobs, in_parallel(match_disturbed, jobs))
    for (data, name, names), of_pair in groupby(results, lambda result: result[0][0]):
        target = benchmark_set(name, data).load(*names).target
        (_, (outcome, image)), *others = of_pair
        for (_, seed), (found, other) in others:
            moved = beyond_an_edge(target, image, other)
            row = {"set": name, "pair": " ".join(names), "seed": seed, "outcome": found}
            yield {**row, "undisturbed": outcome, "moved": moved}


def main() -> None:
    """Run the study."""
    asked = parse_arguments(__doc__, "the table")
    jobs = list(product(draw_jobs(asked.data, PAIRS, 0), range(1 + N_DISTURBED)))
    rows = write_rows(asked.output / "steadiness.csv", None, measure(jobs))
    table = []
    for pair, of_pair in groupby(rows, lambda row: (row["set"], row["pair"])):
        pair_rows = list(of_pair)
        outcomes, moved = Counter(row["outcome"] for row in pair_rows), [row["moved"] for row in pair_rows]
        table.append(
            {
                "pair": " ".join(pair),
                "outcomes": ", ".join(f"{count} {name}" for name, count in outcomes.most_common()),
                "moved by more than an edge, mean, worst": f"{np.mean(moved):.2%}, {max(moved):.2%}",
            }
        )
    changed = sum(row["outcome"] != row["undisturbed"] for row in rows)
    every = {"pair": "all", "outcomes": f"{changed} of {len(rows)} changed"}
    mean = float(np.mean([row["moved"] for row in rows]))
    write_table(
        asked.output / "steadiness_table.csv",
        [*table, {**every, "moved by more than an edge, mean, worst": f"{mean:.2%}"}],
    )


if __name__ == "__main__":
    main()
