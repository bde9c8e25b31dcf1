"""How far one driver of a collection goes: its own code on simulated workers, with recorded durations.

Nothing is matched. The driver plans, sends tiles, takes rows and writes the ledger as ever; workers are simulated in
simulated time, to which the seconds that the driver really needs are added. Run, for instance::

    python benchmarks/collection_scale.py -o OUT --runs 1000:256 10000:256 400:256:all

writes ``scale_table.csv``.
"""

from __future__ import annotations

import argparse
import csv
import heapq
import resource
import tempfile
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from pathlib import Path

import numpy as np

from isomatch.collections import Collection, workers
from isomatch.collections import run as run_module
from studies import write_table

PREPARED_MB, MAP_MB = 9.1, 0.19  # of shapes with 5,000 vertices
FEATURES = 50
RUNS = ("1000:256", "10000:256", "10000:4096", "100000:256", "400:256:all")
ROW = {"there": {"outcome": "CONVERGED", "quality": {"misfit": 0.3}}, "back": {}, "text": "x" * 2500}


class SimulatedWorkers(Executor):
    """Workers that take tasks one after the other, in simulated time."""

    def __init__(self, count: int, seconds: np.ndarray) -> None:
        self.now = self.busy = self.driving = 0.0
        self.free = [0.0] * count
        self.ends: list[tuple[float, int, Future, workers.Task]] = []
        self.seconds = seconds
        self.sent = 0
        self.since = time.perf_counter()

    def submit(self, function, task, *_):
        """Send a task to the worker that is free first."""
        needed = float(self.seconds[self.sent % len(self.seconds) :][: len(task.items)].sum()) or 1.0
        start = max(self._clock(), heapq.heappop(self.free))
        heapq.heappush(self.free, start + needed)
        self.busy += needed
        self.sent += len(task.items)
        future = Future()
        heapq.heappush(self.ends, (start + needed, self.sent, future, task))
        return future

    def wait(self, running, return_when):
        """Go on to the time when the next task ends."""
        end, _, future, task = heapq.heappop(self.ends)
        self.now = max(self._clock(), end)
        future.set_result([task.function(item) for item in task.items])
        self.since = time.perf_counter()
        return argparse.Namespace(done=[future])

    def _clock(self) -> float:
        """Add what the driver has really needed since the last call."""
        needed = time.perf_counter() - self.since
        self.since += needed
        self.driving += needed
        self.now += needed
        return self.now


def prepared(job, entry):
    """Stand for the preparation of a shape."""
    stat = entry.path.stat()
    key = run_module.key_of(job.config, job.seed, entry.name)
    job.layout.prepared(key).touch()
    features = np.random.default_rng(int(entry.name[1:])).normal(size=FEATURES).tolist()
    about = {"size": stat.st_size, "changed": stat.st_mtime_ns, "key": key, "hash": entry.name}
    return {"state": "done", "time": 0.0, "bytes": int(PREPARED_MB * 1e6), "features": features} | about


def matched(job, plan):
    """Stand for the match of a pair."""
    job.layout.maps(plan.pair).touch()
    return {"state": "done", "time": 0.0, "seconds": 1.0, **ROW}


def simulated(n: int, pairs: str, count: int, seconds: np.ndarray, folder: Path) -> dict[str, float]:
    """Run a collection of n shapes on so many workers."""
    run_module.Job.prepare_shape, run_module.Job.match_pair = prepared, matched
    shapes = folder / "shapes"
    shapes.mkdir()
    for i in range(n):
        (shapes / f"s{i:06}.off").touch()
    entries = [shapes / f"s{i:06}.off" for i in range(n)]
    start = time.perf_counter()
    made = Collection.create(folder / "out", entries, pairs=pairs)
    executor = SimulatedWorkers(count, seconds)
    workers.wait = executor.wait
    done = sum(event.what == "pair" for event in made.run(executor, count))
    driver = executor.driving
    start = time.perf_counter()
    assert not list(made.run(executor, count))
    resumed = time.perf_counter() - start
    return {
        "shapes": n,
        "pairs": f"{done:,}, {pairs}",
        "workers": count,
        "hours": round(executor.now / 3600, 2),
        "use": round(executor.busy / (executor.now * count), 3),
        "driver ms/pair": round(1000 * driver / done, 2),
        "resume s": round(resumed, 1),
        "ledger MB": round(made.layout.ledger().stat().st_size / 1e6),
        "driver MB": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }


def main() -> None:
    """Write a row for each run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for scale_table.csv")
    parser.add_argument("--runs", nargs="+", default=RUNS, help="SHAPES:WORKERS, with :all for all pairs")
    parser.add_argument("--table", type=Path, help="pairs.csv of a collection, for its seconds")
    options = parser.parse_args()
    seconds = np.random.default_rng(0).lognormal(np.log(3.2), 0.25, 10**6)
    if options.table:
        with options.table.open(newline="") as file:
            seconds = np.array([float(row["seconds"]) for row in csv.DictReader(file) if row["seconds"]])
    rows = []
    for run in options.runs:
        n, count, pairs = (*run.split(":"), "star")[:3]
        # a process of its own, whose peak of memory is that of the run
        with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(1) as fresh:
            rows.append(fresh.submit(simulated, int(n), pairs, int(count), seconds, Path(folder)).result())
        print(*rows[-1].values(), flush=True)
    options.output.mkdir(parents=True, exist_ok=True)
    write_table(options.output / "scale_table.csv", rows)


if __name__ == "__main__":
    main()
