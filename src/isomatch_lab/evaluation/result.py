"""A benchmark in one call, and its result as a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from isomatch_lab.evaluation.benchmark import rows_of, run_benchmark
from isomatch_lab.evaluation.benchmark_run import BenchmarkRun
from isomatch_lab.evaluation.ledger import Row
from isomatch_lab.evaluation.methods import MapsInFolder, OwnFunction
from isomatch_lab.evaluation.page import told_of_parts
from isomatch_lab.evaluation.tables import summaries, write_tables

COLUMNS = {
    "method": "method", "pairs": "pairs", "mean": "mean error", "median": "median", "max": "worst",
    "error_matched": "where matched", "iou": "IoU", "problems": "problems", "seconds": "seconds",
}  # fmt: skip
"""Columns of the table, by their key in `summaries`, and their titles."""
UNIT_REMARK = "Errors of pairs: geodesic distance × 100 / √(target area)."


@dataclass(frozen=True, eq=False, repr=False)
class BenchmarkResult:
    """What a benchmark found; in a notebook, and printed, the table of its methods.

    Parameters
    ----------
    rows : tuple of dict
        One for each pair and method, with all measures, or with a "problem".
    folder : Path or None
        Where tables and the page ``index.html`` are, if they were written.

    Attributes
    ----------
    summary : tuple of dict
        One for each method, see `summaries`.
    """

    rows: tuple[Row, ...]
    folder: Path | None = None
    summary: tuple[dict[str, Any], ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "summary", tuple(summaries(list(self.rows))))

    @property
    def means(self) -> dict[str, float | None]:
        """Mean error of each method, × 100 / √(target area); None if no pair could be matched and measured."""
        return {line["method"]: line["mean"] for line in self.summary}

    @property
    def problems(self) -> dict[str, str]:
        """What prevented a pair from being matched or measured, by "method, pair"."""
        return {f"{row['method']}, {row['pair']}": row["problem"] for row in self.rows if "problem" in row}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was decided when truth and maps were read."""
        return tuple(dict.fromkeys(row["notes"] for row in self.rows if row.get("notes")))

    def __repr__(self) -> str:
        table = self._table()
        widths = [max(map(len, column)) for column in zip(*table)]
        lines = [
            "  ".join(
                cell.ljust(width) if i == 0 else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(line, widths))
            ).rstrip()
            for line in table
        ]
        return "\n".join([*lines, UNIT_REMARK, *self._remarks()])

    def _repr_html_(self) -> str:
        """Return the table, for notebooks."""
        head, *body = self._table()
        titles = "".join(f"<th>{escape(cell)}</th>" for cell in head)
        lines = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in line)}</tr>" for line in body)
        remarks = "".join(f"<p>{escape(remark)}</p>" for remark in (UNIT_REMARK, *self._remarks()))
        return f"<table><thead><tr>{titles}</tr></thead><tbody>{lines}</tbody></table>{remarks}"

    def _table(self) -> list[list[str]]:
        """Titles and lines of the columns that tell something of some method."""
        summary = told_of_parts(self.summary)
        empty = {"mean": (), "iou": (None,), "error_matched": (None,)}
        shown = [
            key for key in COLUMNS if any(line.get(key) not in empty.get(key, (None, 0)) for line in summary)
        ]
        return [
            [COLUMNS[key] for key in shown],
            *([_cell(line.get(key)) for key in shown] for line in summary),
        ]

    def _remarks(self) -> list[str]:
        problems = [f"{where}: {problem}" for where, problem in self.problems.items()]
        more = [f"… and {len(problems) - 3} more problems"] if len(problems) > 3 else []
        return [*problems[:3], *more, *self.notes[:3]]


def benchmark(
    set_name: str | Path,
    methods: str | Callable[..., Any] | OwnFunction | MapsInFolder | Sequence[Any] = "isomatch",
    out: str | Path | None = None,
    **settings: Any,
) -> BenchmarkResult:
    """Run methods over a benchmark set, and compare their maps with the truth.

    Parameters
    ----------
    set_name : str or path_like
        A folder of shapes with truth, see `own_set`, or the name of a set that `benchmark_set` knows.
    methods : str, callable, OwnFunction, MapsInFolder, or a sequence of these
        What to compare: names such as "isomatch" or "zoomout"; functions of your own, which take two meshes, source and
        target, and return the target vertex of each source vertex, (n_source,) array of int with −1 where unmatched, or a
        `PrecisePoints`, `Correspondence` or `MatchResult`; and `MapsInFolder`, maps that another program wrote.
    out : path_like, optional
        Folder in which rows are kept, so that an interrupted run continues there, and tables, curves and the page
        ``index.html`` are written. By default nothing is kept.
    **settings
        Other fields of `BenchmarkRun`, such as ``n_pairs``, ``n_points``, ``jobs`` and ``damage``.

    Returns
    -------
    BenchmarkResult
        The table of the methods, with ``means``, ``rows`` and ``problems``. A pair on which a method fails is a problem,
        and ends nothing.

    Raises
    ------
    SettingError
        If a set, method or setting is unknown.
    FormatError
        If the set cannot be opened.

    Notes
    -----
    A function is given the target relabelled and rotated, so that equal indices do not help. Functions of a notebook or
    of a script run in this process, one pair at a time; functions of a module that other processes can import
    run ``jobs`` pairs at a time. A function that is handed over is run anew each time.

    Examples
    --------
    >>> def first_vertex(source, target):
    ...     return [0] * source.n_vertices
    >>> result = benchmark("example", first_vertex, n_points=20, distortion=False)
    >>> result.means["first_vertex"] > 50
    True
    """
    several = isinstance(methods, Sequence) and not isinstance(methods, str | MapsInFolder)
    chosen: Any = tuple(methods) if several else (methods,)  # type: ignore[arg-type]
    run = BenchmarkRun(str(set_name), chosen, **settings)
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory()) if out is None else out
        for _ in run_benchmark(run, folder):
            pass
        rows = rows_of(run, folder)
        if out is not None:
            write_tables(out)
    return BenchmarkResult(tuple(rows), None if out is None else Path(out))


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
