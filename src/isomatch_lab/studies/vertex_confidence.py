"""Does the expected error of a vertex tell where a map is wrong? Plain ingredients, and what the result returns.

    python -m isomatch_lab.studies.vertex_confidence --data DIR -o OUT [SET ...]

writes ``vertex_confidence.csv`` (one row for each map) and ``vertex_confidence_table.csv``. The *capture* of a
measure is the error in the tenth of the vertices trusted least, divided by the error in the tenth that is truly worst:
1 is perfect, and trust at random captures the mean error divided by the mean error of the worst tenth. The settings of
the expected error were chosen on faust_r, creatures and the people of cross; the other sets judge.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.spatial import cKDTree

import isomatch
from isomatch import MatchResult, Mesh
from isomatch.decimation import decimate
from isomatch.evaluation import geodesic_errors
from isomatch_lab.damage import DamageChoice
from isomatch_lab.sets import BenchmarkPair, benchmark_set
from isomatch_lab.studies.shared import (
    damaged_creatures,
    in_parallel,
    parse_arguments,
    write_rows,
    write_table,
)

SEED = 5  # seed of drawn pairs; chosen
N_PAIRS = {"faust_r": 8, "creatures": 8, "tosca_iso_r": 8, "scape": 6, "tosca": 6, "cross": 24, "smal": 8}
# bones and two subjects, of ``knees/BONE.npz`` with an array of vertices for each subject and ``faces``
BONES = (("femur", "S081", "S085"), ("tibia", "S082", "S095"), ("patella", "S084", "S099"))
KEPT_SHARE = 0.7  # share of its vertices that a target bone keeps; chosen
DAMAGES = ("noise", "stretch", "cut", "holes")  # damage to creatures, with four pairs each
N_POINTS = 500  # number of points of the truth that are measured for each pair; chosen
WORST_SHARE = 0.1  # share of the vertices, those with the largest errors, that count as worst; chosen
SMOOTHING_RADIUS = 0.1  # √area: the radius over which the plain ingredients are averaged; chosen
BINS = 5  # number of groups of vertices, by expected error; chosen

Job = tuple[str, str, tuple[str, str]]


def jobs(data: str, kinds: list[str]) -> list[Job]:
    """Draw the pairs of each set; those asked for, or all."""
    drawn = []
    for name in kinds or [*N_PAIRS, "knees", *DAMAGES]:
        if name in N_PAIRS:
            pairs = benchmark_set(name, data).chosen(N_PAIRS[name], SEED).pairs
        elif name == "knees":
            pairs = tuple((f"{bone}_{a}", f"{bone}_{b}") for bone, a, b in BONES)
        else:
            pairs = tuple((name, str(i)) for i in range(4))
        drawn += [(data, name, pair) for pair in pairs]
    return drawn


def measure_job(job: Job) -> dict[str, Any]:
    """Match one pair; capture of each measure, and mean errors, true and expected, in bins of the expected one."""
    data, name, names = job
    if name in N_PAIRS:
        pair = benchmark_set(name, data).load(*names)
    elif name == "knees":
        pair = bones(Path(data) / name, *names)
    elif name in ("cut", "holes"):
        whole = damaged_creatures("none", int(names[1]))
        pair = DamageChoice.parse({"cut": "cut:0.3", "holes": "holes:0.1"}[name])(whole, SEED).given
    else:
        pair = damaged_creatures(name, int(names[1]))
    result = isomatch.match(pair.source, pair.target)
    chosen = np.random.default_rng(1).choice(len(pair.truth), min(N_POINTS, len(pair.truth)), replace=False)
    rows = pair.truth[np.sort(chosen)]
    errors = geodesic_errors(pair.target, result.map, rows)
    finite = np.isfinite(errors)
    rows, errors = rows[finite], errors[finite]
    expected = result.expected_error[rows[:, 0]]
    measures = {"expected error": expected, "random": None, **ingredients(pair.source, pair.target, result)}
    row: dict[str, Any] = {"set": name, "pair": "-".join(names), "outcome": result.outcome.name}
    row |= {"error": errors.mean(), "expected": expected.mean()}
    for measure, values in measures.items():
        if measure == "expected error":
            row[measure] = capture(errors, expected)
        elif values is None:
            row[measure] = errors.mean() / np.sort(errors)[-round(WORST_SHARE * len(errors)) :].mean()
        else:
            row[measure] = capture(errors, values[rows[:, 0]])
    for i, part in enumerate(np.array_split(np.argsort(expected), BINS)):
        row[f"expected {i}"], row[f"error {i}"] = expected[part].mean(), errors[part].mean()
    return row


def bones(folder: Path, source: str, target: str) -> BenchmarkPair:
    """Read a bone of two subjects, such as "femur_S081", the target with fewer vertices."""
    bone, subject = source.split("_")
    with np.load(folder / f"{bone}.npz") as arrays:
        one, other = (Mesh(arrays[name], arrays["faces"]) for name in (subject, target.split("_")[1]))
    coarse = decimate(other, round(KEPT_SHARE * other.n_vertices)).mesh
    nearest = cKDTree(coarse.vertices).query(other.vertices)[1]
    truth = np.column_stack([np.arange(one.n_vertices), nearest])
    return BenchmarkPair(f"{source}-{target}", one, coarse, truth, symmetric=False).relabelled(SEED)


def capture(errors: np.ndarray, measure: np.ndarray) -> float:
    """Error of the tenth that a measure trusts least, divided by the error of the worst tenth."""
    count = round(WORST_SHARE * len(errors))
    return float(errors[np.argsort(-measure, kind="stable")[:count]].sum() / np.sort(errors)[-count:].sum())


def ingredients(source: Mesh, target: Mesh, result: MatchResult) -> dict[str, np.ndarray]:
    """Plain measures (n_source,) of what may be wrong, averaged over the neighbourhood."""
    images = result.map.pull_back(target.vertices)
    back = result.map.reversed().pull_back(source.vertices)
    returned = result.map.pull_back(back)
    i, j = source.edges.T
    ratio = np.linalg.norm(images[i] - images[j], axis=1) / np.maximum(source.edge_lengths, 1e-12)
    ratio /= np.nanmedian(ratio)
    stretch = np.nan_to_num(np.abs(np.log(np.clip(ratio, 0.1, 10))), nan=np.log(10))
    torn = (ratio > 2).astype(float)
    both = np.concatenate([i, j])
    adjacency = csr_array(
        (np.ones(2 * len(i)), (both, np.concatenate([j, i]))), shape=(source.n_vertices,) * 2
    )
    degree = np.maximum(adjacency.sum(axis=1), 1)
    plain = {
        "stretch": np.bincount(both, np.tile(stretch, 2), source.n_vertices) / degree,
        "torn edges": np.bincount(both, np.tile(torn, 2), source.n_vertices) / degree,
        "there and back": np.nan_to_num(
            np.linalg.norm(returned - source.vertices, axis=1), nan=np.nanmax(returned)
        ),
        "gap to the next map": np.zeros(source.n_vertices),
    }
    if result.alternatives:
        other = result.alternatives[0].map.pull_back(target.vertices)
        plain["gap to the next map"] = np.nan_to_num(np.linalg.norm(other - images, axis=1))
    step = diags_array(1 / degree) @ adjacency
    count = int(2 * SMOOTHING_RADIUS**2 * source.area / (source.edge_lengths**2).mean())
    values = np.column_stack(list(plain.values()))
    for _ in range(count):
        values = 0.5 * (values + step @ values)
    return dict(zip(plain, values.T))


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each set the mean capture of each measure, and mean errors, expected and true, × 100."""
    columns = [key for key in rows[0] if key not in ("set", "pair", "outcome")]
    shown = [key for key in columns if key not in ("error", "expected") and key[-1] not in "01234"]
    table = []
    for name in dict.fromkeys(row["set"] for row in rows):
        members = [row for row in rows if row["set"] == name]
        mean = {key: np.mean([row[key] for row in members]) for key in columns}
        bins = (f"{100 * mean[f'expected {i}']:.1f} {100 * mean[f'error {i}']:.1f}" for i in range(BINS))
        line = {"set": name, "pairs": len(members)} | {key: f"{mean[key]:.2f}" for key in shown}
        both = f"{100 * mean['expected']:.1f} {100 * mean['error']:.1f}"
        line |= {"expected and true error": both, "expected and true error of each fifth": ", ".join(bins)}
        table.append(line)
    return table


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "vertex_confidence.csv", [*N_PAIRS, "knees", *DAMAGES])
    results = write_rows(
        asked.output / "vertex_confidence.csv", None, in_parallel(measure_job, jobs(asked.data, asked.kinds))
    )
    write_table(asked.output / "vertex_confidence_table.csv", summary(results))
