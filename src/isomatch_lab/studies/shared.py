"""What the studies of this folder share: hard pairs, processes, errors and the command line."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from isomatch import Correspondence, Mesh
from isomatch._core.processes import begin_worker, worker_processes
from isomatch._core.threads import n_threads
from isomatch.datasets import ground_truth
from isomatch.evaluation import counted, geodesic_errors
from isomatch_lab.damage import DamagedPair, noise
from isomatch_lab.procedural import creature
from isomatch_lab.sets import BenchmarkPair, benchmark_set, relabelled

T = TypeVar("T")
R = TypeVar("R")


def in_parallel(function: Callable[[T], R], jobs: Iterable[T]) -> Iterator[R]:
    """Give each job to one of as many processes as there are processors, with one thread each; results in order."""
    with worker_processes(n_threads(), begin_worker, (1,)) as pool:
        yield from pool.map(function, jobs)


def mean_error(pair: BenchmarkPair, image: Correspondence, either_side: bool = False) -> float:
    """Mean geodesic error × 100 / √(target area) on 400 truth points; of truth and mirrored truth the better one."""
    truths = [pair.truth] if pair.mirrored is None or not either_side else [pair.truth, pair.mirrored]
    errors = [geodesic_errors(pair.target, image, truth, 400) for truth in truths]
    return float(100 * min(counted(values).mean() for values in errors))


def error_after(damaged: DamagedPair, image: Correspondence) -> float:
    """Mean error × 100 / √area of a map of damaged shapes, on the whole target."""
    target = damaged.whole.target
    lifted = [Correspondence(images, target.n_vertices) for images in damaged.lifted(image.vertices)]
    errors = [geodesic_errors(target, lifted_map, damaged.whole.truth, 400) for lifted_map in lifted]
    return float(100 * counted(np.min(errors, axis=0)).mean())


UNFLAGGED_OUTCOMES = ("CONVERGED", "PARTIAL")  # any other outcome flags a map


Job = tuple[str, str, tuple[str, str]]  # folder of the sets, set, names of the pair
HARD_PAIRS = Path(__file__).with_name("hard_pairs.txt")  # list of pairs on which methods fail often
DAMAGES = ("noise", "decimation", "stretch")  # damage to hard creatures
HARD_CREATURES = 10  # number of pairs of creatures for each kind of damage; chosen


def hard_jobs(data: str) -> list[Job]:
    """List pairs of real shapes that are hard, and creatures in a hard setting."""
    lines = [line.split() for line in HARD_PAIRS.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    real = [(data, name, (source, target)) for name, source, target in lines]
    damaged = [
        (data, "hard creatures", (damage, str(i))) for i in range(HARD_CREATURES) for damage in DAMAGES
    ]
    return [*real, *damaged]


def load_job(job: Job) -> BenchmarkPair:
    """Read or make the pair of a job."""
    data, name, names = job
    if name == "hard creatures":
        return damaged_creatures(names[0], int(names[1]))
    return benchmark_set(name, data).load(*names)


def damaged_creatures(damage: str, seed: int) -> BenchmarkPair:
    """Make two poses of an asymmetric creature of 5000 vertices, the target relabelled and rotated."""
    # "noise": Gaussian, of 0.4 edge lengths, on both. "decimation": the target has 1600 vertices. "stretch": its limbs
    # are longer by up to 45 %, the more the farther from the centre
    style = int(np.random.default_rng(1000 + seed).integers(5))
    sizes = (5000, 1600) if damage == "decimation" else (5000, 5000)
    made = [
        creature(
            size,
            kind=("quadruped", "biped")[seed % 2],
            style=style,
            pose=200 + 2 * seed + side,
            triangulation=300 + 2 * seed + side,
        )
        for side, size in enumerate(sizes)
    ]
    source, target = (shape.mesh for shape in made)
    if damage == "noise":
        share = 0.4 / 3**0.5
        source, target = (noise(shape.mesh, share, seed=2 * seed + i).mesh for i, shape in enumerate(made))
    if damage == "stretch":
        centre = np.average(target.vertices, axis=0, weights=target.vertex_areas)
        radius = np.linalg.norm(target.vertices - centre, axis=1, keepdims=True)
        longer = 1 + 0.45 * (radius / radius.max()) ** 1.5
        target = Mesh(centre + (target.vertices - centre) * longer, target.faces)
    target, new = relabelled(target, seed)
    truth = np.column_stack([np.arange(source.n_vertices), new[ground_truth(*made).vertices]])
    return BenchmarkPair(f"{damage}-{seed}", source, target, truth)


def draw_jobs(data: str, counts: dict[str, int], seed: int) -> list[Job]:
    """Folder, set and names of pairs drawn from some sets."""
    return [
        (data, name, pair)
        for name, count in counts.items()
        for pair in benchmark_set(name, data).chosen(count, seed).pairs
    ]


def write_rows(
    path: Path, columns: Sequence[str] | None, rows: Iterable[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Write some columns of rows as a table, by default all, each row as soon as it comes; and return the rows."""
    written = []
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns or (), extrasaction="ignore")
        if columns:
            writer.writeheader()
        for row in rows:
            if not writer.fieldnames:
                writer.fieldnames = list(row)
                writer.writeheader()
            written.append(row)
            writer.writerow(
                {key: round(value, 4) if isinstance(value, float) else value for key, value in row.items()}
            )
            file.flush()
    return written


def write_table(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a table as a page shows it, and print it; the first row names the columns."""
    write_rows(path, tuple(rows[0]), rows)
    for row in rows:
        print(*row.values(), sep="  ", flush=True)


def parse_arguments(description: str | None, file: str, kinds: Iterable[str] = ()) -> argparse.Namespace:
    """Read ``--data``, ``-o`` and some of the kinds from the command line, and make the folder for the file."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--data", required=True, help="folder of the benchmark sets")
    parser.add_argument("-o", "--output", type=Path, required=True, help=f"folder for {file}")
    if kinds:
        parser.add_argument("kinds", nargs="*", help=f"some of: {', '.join(kinds)}; all by default")
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    return asked
