"""How long a match takes, stage by stage, and how much memory, from 5 000 to a million vertices.

    python -m isomatch_lab.studies.performance -o OUT [--data DIR] [--largest N]

matches pairs of creatures with different triangulations, each in a process of its own, and writes ``performance.csv``,
its table ``pairs_table.csv``, and a plot. Up to 60 000 vertices, pyFM matches the same pair in
the same process; with ``--data``, also pairs of FAUST and TOSCA. Rows that are there already are not made again.
"""

from __future__ import annotations

import argparse
import json
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import isomatch
from isomatch import Mesh
from isomatch._core.threads import processors
from isomatch.datasets import example_pair, ground_truth
from isomatch.shapes import prepare
from isomatch_lab.procedural import creature
from isomatch_lab.sets import benchmark_set
from isomatch_lab.sets.shape_set import BenchmarkPair
from isomatch_lab.studies.shared import write_rows, write_table

SIZES = (5000, 28000, 52000, 112000, 200000, 450000, 1000000)  # vertices of creatures; chosen
REAL = {  # set and two shapes of real pairs
    "faust_r": ("faust_r", "tr_reg_002", "tr_reg_012"),
    "cat": ("tosca", "cat0", "cat2"),
    "david": ("tosca", "david0", "david1"),
}
REPEATS = 5  # number of times that a quick match is timed; chosen
QUICK_SECONDS = 6.0  # a match that takes longer is timed three times; chosen
STAGES = ("body", "levels", "distances", "functions", "samples")
LATER_STAGES = ("search", "selection", "refinement", "quality", "polish", "carry")
"""Stages of the preparation of one shape, and of the match."""


def main() -> None:
    """Measure what is missing in OUT, and write the table."""
    asked = _asked_for()
    asked.output.mkdir(parents=True, exist_ok=True)
    names = [*(REAL if asked.data else ()), *(f"creature {n}" for n in SIZES if n <= asked.largest)]
    rows = []
    for name in names:
        path = asked.output / f"{name.replace(' ', '_')}.json"
        if not path.exists():
            command = [
                sys.executable,
                __file__,
                "-o",
                str(asked.output),
                "--one",
                name,
                "--pyfm",
                str(asked.pyfm),
            ]
            subprocess.run([*command, *(("--data", asked.data) if asked.data else ())], check=True)
        rows.append(json.loads(path.read_text(encoding="utf-8")))
        print(_line(rows[-1]), flush=True)
    columns = (
        "pair",
        "vertices",
        "seconds",
        "cpu seconds",
        "further seconds",
        "memory",
        "error",
        "pyfm seconds",
        "pyfm error",
    )
    flat = (row | row["stages"] for row in rows)
    write_rows(asked.output / "performance.csv", (*columns, *STAGES, *LATER_STAGES), flat)
    write_table(asked.output / "pairs_table.csv", pairs_table(rows))
    _plot(rows, asked.output / "performance.svg")


def _asked_for() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for rows and tables")
    parser.add_argument("--data", help="folder of the benchmark sets")
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="vertices of the largest creatures")
    parser.add_argument("--pyfm", type=int, default=60000, help="vertices up to which pyFM is run beside")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        row = measure(asked.one, asked.data, asked.output, asked.pyfm)
        path = asked.output / f"{asked.one.replace(' ', '_')}.json"
        path.write_text(json.dumps(row, indent=1), encoding="utf-8")
        sys.exit()
    return asked


def measure(name: str, data: str | None, output: Path, largest_for_pyfm: int) -> dict[str, Any]:
    """Match one pair, warm, and return a row: seconds in the median, memory, error and stages."""
    pair = _pair(name, data, output)
    small = example_pair()
    isomatch.match(small[0].mesh, small[1].mesh)
    before = _peak()
    seconds, cpu, result = _median(lambda: isomatch.match(pair.source, pair.target))
    row: dict[str, Any] = {
        "pair": name,
        "vertices": pair.source.n_vertices,
        "seconds": seconds,
        "cpu seconds": cpu,
        "memory": _peak(),
        "memory before": before,
        "error": _error(pair, result.map),
        "outcome": result.outcome.name,
    }
    shapes = [prepare(mesh) for mesh in (pair.source, pair.target)]
    stages = {stage: sum(shape.timings[stage] for shape in shapes) for stage in STAGES}
    later = isomatch.match(shapes[0], shapes[1]).timings
    row["further seconds"], row["further cpu seconds"], _ = _median(
        lambda: isomatch.match(shapes[0], shapes[1])
    )
    row["stages"] = stages | {stage: later.get(stage, 0.0) for stage in LATER_STAGES}
    if pair.source.n_vertices <= largest_for_pyfm:
        from isomatch_lab.baselines import pyfm_zoomout

        started = time.perf_counter()
        image = pyfm_zoomout(pair.source, pair.target)
        row |= {"pyfm seconds": time.perf_counter() - started, "pyfm error": _error(pair, image)}
    return row | {"machine": f"{platform.machine()}, {processors()} processors"}


def _pair(name: str, data: str | None, output: Path) -> BenchmarkPair:
    """Read a pair, or make one of creatures, which are kept in a file."""
    if name in REAL:
        kind, *shapes = REAL[name]
        return benchmark_set(kind, data).load(*shapes)
    n = int(name.split()[1])
    path = output / f"{name.replace(' ', '_')}.npz"
    if not path.exists():
        made = [creature(n, pose=side + 1, triangulation=side) for side in range(2)]
        arrays = {
            f"{what}{i}": getattr(m.mesh, what) for i, m in enumerate(made) for what in ("vertices", "faces")
        }
        np.savez(path, image=ground_truth(*made).vertices, **arrays)
    with np.load(path) as file:
        source, target = (Mesh(file[f"vertices{i}"], file[f"faces{i}"]) for i in range(2))
        image = file["image"]
    return BenchmarkPair(name, source, target, np.column_stack([np.arange(len(image)), image]))


def _median(match: Callable[[], Any]) -> tuple[float, float, Any]:
    """Seconds and CPU seconds of a match in the median of some repetitions, and its result."""
    seconds, cpu = list[float](), list[float]()
    while not seconds or len(seconds) < (REPEATS if seconds[0] < QUICK_SECONDS else 3):
        before = time.perf_counter(), time.process_time()
        result = match()
        seconds.append(time.perf_counter() - before[0])
        cpu.append(time.process_time() - before[1])
    return float(np.median(seconds)), float(np.median(cpu)), result


def _error(pair: BenchmarkPair, image: isomatch.Correspondence) -> float:
    """Mean distance in space of images from the truth, × 100 / √(target area)."""
    source_vertices, target_vertices = pair.truth.T
    images = image.pull_back(pair.target.vertices)[source_vertices]
    distances = np.linalg.norm(images - pair.target.vertices[target_vertices], axis=1)
    return float(100 * np.nanmean(distances) / np.sqrt(pair.target.area))


def _peak() -> float:
    """Return the most memory that this process has held, in GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def _line(row: dict[str, Any]) -> str:
    beside = f", pyFM {row['pyfm seconds']:.1f} s, {row['pyfm error']:.2f}" if "pyfm seconds" in row else ""
    return (
        f"{row['pair']:>16}: {row['seconds']:6.2f} s ({row['cpu seconds']:.1f} of CPU), {row['memory']:.2f} GB, "
        f"error {row['error']:.2f}, {row['outcome']}{beside}"
    )


def pairs_table(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Seconds, memory and error of each pair, of pyFM too."""
    table = []
    for row in rows:
        line = {
            "pair": row["pair"],
            "vertices": row["vertices"],
            "seconds": f"{row['seconds']:.2f}",
            "of CPU": f"{row['cpu seconds']:.2f}",
            "a further pair": f"{row['further seconds']:.2f}",
            "memory (GB)": f"{row['memory']:.2f}",
            "error": f"{row['error']:.2f}",
        }
        beside = dict.fromkeys(("pyFM: seconds", "pyFM: error", "ratio"), "")
        if "pyfm seconds" in row:
            numbers = row["pyfm seconds"], row["pyfm error"], row["pyfm seconds"] / row["seconds"]
            beside = dict(zip(beside, "{:.1f} {:.2f} {:.1f}".format(*numbers).split()))
        table.append(line | beside)
    return table


def _plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Plot the seconds of the stages, of whole matches and of pyFM against vertices, both in logarithms."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "performance"
    from matplotlib import pyplot as plt

    made = [row for row in rows if row["pair"].startswith("creature")]
    sizes = [row["vertices"] for row in made]
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    axes.loglog(sizes, [row["seconds"] for row in made], "ko-", lw=2, label="match, whole")
    for stage in (*STAGES, *LATER_STAGES):
        seconds = [row["stages"][stage] or np.nan for row in made]
        axes.loglog(sizes, seconds, ".-" if stage in STAGES else ".--", lw=1, label=stage)
    beside = [row for row in rows if "pyfm seconds" in row]
    axes.loglog(
        [r["vertices"] for r in beside], [r["pyfm seconds"] for r in beside], "r^", label="pyFM, whole"
    )
    axes.set(xlabel="vertices of each shape", ylabel="seconds", ylim=(0.005, 3000))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, ncols=2)
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
