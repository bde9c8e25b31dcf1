"""Cumulative curves of benchmark runs: a row of panels for each set."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isomatch._arrays import FloatArray
from isomatch.evaluation.princeton import LIMIT, THRESHOLDS
from isomatch.evaluation.published_curves import PublishedCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (  # Petroff 2021: ten that the colour-blind tell apart
    "#3f90da", "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300", "#b9ac70", "#717581", "#92dadd",
)  # fmt: skip
PUBLISHED = ((0, (1, 1)), (0, (4, 1)), (0, (4, 1, 1, 1)), (0, (8, 2)), (0, (8, 2, 1, 2)), (0, (2, 2)))
DIRECT, EITHER, CONTINUED = "direct truth", "one flip allowed for each pair", "started from another's map"
OWN = "isomatch"


def draw_curves(rows: list[dict[str, Any]], published: Sequence[PublishedCurve], out: Path) -> None:
    """Write ``curves.png`` and ``curves.svg``.

    Each set has a panel of its methods against the direct truth; one against the better side of each pair, where that
    is known and matters; and one of what starts from the maps of others, if anything does.
    """
    from matplotlib.figure import Figure

    sets = list(dict.fromkeys(row["set"] for row in rows if "curve" in row))
    curves = {name: _curves([row for row in rows if row["set"] == name and "curve" in row]) for name in sets}
    columns = [
        kind for kind in (DIRECT, EITHER, CONTINUED) if any(kind in panels for panels in curves.values())
    ]
    families = dict.fromkeys(
        label.split("_5pt")[0].split("+")[0]
        for panels in curves.values()
        for panel in panels.values()
        for label in panel
    )
    colours = {
        name: COLOURS[i % len(COLOURS)] for i, name in enumerate(name for name in families if name != OWN)
    }
    figure = Figure(figsize=(1 + 6.5 * max(len(columns), 1), 4.8 * max(len(sets), 1)), layout="constrained")
    panels = figure.subplots(max(len(sets), 1), max(len(columns), 1), squeeze=False)
    for name, line in zip(sets, panels):
        for kind, axes in zip(columns, line):
            if kind not in curves[name]:
                axes.set_axis_off()
                continue
            suffix = {DIRECT: "", EITHER: "_AllowingFlips", CONTINUED: None}[kind]
            beside = [curve for curve in published if suffix is not None and curve.set_name == name + suffix]
            _panel(axes, curves[name][kind], beside, colours)
            axes.set_title(f"{name}: {kind}" if len(columns) > 1 else name, fontsize="medium")
    for suffix in ("png", "svg"):
        figure.savefig(out / f"curves.{suffix}", dpi=110)


def _curves(rows: list[dict[str, Any]]) -> dict[str, dict[str, tuple[FloatArray, int]]]:
    """Mean curve and number of pairs for each method of one set, by kind of panel."""
    panels: dict[str, dict[str, tuple[FloatArray, int]]] = {}
    for method in dict.fromkeys(row["method"] for row in rows):
        members = [row for row in rows if row["method"] == method]
        direct = np.mean([row["curve"] for row in members], axis=0)
        either = np.mean([row.get("curve_either", row["curve"]) for row in members], axis=0)
        for kind, curve in ((CONTINUED, direct),) if "+" in method else ((DIRECT, direct), (EITHER, either)):
            panels.setdefault(kind, {})[method] = (curve, len(members))
    if CONTINUED in panels and OWN in panels.get(DIRECT, {}):
        panels[CONTINUED][OWN] = panels[DIRECT][OWN]
    same = all(np.array_equal(panels[DIRECT][m][0], panels[EITHER][m][0]) for m in panels.get(DIRECT, {}))
    return {kind: panel for kind, panel in panels.items() if not (kind == EITHER and same)}


def _panel(
    axes: Axes,
    curves: dict[str, tuple[FloatArray, int]],
    beside: Sequence[PublishedCurve],
    colours: dict[str, str],
) -> None:
    """Best curve first in the legend; given landmarks solid, without dotted, continued dashed."""
    for name, (curve, count) in sorted(curves.items(), key=lambda item: -float(item[1][0].mean())):
        base, _, ending = name.partition("+")
        dashes = {
            "": "-" if base.endswith("_5pt") or base in (OWN, "gdd", "gdd_post", "phi") else ":",
            "post": "-.",
        }
        axes.plot(
            THRESHOLDS,
            100 * curve,
            linestyle=dashes.get(ending, "--"),
            color=colours.get(base.split("_5pt")[0], "black"),
            linewidth=2.6 if name == OWN else 1.6,
            zorder=3 if name == OWN else 2,
            label=f"{name} ({count})",
        )
    for theirs, broken in zip(beside, PUBLISHED * len(beside)):
        label = f"{theirs.method} (published)"
        axes.plot(
            theirs.errors, 100 * theirs.shares, linestyle=broken, color="0.5", linewidth=0.9, label=label
        )
    axes.set(
        xlabel="geodesic error / √(target area)", xlim=(0, LIMIT), ylabel="correspondences, %", ylim=(0, 101)
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize="x-small", title="method (pairs)")
