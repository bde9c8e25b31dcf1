"""The table of distortions as a bar chart."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from isomatch_lab.paper.item import RUNNERS_UP

LABELS = {
    **RUNNERS_UP,
    "gdd": ("GDD", "#E69F00"),
    "gdd_post": ("GDD + post", "#D55E00"),
}


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Draw bars of distortion / truth, a group for each class; the paper's value of GDD as a line across its bar."""
    figure = Figure((8.5, 4.0), layout="constrained")
    axes = figure.add_subplot(ylabel="mean square distortion / that of the truth")
    shown = [method for method in LABELS if method in rows[0]]
    offsets = dict(zip(shown, np.linspace(-0.4, 0.4, 2 * len(shown) + 1)[1::2]))
    for method, offset in offsets.items():
        label, colour = LABELS[method]
        ratios = [row[f"{method}_over_truth"] for row in rows]
        bars = axes.bar(np.arange(len(rows)) + offset, ratios, 0.8 / len(shown), color=colour, label=label)
        numbers = [f"{ratio:.2f}" for ratio in ratios]
        axes.bar_label(bars, numbers, label_type="center", color="white", size=7, rotation=90, weight="bold")
    published = [(i + offsets["gdd"], row["paper_gdd"]) for i, row in enumerate(rows) if row["paper_gdd"]]
    if published:
        axes.plot(*zip(*published), "k_", markersize=14, label="GDD in the paper")
    axes.axhline(1.0, color="0.4", lw=0.8, label="truth")
    axes.set_xticks(range(len(rows)), [f"{row['class']}\ntruth {row['truth']:.1e}" for row in rows])
    axes.grid(axis="x", visible=False)
    figure.legend(loc="outside upper center", ncols=4, fontsize="small")
    return figure
