"""Princeton curves of several methods on several sets: run what is missing, gather, draw, compare."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from isomatch._arrays import FloatArray
from isomatch.datasets.benchmarks import benchmark_set
from isomatch.evaluation import BenchmarkRun, read_rows, run_benchmark
from isomatch.evaluation.princeton import LIMIT, THRESHOLDS
from isomatch.paper.item import Setting

SETS = ("tosca", "scape")
NOTHING = np.zeros(len(THRESHOLDS))
Curves = dict[tuple[str, str], FloatArray]
"""Mean curve of each set and method: share of correspondences within each threshold."""


def sets_of(setting: Setting) -> tuple[str, ...]:
    """Name the sets that are run."""
    return ("example",) if setting.quick else SETS


def measured(setting: Setting, methods: tuple[str, ...]) -> tuple[Curves, dict[str, Any]]:
    """Run what is not yet in the folder of runs; give the mean curves, and what they are means of.

    Raises
    ------
    FormatError
        If a set is not in the folder of the data.
    """
    curves: Curves = {}
    facts: dict[str, Any] = {"points": setting.n_points, "pairs": {}, "without a map": {}}
    for name in sets_of(setting):
        chosen = benchmark_set(name, setting.folder).chosen(setting.n_pairs, setting.seed)
        pairs = ["-".join(pair) for pair in chosen.pairs]
        run = BenchmarkRun(
            name, methods, setting.folder, setting.n_pairs, setting.n_points, setting.seed, setting.jobs
        )
        for count, row in enumerate(run_benchmark(run, setting.runs), 1):
            setting.progress(f"{name}: {count} rows, last {row['pair']} by {row['method']}")
        rows = [row for row in read_rows(setting.runs) if row["set"] == name and row["pair"] in pairs]
        facts["pairs"][name] = pairs
        for method in methods:
            found = [row for row in rows if row["method"] == method and "curve" in row]
            lost = len(pairs) - len(found)
            if lost:
                facts["without a map"][f"{name}, {method}"] = lost
            # a pair without a map has no correspondence within any error
            curves[name, method] = sum((np.array(row["curve"]) for row in found), NOTHING) / len(pairs)
    return curves, facts


def draw(curves: Curves, styles: Mapping[str, tuple[str, dict[str, Any]]], facts: dict[str, Any]) -> Figure:
    """One panel a set; ``styles`` has label and line style of each method."""
    names = list(dict.fromkeys(name for name, _ in curves))
    figure = Figure((4.4 * len(names) + 0.4, 4.2), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names):
        for method, (label, style) in styles.items():
            axes.plot(THRESHOLDS, 100 * curves[name, method], label=label, **style)
        axes.set(
            title=f"{name.upper() if name in SETS else name}, {len(facts['pairs'][name])} pair"
            + "s" * (len(facts["pairs"][name]) > 1),
            xlabel="geodesic error / √(target area)",
            ylabel="correspondences within the error, %",
            xlim=(0, LIMIT),
            ylim=(0, 101),
        )
        axes.legend(loc="lower right", fontsize="small")
    return figure


def table(curves: Curves) -> list[dict[str, Any]]:
    """Rows set, method, error, share, for every fourth threshold."""
    return [
        {"set": name, "method": method, "error": float(error), "share": float(share)}
        for (name, method), curve in curves.items()
        for error, share in zip(THRESHOLDS[::4], curve[::4])
    ]


def least_lead(curves: Curves, above: str, below: str) -> tuple[float, str, float]:
    """Least difference of two methods over all sets and thresholds: its size in %, and where it is."""
    leads = {
        name: 100 * (curves[name, above] - curves[name, below]) for name, method in curves if method == above
    }
    name = min(leads, key=lambda one: leads[one].min())
    return float(leads[name].min()), name, float(THRESHOLDS[leads[name].argmin()])


def area(curve: FloatArray) -> float:
    """Area under a curve over [0, 0.25], as a share of the whole."""
    return float(np.trapezoid(curve, THRESHOLDS) / LIMIT)
