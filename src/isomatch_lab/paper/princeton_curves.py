"""Princeton curves of several methods on several sets: computed from the rows of a benchmark run, drawn, compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from isomatch._core.arrays import FloatArray
from isomatch.evaluation import CURVE_LIMIT, THRESHOLDS
from isomatch_lab.paper.benchmark_rows import benchmark_rows
from isomatch_lab.paper.item import Setting
from isomatch_lab.sets import benchmark_set

SETS = ("tosca", "scape")  # sets of the figure
ZERO_CURVE = np.zeros(len(THRESHOLDS))  # start of a sum of curves
Curves = dict[tuple[str, str], FloatArray]
"""Mean curve of each set and method: share of correspondences within each threshold."""


def sets_of(setting: Setting) -> tuple[str, ...]:
    """Names of the sets that are run."""
    return ("example",) if setting.quick else SETS


def measure_curves(setting: Setting, methods: tuple[str, ...]) -> tuple[Curves, dict[str, Any]]:
    """Compute the mean curves of methods, and the facts about them: points, pairs, and pairs without a map."""
    curves: Curves = {}
    facts: dict[str, Any] = {"points": setting.n_points, "pairs": {}, "without a map": {}}
    for name in sets_of(setting):
        chosen = benchmark_set(name, setting.folder).chosen(setting.n_pairs, setting.seed)
        pairs = ["-".join(pair) for pair in chosen.pairs]
        rows = benchmark_rows(setting, name, methods)
        facts["pairs"][name] = pairs
        for method in methods:
            matched = [row for row in rows if row["method"] == method and "curve" in row]
            missing = len(pairs) - len(matched)
            if missing:
                facts["without a map"][f"{name}, {method}"] = missing
            # a pair without a map counts: none of its correspondences is within any error
            curves[name, method] = sum((np.array(row["curve"]) for row in matched), ZERO_CURVE) / len(pairs)
    return curves, facts


def draw(curves: Curves, styles: Mapping[str, tuple[str, dict[str, Any]]], facts: dict[str, Any]) -> Figure:
    """Draw one panel for each set; ``styles`` has the label and line style of each method."""
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
            xlim=(0, CURVE_LIMIT),
            ylim=(0, 101),
        )
        axes.legend(loc="lower right", fontsize="small")
    return figure


def table(curves: Curves) -> list[dict[str, Any]]:
    """Rows with set, method, error and share, for every fourth threshold."""
    return [
        {"set": name, "method": method, "error": float(error), "share": float(share)}
        for (name, method), curve in curves.items()
        for error, share in zip(THRESHOLDS[::4], curve[::4])
    ]


def least_lead(curves: Curves, above: str, below: str) -> tuple[float, str, float]:
    """Least lead of one curve over another, over all sets and thresholds: in %, with the set and threshold."""
    leads = {
        name: 100 * (curves[name, above] - curves[name, below]) for name, method in curves if method == above
    }
    name = min(leads, key=lambda one: leads[one].min())
    return float(leads[name].min()), name, float(THRESHOLDS[leads[name].argmin()])


def area(curve: FloatArray) -> float:
    """Area under a curve on [0, 0.25], divided by 0.25."""
    return float(np.trapezoid(curve, THRESHOLDS) / CURVE_LIMIT)
