"""Where the time of a match goes: the work of each stage, its processor seconds, and the least that the work can take.

    python -m isomatch_lab.studies.budget --data DIR -o OUT [KIND ...]

matches one pair of each kind twice on one thread. The first match counts: each call of a routine of `ROUTINES` adds the
vertices that it visits, its operations and the bytes that it must read, from the sizes that it was called with. The
second match is timed in seconds of the processor, from one message of progress to the next. It writes ``budget.csv``,
one row for each stage and pair, and ``budget_table.csv``, the stages that take most.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeAlias

import numpy as np

from isomatch import MissingFileError, match
from isomatch._core.threads import serial_blas
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import mean_error, parse_arguments, write_rows, write_table

KINDS = {  # set and two shapes of each kind of pair
    "people": ("faust_r", "tr_reg_002", "tr_reg_012"),
    "two species": ("smal", "cow_01", "wolf_02"),
    "fused limbs": ("topkids", "kid01", "kid00"),
    "cuts": ("shrec16_cuts", "cuts_cat_shape_1", "null_cat"),
    "holes": ("shrec16_holes", "holes_cat_shape_1", "null_cat"),
    "two parts": ("shrec16_parts", "cuts_cat_shape_1", "cuts_cat_shape_2"),
}
SHOWN_STAGES = 1  # number of the slowest stages that the table shows for each pair; chosen
# bytes that a front reads when it settles a vertex: about six edges of 12 and six updates of 16
UPDATE_BYTES = 6 * (12 + 16)
ENTRY_BYTES = 12  # bytes of an entry of a sparse factor: a number of 8 and an index of 4
Variables = dict[str, Any]  # local variables of a routine as it returns, by name
Row = dict[str, Any]  # values of a line of the table, by column
Work: TypeAlias = tuple[int, float, float]  # vertices that fronts settle, operations, and bytes to read


def _front(local: Variables) -> Work:
    visits = np.isfinite(local["settled"]).sum()
    return visits, 0.0, UPDATE_BYTES * visits


def _all_against_all(local: Variables) -> Work:
    return 0, 2.0 * len(local["queries"]) * local["candidates"].size, 0.0


def _by_cells(local: Variables) -> Work:
    # each query is compared with all centres, and with the members of one cell at least
    centres = len(local["cells"].centres)
    return 0, 2.0 * local["queries"].size * (centres + len(local["candidates"]) / centres), 0.0


def _precise_points(local: Variables) -> Work:
    return 0, 30.0 * local["queries"].size, 0.0  # six triangles, five operations for each dimension


def _solve(local: Variables) -> Work:
    entries = 2 * len(local["by_row"][2])  # the factor is read by rows and then by columns
    return 0, 2.0 * entries * local["q"], float(ENTRY_BYTES * entries)


def _krylov_space(local: Variables) -> Work:
    # the space has size vectors; those of small meshes come from a dense matrix
    n, size = local["n"], local.get("size", local["n"])
    return 0, 2.0 * n * size * (size + local["k"]), 0.0


def _rigid_step(local: Variables) -> Work:
    # one iteration at least reads each edge from both ends, for three columns
    edges = len(local["self"].neighbours)
    return 0, 6.0 * edges, 16.0 * edges + 8.0 * 12 * len(local["right"])


def _singular_values(local: Variables) -> Work:
    return 0, 12.0 * local["a"].size * min(local["a"].shape[-2:]), 0.0


FRONTS, POINTS, SOLVES, PRODUCTS = "fronts", "nearest points", "sparse solves", "dense products"
NEAREST = "isomatch.correspondence.nearest"  # module with four of the routines
# for the module and the name of a routine: what bounds its calls, and a function from their variables to their work
ROUTINES: dict[tuple[str, str], tuple[str, Callable[[Variables], Work]]] = {
    ("isomatch.geodesics.fast_marching", "_front"): (FRONTS, _front),
    (NEAREST, "nearest_rows"): (POINTS, _all_against_all),
    (NEAREST, "nearest_of_few"): (POINTS, _all_against_all),
    (NEAREST, "nearest_in_cells"): (POINTS, _by_cells),
    (NEAREST, "nearest_points"): (POINTS, _precise_points),
    ("isomatch.spectral.laplacian", "solve"): (SOLVES, _solve),
    ("isomatch.spectral.laplace_basis", "smallest_eigenpairs"): (PRODUCTS, _krylov_space),
    ("isomatch.correspondence.rigid_energy", "solve"): (SOLVES, _rigid_step),
    ("numpy.linalg._linalg", "svd"): (PRODUCTS, _singular_values),
}


class WorkCounter:
    """Count the work of each stage, and the seconds that it takes at least: a function for `sys.setprofile`."""

    def __init__(self) -> None:
        self.stage = ""
        self.work: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self.least: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self._rates = machine_rates()

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        """Look at each Python function that begins or returns."""
        code = frame.f_code
        if event == "call" and code.co_qualname == "StageTimer.reach":
            self.stage = _short(frame.f_locals["what"])
        routine = event == "return" and ROUTINES.get((frame.f_globals.get("__name__", ""), code.co_name))
        if routine:
            bound, count = routine
            visits, operations, read = count(frame.f_locals)
            self.work[self.stage]["visits"] += visits
            self.work[self.stage]["operations"] += operations
            self.least[self.stage][bound] += max(read / self._rates[0], operations / self._rates[1])

    def run(self, function: Callable[[], Any]) -> None:
        """Call a function, counting on this thread and all that it starts."""
        threading.setprofile(self)
        sys.setprofile(self)
        function()
        sys.setprofile(None)
        threading.setprofile(None)


def machine_rates() -> tuple[float, float]:
    """Bytes a second of a copy, and operations a second of a product in single precision, on one thread."""
    large, square = np.ones(2**25), np.ones((1500, 1500), dtype=np.float32)
    copied = min(_seconds_of(large.copy)[0] for _ in range(5))
    multiplied = min(_seconds_of(lambda: square @ square)[0] for _ in range(5))
    return 2 * large.nbytes / copied, 2 * 1500**3 / multiplied


def _seconds_of(run: Callable[[], Any]) -> tuple[float, Any]:
    started = time.process_time()
    result = run()
    return time.process_time() - started, result


def _short(stage: str) -> str:
    return stage.removeprefix("prepare: ").replace("done", "after preparing").rstrip(" 0123456789")


def measure(kind: str, data: str) -> list[Row]:
    """Match the pair of a kind twice, and return a row for each stage."""
    pair = benchmark_set(KINDS[kind][0], data).load(*KINDS[kind][1:])
    counter = WorkCounter()
    counter.run(lambda: match(pair.source, pair.target))
    seconds, before = defaultdict[str, float](float), ("", time.process_time())

    def progress(stage: str, share: float) -> None:
        nonlocal before
        now = time.process_time()
        if before[0]:
            seconds[before[0]] += now - before[1]
        before = _short(stage), now

    spent, result = _seconds_of(lambda: match(pair.source, pair.target, progress=progress))
    rows = []
    for rank, stage in enumerate(sorted(seconds, key=seconds.__getitem__, reverse=True)):
        work, least = {"visits": 0.0, "operations": 0.0} | counter.work[stage], counter.least[stage]
        row: Row = {"kind": kind, "rank": rank, "stage": stage, "seconds": seconds[stage], **work}
        bound = max(least, key=least.__getitem__, default="")
        rows.append(row | {"bound by": bound, "least": sum(least.values())})
    print(f"{kind}: {spent:.2f} s, error {mean_error(pair, result.map):.2f}", flush=True)
    return rows


def shown(row: Row) -> dict[str, str]:
    """Write a row as the page shows it."""
    line = {"pair": row["kind"], "stage": row["stage"]}
    for name, unit in (("visits", 1e6), ("operations", 1e9)):
        line[name] = f"{row[name] / unit:.1f}" if row[name] > unit / 20 else ""
    line |= {"seconds": f"{row['seconds']:.2f}", "bound by": row["bound by"], "least": f"{row['least']:.2f}"}
    return line | {"gap": f"{row['seconds'] / row['least']:.0f}" if row["least"] >= 0.005 else ""}


def main() -> None:
    """Measure the pairs whose sets are there, on one thread."""
    os.environ["ISOMATCH_NUM_THREADS"] = "1"
    asked = parse_arguments(__doc__, "budget.csv", KINDS)
    rows: list[Row] = []
    for kind in asked.kinds or KINDS:
        try:
            with serial_blas():
                rows += measure(kind, asked.data)
        except MissingFileError as error:
            print(f"{kind}: skipped, as {error}", flush=True)
    write_rows(asked.output / "budget.csv", None, rows)
    write_table(asked.output / "budget_table.csv", [shown(row) for row in rows if row["rank"] < SHOWN_STAGES])


if __name__ == "__main__":
    main()
