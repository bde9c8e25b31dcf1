"""Do cycles of maps tell wrong from right? Wrong maps put into collections, found and replaced.

    python benchmarks/consistency.py --data DIR -o OUT [SET ...]

writes ``consistency.csv``, one row for each set and share of wrong maps. What is already in ``OUT`` is not computed again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from isomatch import Mesh, write_mesh
from isomatch.collections import Collection
from isomatch.datasets import BenchmarkPair, Creature, creature, ground_truth, remeshed
from studies import asked_for


@dataclass(frozen=True)
class Study:
    """Shapes with the truth between any two of them."""

    names: tuple[str, ...]
    mesh: Callable[[str], Mesh]
    pair: Callable[[str, str], BenchmarkPair]


def studies(data: Path) -> dict[str, Study]:
    """Shapes of each set."""
    people = tuple(f"tr_reg_{i:03}" for i in (0, 1, 3, 4, 10, 11, 13, 14, 20, 21, 23, 24))
    cats = ("cat0", "cat1", "cat2", "cat3", "cat4", "cat5", "cat6", "cat7", "cat8")
    made = tuple(f"biped{i}" for i in range(1, 9))
    remeshed_sets = {
        name: (remeshed(data / name), names) for name, names in (("faust_r", people), ("tosca_iso_r", cats))
    }
    return {
        "creatures": Study(made, lambda name: biped(name).mesh, made_pair),
        **{name: Study(names, found.mesh, found.pair) for name, (found, names) in remeshed_sets.items()},
    }


@cache
def biped(name: str) -> Creature:
    """Make a creature with two legs that is its own mirror image; its number is pose and triangulation."""
    number = int(name.removeprefix("biped"))
    return creature(3000, pose=number, kind="biped", style=1, symmetric=True, triangulation=number)


def made_pair(source: str, target: str) -> BenchmarkPair:
    """Two creatures with their exact truth."""
    import numpy as np

    a, b = biped(source), biped(target)
    truths = [ground_truth(a, b, mirrored=mirrored).vertices for mirrored in (False, True)]
    direct, mirrored = (np.column_stack([np.arange(len(image)), image]) for image in truths)
    return BenchmarkPair(f"{source}-{target}", a.mesh, b.mesh, direct, mirrored)


def matched(study: Study, folder: Path) -> Collection:
    """Match all pairs of a set."""
    shapes = folder / "shapes"
    shapes.mkdir(parents=True, exist_ok=True)
    for name in study.names:
        if not (shapes / f"{name}.ply").exists():
            write_mesh(shapes / f"{name}.ply", study.mesh(name))
    collection = Collection.create(folder / "all", shapes, pairs="all")
    for event in collection.run(jobs=1):
        print(
            folder.name, event.what, event.name, event.done, "of", event.of, event.record["state"], flush=True
        )
    return collection


if __name__ == "__main__":
    asked = asked_for(__doc__, "consistency.csv")
    for name, study in studies(Path(asked.data)).items():
        matched(study, asked.output / name)
