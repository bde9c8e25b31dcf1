"""Do cycles of maps tell wrong from right? Wrong maps put into collections, found and replaced.

    python -m isomatch_lab.studies.consistency --data DIR -o OUT [SET ...]

writes ``consistency.csv``, one row for each set and share of wrong maps, ``consistency_table.csv`` and
``cycles_table.csv``. Wrong maps are, by turns, the best that reverses the orientation and, where an alternative of the
match turns the shape, that one refined. What is already in ``OUT`` is not computed again.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from isomatch import Mesh, Outcome, PreparedShape, match, match_both, write_mesh
from isomatch.cohort import (
    CONTRADICTED,
    Collection,
    MapSummary,
    PairAgreement,
    PairMaps,
    PairRow,
    agree,
    agreement_of,
    inconsistency,
)
from isomatch.datasets import Creature, ground_truth
from isomatch_lab.procedural import creature
from isomatch_lab.sets import BenchmarkPair, relabelled, remeshed, scape
from isomatch_lab.studies.shared import mean_error, parse_arguments, write_rows, write_table

SETS = ("creatures", "faust_r", "scape", "cat", "horse")
MAX_SHAPES = 20
BIPEDS = tuple(f"biped{i}" for i in range(1, 9))
SHARES = (0.0, 0.1, 0.2, 0.3)
FAILURE_ERROR = 10.0  # mean error × 100 / √area
COLUMNS = (
    *("set", "pairs", "share", "wrong", "mirrored", "wrong_sure", "found", "right_flagged", "replaced"),
    *("error_before", "error_after", "failures_before", "failures_after", "sure_failures_before"),
    *("sure_failures_after", "consistency_right", "consistency_wrong"),
)
Pair = tuple[str, str]


@dataclass(frozen=True)
class Study:
    """Shapes with the truth between any two of them."""

    names: tuple[str, ...]
    mesh: Callable[[str], Mesh]
    pair: Callable[[str, str], BenchmarkPair]


def study_of(name: str, data: Path) -> Study:
    """Shapes of a set, or of a class of ``tosca_iso_r``."""
    if name == "creatures":
        return Study(BIPEDS, lambda shape: biped(shape).mesh, made_pair)
    if name == "scape":
        return relabelled_poses(data)
    shapes = remeshed(data / (name if name == "faust_r" else "tosca_iso_r"))
    names = [shape for shape in shapes.names if name == "faust_r" or shape.rstrip("0123456789") == name]
    return Study(tuple(names[:MAX_SHAPES]), shapes.mesh, shapes.pair)


def relabelled_poses(data: Path) -> Study:
    """Poses of one person, which share a triangulation in their files and do not here."""
    shapes = scape(data / "scape")
    names = shapes.names[:MAX_SHAPES]

    @cache
    def made(name: str) -> tuple[Mesh, np.ndarray]:
        return relabelled(shapes.mesh(name), names.index(name))

    def pair(source: str, target: str) -> BenchmarkPair:
        (a, a_new), (b, b_new) = made(source), made(target)
        return BenchmarkPair(f"{source}-{target}", a, b, np.column_stack([a_new, b_new]))

    return Study(names, lambda name: made(name)[0], pair)


@cache
def biped(name: str) -> Creature:
    """Make a creature with two legs that is its own mirror image; its number is pose and triangulation."""
    number = int(name.removeprefix("biped"))
    return creature(3000, pose=number, kind="biped", style=1, symmetric=True, triangulation=number)


def made_pair(source: str, target: str) -> BenchmarkPair:
    """Two creatures with their exact truth."""
    a, b = biped(source), biped(target)
    image = ground_truth(a, b).vertices
    return BenchmarkPair(
        f"{source}-{target}", a.mesh, b.mesh, np.column_stack([np.arange(len(image)), image])
    )


def match_all(study: Study, folder: Path) -> Collection:
    """Match all pairs of a set."""
    shapes = folder / "shapes"
    shapes.mkdir(parents=True, exist_ok=True)
    for name in study.names:
        if not (shapes / f"{name}.ply").exists():
            write_mesh(shapes / f"{name}.ply", study.mesh(name))
    collection = Collection.create(folder / "all", shapes, pairs="all")
    for event in collection.run(jobs=1):
        print(folder.name, event.what, event.name, event.done, "of", event.of, flush=True)
    return collection


def prepare_shape(collection: Collection, name: str) -> PreparedShape:
    """Read a prepared shape."""
    return PreparedShape.load(collection.layout.prepared(collection.rows().shapes[name].key))


def wrong_maps(collection: Collection, pair: Pair, kind: str, file: Path) -> PairMaps:
    """Find the best mirrored maps of a pair, or refine its alternative, if there is one that turns the shape."""
    if file.exists():
        return PairMaps.load(file)
    right = collection.maps(*pair)
    source, target = (prepare_shape(collection, name) for name in pair)
    image, config = None, replace(collection.config, orientation="reverse")
    if kind == "turned":
        turned = [
            alternative.map.vertices
            for alternative in match(source, target).alternatives
            if alternative.orientation > 0
        ]
        image = max(turned, key=lambda other: mean_displacement(target, right, other), default=None)
        if image is not None and mean_displacement(target, right, image) < 1.5 * FAILURE_ERROR / 100:
            image = None
    if image is not None:
        config = replace(collection.config, hypotheses="given")
    kind = "mirrored" if image is None else "turned"
    results = match_both(source, target, initial_map=image, config=config)
    forward, backward = (MapSummary.of(result, settings=True) for result in results)
    record = replace(right.record, there=forward, back=backward, more={"kind": kind})
    maps = PairMaps(results.source_to_target.map, results.target_to_source.map, record)
    file.parent.mkdir(exist_ok=True)
    maps.save(file)
    return maps


def mean_displacement(target: PreparedShape, right: PairMaps, image: np.ndarray) -> float:
    """Mean distance of the images under another map."""
    return target.mean_distance(target.body_vertex[right.there.vertices], target.body_vertex[image])


def with_wrong_maps(base: Collection, share: float, folder: Path) -> tuple[Collection, dict[Pair, str]]:
    """Copy a collection and exchange some of its maps; also tell for which pairs, and of what kind."""
    pairs = sorted(base.rows().pairs)
    order = np.random.default_rng(0).permutation(len(pairs))[: round(share * len(pairs))]
    kinds = {}
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(base.folder, folder, ignore=shutil.ignore_patterns("ledger*"))
    copy = Collection.open(folder)
    for i, row in enumerate(order):
        pair = pairs[row]
        file = base.folder.parent / "wrong" / base.layout.maps(pair).name
        maps = wrong_maps(base, pair, ("mirrored", "turned")[i % 2], file)
        maps.save(copy.layout.maps(pair))
        kinds[pair] = maps.record.more["kind"]
        print(folder.name, pair, kinds[pair], maps.record.there.outcome.name, flush=True)
    list(copy.run(jobs=1))  # rebuild the ledger from the saved maps
    return copy, kinds


def errors_of(study: Study, collection: Collection, kept: dict[str, float]) -> dict[Pair, float]:
    """Mean error of the map of each pair; of maps that were judged before, it is known."""
    errors = {}
    for pair in collection.rows().pairs:
        image = collection.maps(*pair).there
        text = f"{pair} {hash(image.vertices.tobytes())}"
        if text not in kept:
            kept[text] = mean_error(study.pair(*pair), image)
        errors[pair] = kept[text]
    return errors


def measure(name: str, study: Study, folder: Path, share: float, errors: dict[str, float]) -> dict[str, Any]:
    """Errors and outcomes before and after the maps of a collection were brought to agree."""
    file = folder / f"{share}.json"
    if file.exists():
        return dict(json.loads(file.read_text(encoding="utf-8")))
    base = Collection.open(folder / "all")
    copy, kinds = with_wrong_maps(base, share, folder / f"wrong_{share}")
    before, rows_before = errors_of(study, copy, errors), copy.rows().pairs
    for event in agree(copy, jobs=1):
        print(name, share, event.name, event.row, flush=True)
    rows = copy.rows()
    after, pairs = errors_of(study, copy, errors), list(before)
    agreements = {pair: rows.pairs[pair].agreement or PairAgreement() for pair in pairs}
    first = {pair: agreement.before or 0.0 for pair, agreement in agreements.items()}
    flagged = {pair for pair, agreement in agreements.items() if agreement.tried_with is not None}
    flagged |= set(agreement_of(rows).contradicted)
    wrong = {pair for pair in pairs if before[pair] > FAILURE_ERROR}

    def sure(rows: dict[Pair, PairRow], pair: Pair) -> bool:
        return rows[pair].there.outcome in (Outcome.CONVERGED, Outcome.PARTIAL)

    row = {
        "set": name,
        "pairs": len(pairs),
        "share": share,
        "wrong": len(wrong),
        "mirrored": sum(kind == "mirrored" for kind in kinds.values()),
        "wrong_sure": sum(sure(rows_before, pair) for pair in wrong),
        "found": len(flagged & wrong),
        "right_flagged": len(flagged - wrong),
        "replaced": len(agreement_of(rows).replaced),
        "error_before": float(np.mean(list(before.values()))),
        "error_after": float(np.mean(list(after.values()))),
        "failures_before": len(wrong),
        "failures_after": sum(error > FAILURE_ERROR for error in after.values()),
        "sure_failures_before": sum(sure(rows_before, pair) for pair in wrong),
        "sure_failures_after": sum(sure(rows.pairs, pair) for pair in pairs if after[pair] > FAILURE_ERROR),
        "consistency_right": max(first[pair] for pair in pairs if pair not in wrong),
        "consistency_wrong": min((first[pair] for pair in wrong), default=None),
    }
    file.write_text(json.dumps(row), encoding="utf-8")
    return row


def table_row(row: dict[str, Any]) -> dict[str, Any]:
    """Give a row as the page shows it."""
    worst = row["consistency_wrong"]
    return {
        "set": f"{row['set']}, {row['pairs']} pairs",
        "wrong maps, that look sure": f"{row['wrong']}, {row['wrong_sure']}",
        "found": row["found"],
        "right flagged": row["right_flagged"],
        "replaced": row["replaced"],
        "mean error": f"{row['error_before']:.2f} → {row['error_after']:.2f}",
        "failures": f"{row['failures_before']} → {row['failures_after']}",
        "sure failures": f"{row['sure_failures_before']} → {row['sure_failures_after']}",
        "inconsistency of right maps, wrong maps": (
            f"≤ {row['consistency_right']:.3f}, {'–' if worst is None else f'≥ {worst:.2f}'}"
        ),
    }


def limits(n: int, share: float, draws: int = 60) -> tuple[float, float]:
    """Recall and precision among n shapes with one symmetry, where a share of the maps at random is mirrored."""
    rng, pairs = np.random.default_rng(1), np.triu_indices(n, 1)
    hits = wrong_maps = flagged = 0
    # two mirrored maps compose to a right one, so these wrong maps are the hardest to find by cycles alone
    for _ in range(draws):
        drawn = np.triu(rng.random((n, n)) < share, 1)
        wrong = drawn | drawn.T
        contradicts = wrong[:, :, None] ^ wrong[None, :, :] ^ wrong[:, None, :]
        readings = 0.03 * (1 + rng.random((n, n, n))) + 0.4 * contradicts
        against = inconsistency(readings)[pairs] > CONTRADICTED
        hits += (against & wrong[pairs]).sum()
        wrong_maps += wrong[pairs].sum()
        flagged += against.sum()
    return hits / wrong_maps, hits / flagged


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "consistency.csv", SETS)
    cycles = []
    for n in (4, 6, 8, 12, 20):
        cycle_limits = {
            f"{share:.0%} wrong": "{:.2f}, {:.2f}".format(*limits(n, share)) for share in SHARES[1:]
        }
        cycles.append({"shapes": n} | cycle_limits)
    write_table(asked.output / "cycles_table.csv", cycles)
    rows = []
    for name in asked.kinds or SETS:
        study, errors = study_of(name, Path(asked.data)), dict[str, float]()
        match_all(study, asked.output / name)
        rows += [measure(name, study, asked.output / name, share, errors) for share in SHARES]
        print(*rows, sep="\n", flush=True)
    write_rows(asked.output / "consistency.csv", COLUMNS, rows)
    write_table(asked.output / "consistency_table.csv", [table_row(row) for row in rows])
